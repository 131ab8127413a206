// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

#include "holba/base/file_faults.h"
#include "holba/base/printable.h"

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

thread_local ResultCapture* capture = nullptr;  // the innermost one of this thread

[[noreturn]] void FailResult() {
  throw InputError(
      fmt::format("the result cannot be written to standard output ({}); check the file or program "
                  "that it goes to",
                  SystemFault()));
}

}  // namespace

ResultCapture::ResultCapture() : outer_(capture) { capture = this; }
ResultCapture::~ResultCapture() { capture = outer_; }

void PrintResult(std::string_view text) {
  if (capture != nullptr) {
    capture->text_ += text;
    return;
  }
  const std::string printable = Printable(text);
  if (std::fwrite(printable.data(), 1, printable.size(), stdout) != printable.size() ||
      std::fflush(stdout) != 0) {
    FailResult();
  }
}

std::string JsonText(const nlohmann::json& json) {
  // What is no UTF-8 would be an error, and DEL and the controls of Latin-1 are not escaped else.
  return json.dump(2, ' ', /*ensure_ascii=*/true, nlohmann::json::error_handler_t::replace) + "\n";
}

void ProbeResult() {
  if (capture != nullptr) return;
  if (write(STDOUT_FILENO, "", 0) < 0) FailResult();
}

}  // namespace holba
