// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_docs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <vector>

#include "apps/command.h"
#include "apps/command_line.h"
#include "holba/base/error.h"

namespace holba {
namespace {

// An option as a shell sees it.
struct Word {
  std::string name;
  std::string sentence;
  std::vector<std::string> choices;
  bool takes_path = false;
  bool takes_value = true;
};

bool TakesPath(const std::string& name) {
  return name == "config" || name == "path" || name.ends_with("_path");
}

// Options of a command with those that every command has.
std::vector<Option> OptionsOf(const Command& command, const Job& job,
                              const CommonOptions& common_options) {
  OptionTable own, common;
  job.Describe(&own);
  common_options.Describe(&common);
  std::vector<Option> options = own.options();
  options.insert(options.end(), common.options().begin(), common.options().end());
  return options;
}

template <typename Use>
void WithOptions(const Command& command, const Use& use) {
  const std::unique_ptr<Job> job = command.make_job();
  CommonOptions common;
  common.has_json = command.supports_json;
  use(OptionsOf(command, *job, common));
}

std::vector<Word> WordsOf(const Command& command) {
  std::vector<Word> words;
  WithOptions(command, [&](const std::vector<Option>& options) {
    for (const Option& option : options) {
      const bool is_flag = option.name == "json" || option.name == "quiet";
      std::vector<std::string> choices = option.choices;
      if (option.type == OptionType::kBool && !is_flag) choices = {"0", "1"};
      words.push_back({option.name, option.sentence, std::move(choices),
                       option.type == OptionType::kText && TakesPath(option.name), !is_flag});
    }
  });
  return words;
}

// `text` with a `mark` before each of the characters.
std::string Escaped(std::string_view text, std::string_view characters, std::string_view mark) {
  std::string escaped;
  for (const char c : text) {
    if (characters.find(c) != std::string_view::npos) escaped += mark;
    escaped += c;
  }
  return escaped;
}

// In single quotes of a shell, within which only they themselves mean something.
std::string Quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string CommandNames() {
  std::string names = "help";
  for (const Command& command : AllCommands()) names += " " + command.name;
  return names;
}

std::string BashScript() {
  std::string script = fmt::format(
      "# bash completion for holba, made by 'holba completion bash'.\n"
      "_holba() {{\n"
      "  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}}\n"
      "  COMPREPLY=()\n"
      "  if ((COMP_CWORD == 1)); then\n"
      "    COMPREPLY=($(compgen -W '{} --version --help' -- \"$current\"))\n"
      "    return\n"
      "  fi\n"
      "  local options=\n"
      "  case ${{COMP_WORDS[1]}} in\n"
      "    help) COMPREPLY=($(compgen -W '{}' -- \"$current\")); return ;;\n",
      CommandNames(), CommandNames());
  for (const Command& command : AllCommands()) {
    std::string options;
    std::string cases;
    for (const Word& word : WordsOf(command)) {
      options += (options.empty() ? "--" : " --") + word.name;
      if (!word.choices.empty()) {
        cases +=
            fmt::format("        --{}) COMPREPLY=($(compgen -W '{}' -- \"$current\")); return ;;\n",
                        word.name, fmt::join(word.choices, " "));
      } else if (!word.takes_path && word.takes_value) {
        cases += fmt::format("        --{}) return ;;\n", word.name);
      }
    }
    script += fmt::format(
        "    {})\n"
        "      case $previous in\n"
        "        --*_path|--config) compopt -o filenames 2>/dev/null\n"
        "          COMPREPLY=($(compgen -f -- \"$current\")); return ;;\n"
        "{}"
        "      esac\n"
        "      options='{}' ;;\n",
        command.name, cases, options);
  }
  return script +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n"
         "}\n"
         "complete -F _holba holba\n";
}

std::string ZshScript() {
  std::string script =
      "#compdef holba\n"
      "# zsh completion for holba, made by 'holba completion zsh'.\n"
      "_holba() {\n"
      "  if ((CURRENT == 2)); then\n"
      "    local -a commands=(\n";
  for (const Command& command : AllCommands()) {
    script += fmt::format("      {}\n",
                          Quoted(command.name + ":" + Escaped(command.summary, ":\\", "\\")));
  }
  script +=
      "    )\n"
      "    _describe command commands\n"
      "    return\n"
      "  fi\n"
      "  case $words[2] in\n";
  for (const Command& command : AllCommands()) {
    script += fmt::format("    {})\n      _arguments '2:: :'", command.name);
    for (const Word& word : WordsOf(command)) {
      std::string spec = fmt::format("--{}[{}]", word.name, Escaped(word.sentence, "[]:\\", "\\"));
      if (!word.choices.empty()) {
        spec += fmt::format(":value:({})", fmt::join(word.choices, " "));
      } else if (word.takes_path) {
        spec += ":path:_files";
      } else if (word.takes_value) {
        spec += ":value: ";
      }
      script += " \\\n        " + Quoted(spec);
    }
    script += " ;;\n";
  }
  return script +
         "  esac\n"
         "}\n"
         "if [[ $funcstack[1] == _holba ]]; then _holba \"$@\"; else compdef _holba holba; fi\n";
}

std::string FishScript() {
  std::string script =
      "# fish completion for holba, made by 'holba completion fish'.\n"
      "complete -c holba -f\n";
  for (const Command& command : AllCommands()) {
    script += fmt::format("complete -c holba -n __fish_use_subcommand -a {} -d {}\n", command.name,
                          Quoted(command.summary));
    for (const Word& word : WordsOf(command)) {
      script += fmt::format(
          "complete -c holba -n '__fish_seen_subcommand_from {}' -l {} -d {}", command.name,
          word.name, Quoted(word.sentence.substr(0, word.sentence.find_first_of(".;(") + 1)));
      if (!word.choices.empty()) {
        script += fmt::format(" -x -a '{}'", fmt::join(word.choices, " "));
      } else if (word.takes_path) {
        script += " -r -F";
      } else if (word.takes_value) {
        script += " -x";
      }
      script += "\n";
    }
  }
  return script;
}

// ---- Manual pages.

// Text whose characters and beginnings of lines roff would take for its own.
std::string Roff(std::string_view text) {
  std::string safe;
  bool at_line_start = true;
  for (const char c : text) {
    if (at_line_start && (c == '.' || c == '\'')) safe += "\\&";
    at_line_start = c == '\n';
    if (c == '\\') {
      safe += "\\e";
    } else if (c == '-') {
      safe += "\\-";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string PageBegin(const std::string& title) {
  std::string upper = title;
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return fmt::format(".TH {} 1 \"\" \"holba {}\" \"User Commands\"\n.ad l\n.SH NAME\n", Roff(upper),
                     HOLBA_VERSION);
}

// Paragraphs apart; those that are laid out with blanks stay as they are.
std::string Paragraphs(const std::string& text) {
  std::string page;
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find("\n\n", begin), text.size());
    const std::string paragraph = text.substr(begin, end - begin);
    const bool is_laid_out =
        paragraph.starts_with(' ') || paragraph.find("\n ") != std::string::npos;
    page +=
        is_laid_out ? ".PP\n.nf\n" + Roff(paragraph) + "\n.fi\n" : ".PP\n" + Roff(paragraph) + "\n";
    begin = end + 2;
  }
  return page;
}

std::string OptionEntry(const Option& option) {
  std::vector<std::string> facts;
  const bool is_flag = option.name == "json" || option.name == "quiet";
  const std::string text = ToText(option.default_value);
  if (option.required) {
    facts.push_back("required");
  } else if (!is_flag && option.name != "help") {
    facts.push_back("default: " + (text.empty() ? "none" : text));
  }
  if (const std::string range = option.range.Text(); !range.empty()) facts.push_back(range);
  std::string entry = fmt::format(".TP\n\\fB\\-\\-{}\\fR", Roff(option.name));
  if (!is_flag) entry += fmt::format(" \\fI{}\\fR", Roff(option.TypeText()));
  entry += "\n" + Roff(option.sentence);
  if (!facts.empty()) entry += Roff(fmt::format(" ({})", fmt::join(facts, "; ")));
  return entry + "\n";
}

std::string CommandPage(const Command& command) {
  std::string page = PageBegin("holba-" + command.name);
  page += fmt::format("holba\\-{} \\- {}\n.SH SYNOPSIS\n\\fBholba {}\\fR", Roff(command.name),
                      Roff(command.summary), Roff(command.name));
  WithOptions(command, [&](const std::vector<Option>& options) {
    for (const Option& option : options) {
      if (option.required)
        page += fmt::format(" \\fB\\-\\-{}\\fR \\fIVALUE\\fR", Roff(option.name));
    }
    page += " [\\fIoptions\\fR]\n";
    if (!command.details.empty()) page += ".SH DESCRIPTION\n" + Paragraphs(command.details);
    page += ".SH OPTIONS\n";
    std::string section;
    for (const Option& option : options) {
      if (option.section != section && !option.section.empty())
        page += fmt::format(".SS {}\n", Roff(option.section));
      if (option.section != section && option.section.empty())
        page += ".SS Options of every command\n";
      section = option.section;
      page += OptionEntry(option);
    }
  });
  return page + ".SH SEE ALSO\n\\fBholba\\fR(1)\n";
}

std::string ProgramPage() {
  std::string page = PageBegin("holba");
  page +=
      "holba \\- holistic bundle adjustment of points, lines and the structures that tie them "
      "together\n.SH SYNOPSIS\n\\fBholba\\fR \\fICOMMAND\\fR \\fB\\-\\-name\\fR \\fIVALUE\\fR ...\n"
      ".SH COMMANDS\n";
  std::string others;
  for (const Command& command : AllCommands()) {
    page += fmt::format(".TP\n\\fB{}\\fR\n{}\n", Roff(command.name), Roff(command.summary));
    others +=
        fmt::format("{}\\fBholba\\-{}\\fR(1)", others.empty() ? "" : ",\n", Roff(command.name));
  }
  return page +
         ".SH OPTIONS\n.TP\n\\fB\\-\\-version\\fR\nThe version, how the program was built, and the "
         "instruction set that it uses.\n.TP\n\\fBCOMMAND \\-\\-help\\fR "
         "[\\fIall\\fR|\\fIjson\\fR]\n"
         "A command's options.\n"
         ".SH EXIT STATUS\n0 if the job was done, 1 if an input or an option is at fault, 2 if "
         "holba is.\n"
         ".SH ENVIRONMENT\n.TP\n\\fBHOLBA_SIMD\\fR\nInstruction set: scalar, vec128, vec256, "
         "vec512.\n.TP\n\\fBOPENBLAS_CORETYPE\\fR\nKernels of OpenBLAS, chosen by the program "
         "unless it is set.\n.SH SEE ALSO\n" +
         others + "\n";
}

}  // namespace

std::string CompletionScript(std::string_view shell) {
  if (shell == "bash") return BashScript();
  if (shell == "zsh") return ZshScript();
  if (shell == "fish") return FishScript();
  throw InputError(fmt::format("completion: expected bash, zsh or fish, found '{}'", shell));
}

std::string ManPage(std::string_view name) {
  if (name.empty()) return ProgramPage();
  const Command* const command = FindCommand(name);
  if (command == nullptr)
    throw InputError(fmt::format("man: expected the name of a command, found '{}'", name));
  return CommandPage(*command);
}

}  // namespace holba
