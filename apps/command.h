// SPDX-License-Identifier: BSD-3-Clause
// A command of the holba program. To add one:
//   1. apps/commands/NAME.cc: a Job that declares its options and runs, and `Command NameCommand()`
//      (apps/commands/convert.cc is the pattern);
//   2. one line in apps/commands/list.inc.
// Help, the command line, the config file and the checks of values follow from the options.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/options.h"

namespace holba {

// What every command is told besides its own options.
struct Invocation {
  bool json = false;  // print the result as one JSON object (only if Command::supports_json)
};

// One run of a command: its options are members, set before Run.
class Job {
 public:
  virtual ~Job() = default;
  // Declares the options; their defaults are the values that the members have now. What
  // OptionTable::Bind calls for a table that sets them.
  virtual void Describe(OptionTable* table) const = 0;
  // Tries whatever Run will write to (ProbeModelFolder, ProbeFile, ProbeResult, ...), so that hours
  // of work do not end at a folder that cannot be written. Leaves nothing behind. Throws
  // InputError.
  virtual void ProbeOutputs(const Invocation& invocation) const = 0;
  // Read, do, write. Returns only if the job was done; a bad file or option is an InputError.
  virtual void Run(const Invocation& invocation) = 0;
};

struct Command {
  std::string name;     // "convert"
  std::string summary;  // one sentence without a full stop, for the table of commands
  std::string details;  // further paragraphs of `holba NAME --help`; may be empty
  bool supports_json = false;
  // Sections whose options the short help leaves out, though they are basic in other commands.
  std::vector<std::string> advanced_sections = {};
  std::function<std::unique_ptr<Job>()> make_job;
};

// All commands, in the order of apps/commands/list.inc.
const std::vector<Command>& AllCommands();
// Null: unknown.
const Command* FindCommand(std::string_view name);

// As a whole line of ASCII, valid whatever bytes its texts hold: names come from files.
std::string JsonText(const nlohmann::json& json);
// Results go to stdout (messages to stderr, base/log.h), bytes that a terminal would obey escaped.
// Throws InputError if stdout takes no more.
void PrintResult(std::string_view text);
// The same of a stdout that is closed or full now.
void ProbeResult();

// While one lives, results that its thread prints go to it: for callers of commands that are no
// program.
class ResultCapture {
 public:
  ResultCapture();
  ~ResultCapture();
  ResultCapture(const ResultCapture&) = delete;
  ResultCapture& operator=(const ResultCapture&) = delete;

  const std::string& text() const { return text_; }

 private:
  friend void PrintResult(std::string_view text);

  std::string text_;
  ResultCapture* outer_;
};

}  // namespace holba
