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

// The options that every command has.
struct CommonOptions {
  std::string config;  // path; only on the command line
  LogLevel log_level = LogLevel::kInfo;
  bool quiet = false;
  bool json = false;
  bool help = false;  // only on the command line

  // The flags are declared as booleans; on the command line their name alone sets them.
  void Describe(bool supports_json, OptionTable* table);
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

// Help of one command: usage, what it does, all options with type, default, range and sentence.
std::string CommandHelp(const Command& command);
// Help of the program: usage and the table of commands.
std::string ProgramHelp();

// Runs the program with the words after its name; returns the exit status: 0 done, 1 a bad file,
// option or too little memory, 2 a fault of the program.
int RunProgram(const std::vector<std::string>& arguments);

}  // namespace holba
