// SPDX-License-Identifier: BSD-3-Clause
// What the program says about its commands and their options: for people, short or whole, and for
// programs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "apps/command.h"
#include "apps/command_line.h"

namespace holba {
namespace {

constexpr size_t kWidth = 100;

// The words of `text` in lines of up to kWidth columns, each behind `indent` spaces.
std::string Wrapped(const std::string& text, size_t indent) {
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

// A command with its options; the job outlives the table that refers to it.
struct Described {
  explicit Described(const Command& command_described)
      : command(command_described), job(command.make_job()) {
    job->Describe(&own);
    common_options.has_json = command.supports_json;
    common_options.Describe(&common);
    const auto& advanced = command.advanced_sections;
    for (const Option& option : own.options()) {
      options.push_back(option);
      if (std::find(advanced.begin(), advanced.end(), option.section) != advanced.end())
        options.back().Advanced();
    }
  }

  std::string Beginning() const {
    std::string usage = "holba " + command.name;
    for (const Option& option : options) {
      if (option.required) usage += fmt::format(" --{} VALUE", option.name);
    }
    return fmt::format("holba {}: {}.\n\nUsage: {} [options]\n", command.name, command.summary,
                       usage);
  }

  const Command& command;
  std::unique_ptr<Job> job;
  CommonOptions common_options;
  OptionTable own, common;
  std::vector<Option> options;  // own ones, with their levels in this command
};

// ---- All options, for people.

// Whether its name alone is enough on the command line.
bool IsFlag(const Option& common_option) {
  return common_option.type == OptionType::kBool || common_option.name == "help";
}

std::string WholeHelp(const Option& option, bool is_flag) {
  std::vector<std::string> facts;
  if (option.required) {
    facts.push_back("required");
  } else if (!is_flag) {
    const std::string text = ToText(option.default_value);
    facts.push_back("default: " + (text.empty() ? "none" : text));
  }
  if (const std::string range = option.range.Text(); !range.empty()) facts.push_back(range);
  return fmt::format("  --{}{}{}\n{}", option.name, is_flag ? "" : " " + option.TypeText(),
                     facts.empty() ? "" : fmt::format("  ({})", fmt::join(facts, "; ")),
                     Wrapped(option.sentence, 6));
}

std::string WholeHelp(const Described& of) {
  std::string help = of.Beginning() + WrappedParagraphs(of.command.details) + "\nOptions:\n";
  std::string section;
  for (const Option& option : of.options) {
    if (option.section != section) {
      section = option.section;
      help += fmt::format("\nOptions [{}]:\n", section);
    }
    help += WholeHelp(option, false);
  }
  help += "\nOptions of every command:\n";
  for (const Option& option : of.common.options()) help += WholeHelp(option, IsFlag(option));
  return help;
}

// ---- The basic options, for people: a line each.

// What sentence[0, end) says of its own: it ends at a comma, semicolon, colon or bracket that no
// bracket encloses.
bool IsClause(const std::string& sentence, size_t end) {
  const std::string_view before = std::string_view(sentence).substr(0, end);
  const std::string_view after = std::string_view(sentence).substr(end);
  return std::count(before.begin(), before.end(), '(') ==
             std::count(before.begin(), before.end(), ')') &&
         (after.starts_with("; ") || after.starts_with(": ") || after.starts_with(", ") ||
          after.starts_with(". ") || after.starts_with(" ("));
}

// As many clauses of the sentence as fit, with `ending` before the full stop. Empty: not one.
std::string Shortened(const std::string& sentence, const std::string& ending, size_t width) {
  if (ending.size() >= width) return "";
  const size_t room = width - ending.size();
  size_t end = sentence.size() - 1;  // the full stop
  if (sentence.size() > room) {
    end = std::min(end, room - 1);
    while (end > 0 && !IsClause(sentence, end)) --end;
  }
  return end == 0 ? "" : sentence.substr(0, end) + ending + ".";
}

std::string Shortened(const Option& option, bool is_flag, size_t width) {
  if (option.type == OptionType::kChoice && !is_flag) {
    const std::string with_choices =
        Shortened(option.sentence, " [" + option.TypeText() + "]", width);
    if (!with_choices.empty()) return with_choices;
  }
  const std::string clauses = Shortened(option.sentence, "", width);
  if (!clauses.empty()) return clauses;
  return option.sentence.substr(0, option.sentence.rfind(' ', width - 4)) + " ...";
}

std::string BasicHelp(const Described& of) {
  constexpr size_t kMaxValueWidth = 16;
  struct Line {
    std::string start;  // "--NAME VALUE"
    const Option* option;
    bool is_flag;
  };
  std::vector<Line> lines;
  const auto add = [&](const Option& option, bool is_flag) {
    if (option.level != OptionLevel::kBasic) return;
    std::string value = option.required ? "VALUE" : ToText(option.default_value);
    if (value.empty()) value = "''";
    if (value.size() > kMaxValueWidth) value = value.substr(0, kMaxValueWidth - 3) + "...";
    lines.push_back({"--" + option.name + (is_flag ? "" : " " + value), &option, is_flag});
  };
  for (const Option& option : of.options) add(option, false);
  for (const Option& option : of.common.options()) add(option, IsFlag(option));
  size_t start_width = 0;
  for (const Line& line : lines) start_width = std::max(start_width, line.start.size());

  const std::string& details = of.command.details;
  std::string help = of.Beginning() + WrappedParagraphs(details.substr(0, details.find("\n\n"))) +
                     "\nBasic options, with their defaults:\n";
  for (const Line& line : lines) {
    help += fmt::format("  {:<{}}  {}\n", line.start, start_width,
                        Shortened(*line.option, line.is_flag, kWidth - start_width - 4));
  }

  std::vector<std::string> sections;
  size_t num_advanced = 0;
  for (const Option& option : of.options) {
    if (option.level == OptionLevel::kBasic) continue;
    ++num_advanced;
    const std::string name = option.section.empty() ? "others" : option.section;
    if (std::find(sections.begin(), sections.end(), name) == sections.end())
      sections.push_back(name);
  }
  std::string rest = fmt::format("'holba {} --help all' has every option in full", of.command.name);
  if (num_advanced > 0)
    rest += fmt::format(", {} more: {}", num_advanced, fmt::join(sections, ", "));
  return help + "\n" + Wrapped(rest + ".", 0);
}

// ---- All options, for programs.

nlohmann::ordered_json ToJson(const OptionValue& value) {
  return std::visit([](const auto& v) -> nlohmann::ordered_json { return v; }, value);
}

nlohmann::ordered_json ToJson(const Option& option) {
  // JSON has no infinity: null is no bound.
  const auto bound = [](double x) -> nlohmann::ordered_json {
    if (std::isfinite(x)) return x;
    return nullptr;
  };
  nlohmann::ordered_json json = {
      {"name", option.name},
      {"section", option.section},
      {"type", NameOf(option.type)},
      {"default", ToJson(option.default_value)},
      {"level", option.level == OptionLevel::kBasic ? "basic" : "advanced"},
      {"required", option.required},
      {"sentence", option.sentence}};
  if (option.type == OptionType::kChoice) json["choices"] = option.choices;
  if (option.type == OptionType::kInt || option.type == OptionType::kUint ||
      option.type == OptionType::kDouble || option.type == OptionType::kDoubles) {
    json["range"] = {{"low", bound(option.range.low)},
                     {"high", bound(option.range.high)},
                     {"low_is_open", option.range.low_is_open},
                     {"high_is_open", option.range.high_is_open}};
  }
  return json;
}

std::string JsonHelp(const Described& of) {
  nlohmann::ordered_json json = {{"command", of.command.name},
                                 {"summary", of.command.summary},
                                 {"details", of.command.details},
                                 {"options", nlohmann::ordered_json::array()},
                                 {"common_options", nlohmann::ordered_json::array()}};
  for (const Option& option : of.options) json["options"].push_back(ToJson(option));
  for (const Option& option : of.common.options()) json["common_options"].push_back(ToJson(option));
  return JsonText(json);
}

}  // namespace

std::string CommandHelp(const Command& command, HelpForm form) {
  const Described described(command);
  switch (form) {
    case HelpForm::kAll:
      return WholeHelp(described);
    case HelpForm::kJson:
      return JsonHelp(described);
    default:
      return BasicHelp(described);
  }
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
      "\n'holba COMMAND --help' lists a command's basic options, 'holba COMMAND --help all' every "
      "option;\n'holba --version' says which version this is.\n";
  return help;
}

}  // namespace holba
