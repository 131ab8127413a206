// SPDX-License-Identifier: BSD-3-Clause
// An option is declared once: name, type, default, range, sentence, level. The command line, the
// config file, help, generators of docs and of bindings read it from an OptionTable. An options
// struct lists its fields so:
//   void Describe(OptionTable* table) const {
//     table->Section("Solver");
//     table->Field("num_rounds", &num_rounds, AtLeast(0), "Most rounds.").Basic();
//   }
// Describe is const, so that the options of a const struct can be listed and read. A table that was
// bound to a struct that may change (OptionTable::Bind) sets values as well.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "holba/base/check.h"

namespace holba {

// Allowed values of a number: an interval with or without its ends.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_is_open = false;  // low itself is not allowed
  bool high_is_open = false;

  bool Contains(double x) const;
  std::string Text() const;  // "at least 0"; empty: any value
};
Range AnyValue();
Range AtLeast(double low);
Range GreaterThan(double low);
Range Between(double low, double high);

enum class OptionType { kBool, kInt, kUint, kDouble, kText, kDoubles, kChoice };
std::string NameOf(OptionType type);  // for programs: "bool", "int", "uint", "double", ...

// Basic options are those of the short help.
enum class OptionLevel { kBasic, kAdvanced };

// The alternative that the type of the option says; a choice holds its name.
using OptionValue =
    std::variant<bool, int, uint64_t, double, std::string, std::vector<double>>;
// As the command line takes it.
std::string ToText(const OptionValue& value);

struct Option {
  std::string name;     // "Solver.max_num_iterations"; without a section: "output_path"
  std::string section;  // "Solver"; empty: none
  OptionType type = OptionType::kText;
  std::vector<std::string> choices;
  OptionValue default_value;  // the value when the option was declared
  Range range;
  std::string sentence;
  OptionLevel level = OptionLevel::kAdvanced;
  bool required = false;

  // For the declaration: the option is part of the short help; it is not; it must be given.
  Option& Basic();
  Option& Advanced();
  Option& Required();

  // For people: "int", "float", "bool", "text", "float,...", or the choices "a|b|c".
  std::string TypeText() const;
  OptionValue Value() const { return read_(); }
  std::string Text() const { return ToText(Value()); }
  // Only of a table that is bound (OptionTable::Bind). Throws InputError naming the option, the
  // value and what is allowed.
  void Set(const OptionValue& value) const;
  void SetText(const std::string& text) const;

 private:
  friend class OptionTable;
  [[noreturn]] void Reject(const std::string& text) const;

  std::function<OptionValue()> read_;
  std::function<void(const OptionValue&)> write_;  // empty: read only
};

// The options of one command or struct, in the order of their declaration. It refers to the
// variables that were described, which must outlive it.
class OptionTable {
 public:
  // The options of `described` (a struct with Describe, or a Job) can be set through this table.
  template <typename Described>
  void Bind(Described* described) {
    const bool was_bound = std::exchange(is_bound_, true);
    described->Describe(this);
    is_bound_ = was_bound;
  }

  // Later fields are named "SECTION.name" and are advanced; an empty section gives plain names,
  // which are basic.
  void Section(std::string name) { section_ = std::move(name); }

  // The options of `described` under a prefix: "PREFIX.SECTION.name". So one table holds several
  // structs of one kind. The section is afterwards what it was before.
  template <typename Described>
  void Nest(const std::string& prefix, const Described& described) {
    const std::string outer_prefix = std::exchange(prefix_, prefix_ + prefix + ".");
    const std::string outer_section = std::exchange(section_, "");
    described.Describe(this);
    prefix_ = outer_prefix;
    section_ = outer_section;
  }

  // What they return is for marks and holds until the next declaration.
  Option& Field(std::string name, const bool* value, std::string sentence);  // 0, 1, true, false
  Option& Field(std::string name, const int* value, Range range, std::string sentence);
  Option& Field(std::string name, const uint64_t* value, Range range, std::string sentence);
  Option& Field(std::string name, const double* value, Range range, std::string sentence);
  Option& Field(std::string name, const std::string* value, std::string sentence);
  Option& Field(std::string name, const std::vector<double>* value, Range range,
                std::string sentence);  // a,b,c

  template <typename Enum>
  Option& Choice(std::string name, const Enum* value,
                 std::vector<std::pair<std::string, std::type_identity_t<Enum>>> choices,
                 std::string sentence) {
    Option option;
    for (const auto& choice : choices) option.choices.push_back(choice.first);
    option.read_ = [value, choices]() -> OptionValue {
      for (const auto& [choice, meaning] : choices) {
        if (meaning == *value) return choice;
      }
      FailCheck(__FILE__, __LINE__, "a value of the list", "the value of a choice");
    };
    if (Enum* const variable = Variable(value)) {
      option.write_ = [variable, choices](const OptionValue& chosen) {
        for (const auto& [choice, meaning] : choices) {
          if (choice == std::get<std::string>(chosen)) *variable = meaning;
        }
      };
    }
    return Add(std::move(name), OptionType::kChoice, std::move(sentence), std::move(option));
  }

  const std::vector<Option>& options() const { return options_; }

 private:
  // Null where the table is not bound. Bind was given what `value` is part of by a pointer through
  // which it may be changed; Describe, which is const, only hid that.
  template <typename T>
  T* Variable(const T* value) const {
    return is_bound_ ? const_cast<T*>(value) : nullptr;
  }
  template <typename T>
  Option& AddField(std::string name, OptionType type, const T* value, Range range,
                   std::string sentence);
  Option& Add(std::string name, OptionType type, std::string sentence, Option option);

  bool is_bound_ = false;
  std::string prefix_;  // with its dot
  std::string section_;
  std::vector<Option> options_;
};

// " name=value" of every option: equal texts, equal options.
template <typename Described>
std::string TextOfOptions(const Described& described) {
  OptionTable table;
  described.Describe(&table);
  std::string text;
  for (const Option& option : table.options()) text += " " + option.name + "=" + option.Text();
  return text;
}

}  // namespace holba
