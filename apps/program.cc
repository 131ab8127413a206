// SPDX-License-Identifier: BSD-3-Clause
// How a command is found and run.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "apps/build_info.h"
#include "apps/command.h"
#include "apps/command_docs.h"
#include "apps/command_line.h"
#include "holba/base/error.h"
#include "holba/base/printable.h"
#include "holba/base/progress.h"
#include "holba/base/temporary_paths.h"
#include "holba/solver/ranks.h"

namespace holba {
namespace {

constexpr int kDone = 0;
constexpr int kBadInput = 1;
constexpr int kInternalError = 2;
// The command whose work several processes share.
constexpr std::string_view kCommandOnRanks = "adjust";

// Runs `action` and turns what it throws into one message on stderr and an exit status.
template <typename Action>
int Guarded(const std::string& who, const Action& action) {
  std::string message;
  int status = kDone;
  try {
    action();
    return kDone;
  } catch (const ranks::StoppedElsewhere&) {
    return kBadInput;  // the rank that failed says why
  } catch (const InputError& error) {
    message = error.what();
    status = kBadInput;
  } catch (const std::bad_alloc&) {
    message = "not enough memory for this input; use a part of it, or a machine with more";
    status = kBadInput;
  } catch (const std::filesystem::filesystem_error& error) {
    message = InputError(error.path1(), fmt::format("the file system refused it ({}); check the "
                                                    "permissions and the disk",
                                                    error.code().message()))
                  .what();
    status = kBadInput;
  } catch (const std::exception& error) {
    message = fmt::format(
        "internal error: {}\nThis is a fault of holba, not of your input; please "
        "report it with this message, the command and the version ({}).",
        error.what(), HOLBA_VERSION);
    status = kInternalError;
  }
  // The failure follows from the interrupt, whose handler is about to end the process.
  while (Interrupted()) pause();
  std::fflush(stdout);
  std::fputs(fmt::format("{}: {}\n", who, Printable(message)).c_str(), stderr);
  ranks::EndAll(status);
  return status;
}

void RunCommand(const Command& command, const std::vector<std::string>& arguments) {
  const std::unique_ptr<Job> job = command.make_job();
  OptionTable table;
  table.Bind(job.get());
  CommonOptions common;
  ParseCommandLine(command, arguments, table, &common);
  if (common.help != HelpForm::kNone) return PrintResult(CommandHelp(command, common.help));
  SetLogLevel(common.quiet ? std::max(LogLevel::kError, common.log_level) : common.log_level);
  if (const char* core = std::getenv("OPENBLAS_CORETYPE")) LogDebug("OPENBLAS_CORETYPE={}", core);
  if (ranks::LaunchedSize() > 1 && command.name != kCommandOnRanks) {
    ranks::StopAllButFirst();
    throw InputError(
        fmt::format("a launcher has started {} processes, and 'holba {}' runs in one; "
                    "expected a start without mpirun",
                    ranks::LaunchedSize(), command.name));
  }
  ShowProgress(!common.quiet);
  const Invocation invocation{.json = common.json};
  job->ProbeOutputs(invocation);
  job->Run(invocation);
}

std::string UnknownCommand(const std::string& name) {
  std::vector<std::string> names = {"help"};
  for (const Command& command : AllCommands()) names.push_back(command.name);
  const std::string nearest = Nearest(name, names);
  return fmt::format("unknown command '{}'{}; see 'holba help'", name,
                     nearest.empty() ? "" : fmt::format(", did you mean '{}'?", nearest));
}

std::string UnexpectedArgument(const std::string& argument) {
  return fmt::format("unexpected argument '{}'; see 'holba help'", argument);
}

const Command& GetCommand(const std::string& name) {
  const Command* const command = FindCommand(name);
  if (command == nullptr) throw InputError(UnknownCommand(name));
  return *command;
}

}  // namespace

int RunProgram(const std::vector<std::string>& arguments) {
  const std::string first = arguments.empty() ? "help" : arguments.front();
  if (first == "--version" || first == "-V") {
    return Guarded("holba", [] { PrintResult(VersionText()); });
  }
  // For shells and man; no commands that help lists.
  if (first == "completion" || first == "man") {
    return Guarded("holba", [&] {
      if (arguments.size() > 2) throw InputError(UnexpectedArgument(arguments[2]));
      const std::string of = arguments.size() > 1 ? arguments[1] : "";
      PrintResult(first == "man" ? ManPage(of) : CompletionScript(of));
    });
  }
  if (first == "help" || first == "--help" || first == "-h") {
    return Guarded("holba", [&] {
      if (arguments.size() < 2) return PrintResult(ProgramHelp());
      if (arguments.size() > 3) throw InputError(UnexpectedArgument(arguments[3]));
      const Command& command = GetCommand(arguments[1]);
      PrintResult(CommandHelp(command, ParseHelpForm(arguments.size() > 2 ? arguments[2] : "")));
    });
  }
  if (FindCommand(first) == nullptr) {
    return Guarded("holba", [&] {
      throw InputError(first.starts_with('-')
                           ? fmt::format("expected a command, found '{}'; see 'holba help'", first)
                           : UnknownCommand(first));
    });
  }
  return Guarded("holba " + first,
                 [&] { RunCommand(GetCommand(first), {arguments.begin() + 1, arguments.end()}); });
}

}  // namespace holba
