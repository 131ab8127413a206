// SPDX-License-Identifier: BSD-3-Clause
// An option is declared once: name, type, default, range, sentence. The command line, the config file,
// Python and the docs read it from an OptionTable. An options struct lists its fields so:
//   void Describe(OptionTable* table) {
//     table->Section("Solver");
//     table->Field("max_num_iterations", &max_num_iterations, AtLeast(0), "Most iterations.");
//   }
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/base/check.h"

namespace holba {

// Allowed values of a number, and how to say so.
struct Range {
  std::function<bool(double)> contains;
  std::string text;  // "at least 0"
};
Range AnyValue();
Range AtLeast(double low);
Range GreaterThan(double low);
Range Between(double low, double high);

struct Option {
  std::string name;           // "Solver.max_num_iterations"; without a section: "output_path"
  std::string type;           // "int", "float", "bool", "text", or the choices "a|b|c"
  std::string default_value;  // as the command line takes it
  std::string range;          // empty: any value
  std::string sentence;
  bool required = false;
  // Throws InputError naming the option, the value and what is allowed.
  std::function<void(const std::string& value)> set;
  std::function<std::string()> get;
};

// The options of one command, bound to the variables that they set.
class OptionTable {
 public:
  // Later fields are named "SECTION.name"; an empty section gives plain names.
  void Section(std::string name) { section_ = std::move(name); }

  void Field(std::string name, bool* value, std::string sentence);  // 0 or 1 (true and false accepted)
  void Field(std::string name, int* value, Range range, std::string sentence);
  void Field(std::string name, uint64_t* value, Range range, std::string sentence);
  void Field(std::string name, double* value, Range range, std::string sentence);
  void Field(std::string name, std::string* value, std::string sentence);
  void Field(std::string name, std::vector<double>* value, Range range, std::string sentence);  // a,b,c

  template <typename Enum>
  void Choice(std::string name, Enum* value,
              std::vector<std::pair<std::string, std::type_identity_t<Enum>>> choices,
              std::string sentence) {
    std::vector<std::string> names;
    for (const auto& choice : choices) names.push_back(choice.first);
    AddChoice(
        std::move(name), names, std::move(sentence),
        [value, choices](size_t i) { *value = choices[i].second; },
        [value, choices] {
          for (size_t i = 0; i < choices.size(); ++i) {
            if (choices[i].second == *value) return i;
          }
          HOLBA_CHECK_MSG(false, "the value of a choice is not in its list");
          return size_t{0};
        });
  }

  // The option added last must be given.
  void Required() { options_.back().required = true; }

  const std::vector<Option>& options() const { return options_; }

 private:
  void Add(Option option);
  void AddChoice(std::string name, std::vector<std::string> names, std::string sentence,
                 std::function<void(size_t)> set, std::function<size_t()> get);

  std::string section_;
  std::vector<Option> options_;
};

}  // namespace holba
