// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "holba/base/error.h"

namespace holba {

#define HOLBA_COMMAND(Name) Command Name##Command();
#include "apps/commands/list.inc"
#undef HOLBA_COMMAND

const std::vector<Command>& AllCommands() {
  static const std::vector<Command> commands = {
#define HOLBA_COMMAND(Name) Name##Command(),
#include "apps/commands/list.inc"
#undef HOLBA_COMMAND
  };
  return commands;
}

const Command* FindCommand(std::string_view name) {
  for (const Command& command : AllCommands()) {
    if (command.name == name) return &command;
  }
  return nullptr;
}

namespace {

[[noreturn]] void FailResult() {
  throw InputError(std::string("cannot write the result to standard output: ") +
                   std::strerror(errno));
}

}  // namespace

void PrintResult(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    FailResult();
}

void ProbeResult() {
  if (write(STDOUT_FILENO, "", 0) < 0) FailResult();
}

}  // namespace holba
