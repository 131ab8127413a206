// SPDX-License-Identifier: BSD-3-Clause
// From words to options: `--name VALUE` or `--name=VALUE`, and a config file that the words
// override.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "apps/command.h"
#include "holba/base/log.h"
#include "holba/base/options.h"

namespace holba {

// What is said instead of running a command.
enum class HelpForm {
  kNone,
  kBasic,  // the basic options, a line each
  kAll,    // every option with type, default, range and sentence
  kJson    // every option as one JSON object, for generators of docs and bindings
};

// The options that every command has.
struct CommonOptions {
  std::string config;  // path; only on the command line
  LogLevel log_level = LogLevel::kInfo;
  bool quiet = false;
  bool json = false;
  HelpForm help = HelpForm::kNone;  // only on the command line
  bool has_json = true;  // no option: whether the command supports --json

  // The flags are declared as booleans; on the command line their name alone sets them. The name
  // of `help` alone, too, is enough.
  void Describe(OptionTable* table) const;
};

// Sets the options of `table` and `common` from the config file (if any), then from `arguments`
// (the words after the command's name). Throws InputError on an unknown option (with the nearest
// one), a value that is missing or not allowed, and a required option that is not given (unless
// help is asked for).
void ParseCommandLine(const Command& command, const std::vector<std::string>& arguments,
                      const OptionTable& table, CommonOptions* common);

// One `key = value` of a config file; name with its section: "Solver.backend".
struct ConfigEntry {
  std::string name;
  std::string value;
  uint64_t line = 0;  // from 1
};

// Lines `key = value`, `[Section]` (which prefixes the keys below it), blank ones and comments (#
// or ;). A value may stand in double quotes. Throws InputError with file and line on anything else.
std::vector<ConfigEntry> ReadConfigFile(const std::filesystem::path& path);

// The candidate that `word` is most likely meant to be: one that differs by its section only, or
// the nearest by Damerau-Levenshtein distance (1964) within a third of its length. Empty: none is
// near.
std::string Nearest(std::string_view word, const std::vector<std::string>& candidates);

// The form that a word names (empty: basic). Throws InputError if it names none.
HelpForm ParseHelpForm(const std::string& word);

// Help of one command in a form that is not kNone: usage, what it does, its options.
std::string CommandHelp(const Command& command, HelpForm form);
// Help of the program: usage and the table of commands.
std::string ProgramHelp();

// Runs the program with the words after its name; returns the exit status: 0 done, 1 a bad file,
// option or too little memory, 2 a fault of the program.
int RunProgram(const std::vector<std::string>& arguments);

}  // namespace holba
