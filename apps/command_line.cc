// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

bool IsFlag(const std::string& name) { return name == "json" || name == "quiet"; }

const std::vector<std::pair<std::string, HelpForm>> kHelpForms = {{"none", HelpForm::kNone},
                                                                  {"basic", HelpForm::kBasic},
                                                                  {"all", HelpForm::kAll},
                                                                  {"json", HelpForm::kJson}};

size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::vector<size_t>> d(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    for (size_t j = 1; j <= b.size(); ++j) {
      d[i][j] =
          std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
      }
    }
  }
  return d[a.size()][b.size()];
}

std::string_view WithoutSection(std::string_view name) {
  const size_t dot = name.rfind('.');
  return dot == std::string_view::npos ? name : name.substr(dot + 1);
}

std::vector<const Option*> AllOptions(const OptionTable& table, const OptionTable& common) {
  std::vector<const Option*> all;
  for (const Option& option : table.options()) all.push_back(&option);
  for (const Option& option : common.options()) all.push_back(&option);
  return all;
}

std::string UnknownOption(const std::string& name, const std::string& shown,
                          const std::vector<std::string>& known, const Command& command) {
  const std::string nearest = Nearest(name, known);
  return fmt::format("unknown option '{}'{}; see 'holba {} --help all'", shown,
                     nearest.empty() ? "" : fmt::format(", did you mean '--{}'?", nearest),
                     command.name);
}

// Whatever else the words say, who asks for help gets it.
std::optional<HelpForm> HelpAskedFor(const std::vector<std::string>& arguments) {
  for (size_t i = 0; i < arguments.size(); ++i) {
    const std::string& word = arguments[i];
    if (word.starts_with("--help=")) return ParseHelpForm(word.substr(word.find('=') + 1));
    if (word != "--help" && word != "-h") continue;
    const bool has_value = i + 1 < arguments.size() && !arguments[i + 1].starts_with('-');
    return ParseHelpForm(has_value ? arguments[i + 1] : "");
  }
  return std::nullopt;
}

// The words as (name, value), in their order in the table.
std::map<std::string, std::string> ReadWords(const Command& command,
                                             const std::vector<std::string>& arguments,
                                             const std::vector<std::string>& known) {
  CLI::App parser;
  parser.set_help_flag("");
  parser.allow_extras();
  std::map<std::string, CLI::Option*> parsed;
  for (const std::string& name : known) {
    CLI::Option* const option = IsFlag(name)
                                    ? parser.add_flag("--" + name)
                                    : parser.add_option("--" + name);
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    parsed.emplace(name, option);
  }
  try {
    // CLI11 takes the words last one first.
    parser.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    // Left to it are only a value that is missing and a flag with a value that is no flag's.
    throw InputError(fmt::format("the options cannot be understood ({}); see 'holba {} --help'",
                                 error.what(), command.name));
  }
  std::map<std::string, std::string> words;
  for (const auto& [name, option] : parsed) {
    if (option->count() == 0) continue;
    if (IsFlag(name)) {
      words[name] = option->as<bool>() ? "1" : "0";
      continue;
    }
    if (option->results().size() > 1)
      throw InputError(fmt::format("--{} is given twice; give it once", name));
    const std::string& value = option->results().front();
    // Nobody means the next option as a value.
    if (value.starts_with("--")) {
      throw InputError(fmt::format("--{}: expected a value, found the option '{}'", name, value));
    }
    words[name] = value;
  }
  for (const std::string& word : parser.remaining()) {
    if (word.starts_with('-')) {
      std::string name = word.substr(std::min(word.find_first_not_of('-'), word.size()));
      name = name.substr(0, name.find('='));
      throw InputError(UnknownOption(name, word, known, command));
    }
    throw InputError(
        fmt::format("unexpected argument '{}'; give options as --name VALUE, see 'holba {} --help'",
                    word, command.name));
  }
  return words;
}

std::string Trimmed(std::string_view text) {
  const size_t begin = text.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return "";
  return std::string(text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1));
}

}  // namespace

void CommonOptions::Describe(OptionTable* table) const {
  table->Field(
      "config", &config,
      "File of options; the command line overrides it. Lines 'name = value' and '[Section]'.");
  if (has_json) table->Field("json", &json, "Print the result as JSON on standard output.");
  table->Choice("log_level", &log_level,
                {{"debug", LogLevel::kDebug},
                 {"info", LogLevel::kInfo},
                 {"warning", LogLevel::kWarning},
                 {"error", LogLevel::kError},
                 {"off", LogLevel::kOff}},
                "Least important messages to show on standard error.");
  table->Field("quiet", &quiet, "Show errors only.");
  table->Choice("help", &help, kHelpForms,
                "Show the basic options (--help all: every option; --help json: for programs).");
}

