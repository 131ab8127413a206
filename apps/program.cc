// SPDX-License-Identifier: BSD-3-Clause
// What the program prints about itself, and how a command is run.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/command_line.h"
#include "holba/base/error.h"
#include "holba/base/temporary_paths.h"

namespace holba {
namespace {

constexpr int kDone = 0;
constexpr int kBadInput = 1;
constexpr int kInternalError = 2;

// The words of `text` in lines of up to 100 columns, each behind `indent` spaces.
std::string Wrapped(const std::string& text, size_t indent) {
  constexpr size_t kWidth = 100;
  std::string lines, line;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (!line.empty() && indent + line.size() + 1 + word.size() > kWidth) {
      lines += std::string(indent, ' ') + line + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
  }
  return lines + std::string(indent, ' ') + line + "\n";
}

// Each paragraph wrapped, but those with lines that begin with a space as they are.
std::string WrappedParagraphs(const std::string& text) {
  std::string result;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find("\n\n", begin), text.size());
    const std::string paragraph = text.substr(begin, end - begin);
    const bool is_laid_out =
        paragraph.starts_with(' ') || paragraph.find("\n ") != std::string::npos;
    result += "\n" + (is_laid_out ? paragraph + "\n" : Wrapped(paragraph, 0));
    begin = end + 2;
  }
  return result;
}

std::string OptionHelp(const Option& option, bool is_flag) {
  std::vector<std::string> facts;
  if (option.required) {
    facts.push_back("required");
  } else if (!is_flag) {
    facts.push_back(option.default_value.empty() ? "default: none"
                                                 : "default: " + option.default_value);
  }
  if (!option.range.empty()) facts.push_back(option.range);
  return fmt::format("  --{}{}{}\n{}", option.name, is_flag ? "" : " " + option.type,
                     facts.empty() ? "" : fmt::format("  ({})", fmt::join(facts, "; ")),
                     Wrapped(option.sentence, 6));
}

std::string SectionOf(const Option& option) {
  const size_t dot = option.name.rfind('.');
  return dot == std::string::npos ? "" : option.name.substr(0, dot);
}

// Runs `action` and turns what it throws into one message on stderr and an exit status.
template <typename Action>
int Guarded(const std::string& who, const Action& action) {
  std::string message;
  int status = kDone;
  try {
    action();
    return kDone;
  } catch (const InputError& error) {
    message = error.what();
    status = kBadInput;
  } catch (const std::bad_alloc&) {
    message = "not enough memory for this input";
    status = kBadInput;
  } catch (const std::filesystem::filesystem_error& error) {
    message = error.what();
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
  std::fputs(fmt::format("{}: {}\n", who, message).c_str(), stderr);
  return status;
}

void RunCommand(const Command& command, const std::vector<std::string>& arguments) {
  const std::unique_ptr<Job> job = command.make_job();
  OptionTable table;
  job->Describe(&table);
  CommonOptions common;
  ParseCommandLine(command, arguments, table, &common);
  if (common.help) return PrintResult(CommandHelp(command));
  SetLogLevel(common.quiet ? std::max(LogLevel::kError, common.log_level) : common.log_level);
  if (const char* core = std::getenv("OPENBLAS_CORETYPE")) LogDebug("OPENBLAS_CORETYPE={}", core);
  job->Run({.json = common.json, .quiet = common.quiet});
}

std::string UnknownCommand(const std::string& name) {
  std::vector<std::string> names = {"help"};
  for (const Command& command : AllCommands()) names.push_back(command.name);
  const std::string nearest = Nearest(name, names);
  return fmt::format("unknown command '{}'{}; see 'holba help'", name,
                     nearest.empty() ? "" : fmt::format(", did you mean '{}'?", nearest));
}

const Command& GetCommand(const std::string& name) {
  const Command* const command = FindCommand(name);
  if (command == nullptr) throw InputError(UnknownCommand(name));
  return *command;
}

}  // namespace

std::string CommandHelp(const Command& command) {
  const std::unique_ptr<Job> job = command.make_job();
  OptionTable table;
  job->Describe(&table);
  std::string usage = "holba " + command.name;
  for (const Option& option : table.options()) {
    if (option.required) usage += fmt::format(" --{} VALUE", option.name);
  }
  std::string help =
      fmt::format("holba {}: {}.\n\nUsage: {} [options]\n", command.name, command.summary, usage);
  help += WrappedParagraphs(command.details);
  std::string section;
  help += "\nOptions:\n";
  for (const Option& option : table.options()) {
    if (SectionOf(option) != section) {
      section = SectionOf(option);
      help += fmt::format("\nOptions [{}]:\n", section);
    }
    help += OptionHelp(option, false);
  }
  CommonOptions common;
  OptionTable common_table;
  common.Describe(command.supports_json, &common_table);
  help += "\nOptions of every command:\n";
  for (const Option& option : common_table.options()) {
    help += OptionHelp(option, option.type == "bool");
  }
  return help;
}

std::string ProgramHelp() {
  size_t width = 0;
  for (const Command& command : AllCommands()) width = std::max(width, command.name.size());
  std::string help = fmt::format(
      "holba {}: holistic bundle adjustment of points, lines and the structures that tie them "
      "together.\n\nUsage: holba COMMAND --name VALUE ...\n\nCommands:\n",
      HOLBA_VERSION);
  for (const Command& command : AllCommands()) {
    help += fmt::format("  {:<{}}  {}\n", command.name, width, command.summary);
  }
  help +=
      "\n'holba COMMAND --help' lists a command's options; 'holba --version' says which version "
      "this is.\n";
  return help;
}

int RunProgram(const std::vector<std::string>& arguments) {
  const std::string first = arguments.empty() ? "help" : arguments.front();
  if (first == "--version" || first == "-V") {
    return Guarded("holba", [] { PrintResult(fmt::format("holba {}\n", HOLBA_VERSION)); });
  }
  if (first == "help" || first == "--help" || first == "-h") {
    return Guarded("holba", [&] {
      PrintResult(arguments.size() > 1 ? CommandHelp(GetCommand(arguments[1])) : ProgramHelp());
    });
  }
  if (FindCommand(first) == nullptr) {
    return Guarded("holba", [&] {
      throw InputError(first.starts_with('-')
                           ? fmt::format("expected a command, found '{}'; see 'holba help'", first)
                           : UnknownCommand(first));
    });
  }
  return Guarded("holba " + first, [&] {
    RunCommand(GetCommand(first), {arguments.begin() + 1, arguments.end()});
  });
}

}  // namespace holba