HelpForm ParseHelpForm(const std::string& word) {
  if (word.empty()) return HelpForm::kBasic;
  for (const auto& [name, meaning] : kHelpForms) {
    if (word == name && meaning != HelpForm::kNone) return meaning;
  }
  throw InputError(fmt::format("--help: expected basic, all or json, found '{}'", word));
}

void ParseCommandLine(const Command& command, const std::vector<std::string>& arguments,
                      const OptionTable& table, CommonOptions* common) {
  if (const std::optional<HelpForm> help = HelpAskedFor(arguments)) {
    common->help = *help;
    return;
  }
  OptionTable common_table;
  common->has_json = command.supports_json;
  common_table.Bind(common);
  const std::vector<const Option*> options = AllOptions(table, common_table);
  std::map<std::string, const Option*> by_name;
  std::vector<std::string> names;
  for (const Option* option : options) {
    HOLBA_CHECK_MSG(by_name.emplace(option->name, option).second,
                    "a command declares a common option: " + option->name);
    names.push_back(option->name);
  }

  const std::map<std::string, std::string> words = ReadWords(command, arguments, names);
  std::map<std::string, std::string> given;
  if (const auto it = words.find("config"); it != words.end()) {
    std::map<std::string, uint64_t> first_line;
    for (const ConfigEntry& entry : ReadConfigFile(it->second)) {
      const auto found = by_name.find(entry.name);
      if (found == by_name.end() || entry.name == "config" || entry.name == "help") {
        throw InputError::AtLine(it->second, entry.line,
                                 UnknownOption(entry.name, entry.name, names, command));
      }
      const auto [first, is_first] = first_line.emplace(entry.name, entry.line);
      if (!is_first) {
        throw InputError::AtLine(
            it->second, entry.line,
            fmt::format("'{}' is given twice, first in line {}; remove one of the two", entry.name,
                        first->second));
      }
      try {
        found->second->SetText(entry.value);
      } catch (const InputError& error) {
        throw InputError::AtLine(it->second, entry.line, error.what());
      }
      given[entry.name] = entry.value;
    }
  }
  for (const auto& [name, value] : words) {
    by_name.at(name)->SetText(value);
    given[name] = value;
  }
  for (const Option* option : options) {
    const auto it = given.find(option->name);
    if (option->required && (it == given.end() || it->second.empty())) {
      throw InputError(
          fmt::format("--{} must be given; see 'holba {} --help'", option->name, command.name));
    }
  }
}

std::vector<ConfigEntry> ReadConfigFile(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) {
    throw InputError(
        path, "the file of options cannot be opened; --config must be the path of a readable file");
  }
  std::vector<ConfigEntry> entries;
  std::string section;
  std::string text;
  for (uint64_t line = 1; std::getline(file, text); ++line) {
    // Windows' editors put a byte order mark first.
    if (line == 1 && text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
    if (line == 1) RefuseUtf16(text, path);
    text = Trimmed(text);
    if (text.empty() || text[0] == '#' || text[0] == ';') continue;
    if (text.front() == '[') {
      if (text.back() != ']' || text.size() < 3) {
        throw InputError::AtLine(path, line, fmt::format("expected '[Section]', found '{}'", text));
      }
      section = Trimmed(std::string_view(text).substr(1, text.size() - 2));
      continue;
    }
    const size_t equals = text.find('=');
    const std::string key = Trimmed(text.substr(0, std::min(equals, text.size())));
    if (equals == std::string::npos || key.empty()) {
      throw InputError::AtLine(
          path, line, fmt::format("expected 'name = value' or '[Section]', found '{}'", text));
    }
    std::string value = Trimmed(text.substr(equals + 1));
    if (value.size() >= 2 && value.front() == '"' && value.back() == '"') {
      value = value.substr(1, value.size() - 2);
    }
    entries.push_back({section.empty() ? key : section + "." + key, value, line});
  }
  if (file.bad()) throw CannotBeRead(path, SystemFault());
  return entries;
}

std::string Nearest(std::string_view word, const std::vector<std::string>& candidates) {
  for (const std::string& candidate : candidates) {
    if (WithoutSection(candidate) == WithoutSection(word)) return candidate;
  }
  std::string nearest;
  size_t least = std::max<size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const size_t distance =
        std::min(EditDistance(word, candidate), EditDistance(word, WithoutSection(candidate)) + 1);
    // One that shares no letter is no suggestion.
    if (distance < least && distance < candidate.size()) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace holba
