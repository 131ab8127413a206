// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/options.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "holba/base/error.h"

namespace holba {
namespace {

template <typename T>
bool ParseNumber(std::string_view text, T* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

[[noreturn]] void Reject(const std::string& name, const std::string& value,
                         const std::string& expected) {
  throw InputError(fmt::format("--{}: '{}' is not {}", name, value, expected));
}

std::string WithRange(const std::string& type, const Range& range) {
  return range.text.empty() ? type : type + " " + range.text;
}

}  // namespace

Range AnyValue() { return {[](double) { return true; }, ""}; }
Range AtLeast(double low) {
  return {[=](double x) { return x >= low; }, fmt::format("at least {}", low)};
}
Range GreaterThan(double low) {
  return {[=](double x) { return x > low; }, fmt::format("greater than {}", low)};
}
Range Between(double low, double high) {
  return {[=](double x) { return x >= low && x <= high; },
          fmt::format("between {} and {}", low, high)};
}

void OptionTable::Add(Option option) {
  if (!section_.empty()) option.name = section_ + "." + option.name;
  for (const Option& other : options_) {
    HOLBA_CHECK_MSG(other.name != option.name, "option declared twice: " + option.name);
  }
  option.default_value = option.get();
  options_.push_back(std::move(option));
}

void OptionTable::Field(std::string name, bool* value, std::string sentence) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  Add({.name = std::move(name), .type = "bool", .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             if (text == "1" || text == "true") {
               *value = true;
             } else if (text == "0" || text == "false") {
               *value = false;
             } else {
               Reject(full, text, "0 or 1");
             }
           },
       .get = [=] { return std::string(*value ? "1" : "0"); }});
}

void OptionTable::Field(std::string name, int* value, Range range, std::string sentence) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  Add({.name = std::move(name), .type = "int", .range = range.text, .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             int parsed = 0;
             if (!ParseNumber(text, &parsed) || !range.contains(parsed)) {
               Reject(full, text, WithRange("a whole number", range));
             }
             *value = parsed;
           },
       .get = [=] { return std::to_string(*value); }});
}

void OptionTable::Field(std::string name, uint64_t* value, Range range, std::string sentence) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  Add({.name = std::move(name), .type = "int", .range = range.text, .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             uint64_t parsed = 0;
             if (!ParseNumber(text, &parsed) || !range.contains(static_cast<double>(parsed))) {
               Reject(full, text, WithRange("a whole number, not negative,", range));
             }
             *value = parsed;
           },
       .get = [=] { return std::to_string(*value); }});
}

void OptionTable::Field(std::string name, double* value, Range range, std::string sentence) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  Add({.name = std::move(name), .type = "float", .range = range.text,
       .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             double parsed = 0;
             if (!ParseNumber(text, &parsed) || !std::isfinite(parsed) || !range.contains(parsed)) {
               Reject(full, text, WithRange("a number", range));
             }
             *value = parsed;
           },
       .get = [=] { return fmt::format("{}", *value); }});
}

void OptionTable::Field(std::string name, std::string* value, std::string sentence) {
  Add({.name = std::move(name), .type = "text", .sentence = std::move(sentence),
       .set = [=](const std::string& text) { *value = text; }, .get = [=] { return *value; }});
}

void OptionTable::Field(std::string name, std::vector<double>* value, Range range,
                        std::string sentence) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  Add({.name = std::move(name), .type = "float,...", .range = range.text,
       .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             std::vector<double> parsed;
             size_t begin = 0;
             while (begin <= text.size()) {
               const size_t end = std::min(text.find(',', begin), text.size());
               double number = 0;
               if (!ParseNumber(std::string_view(text).substr(begin, end - begin), &number) ||
                   !std::isfinite(number) || !range.contains(number)) {
                 Reject(full, text, WithRange("a list a,b,c of numbers", range));
               }
               parsed.push_back(number);
               begin = end + 1;
             }
             *value = parsed;
           },
       .get = [=] { return fmt::format("{}", fmt::join(*value, ",")); }});
}

void OptionTable::AddChoice(std::string name, std::vector<std::string> names, std::string sentence,
                            std::function<void(size_t)> set, std::function<size_t()> get) {
  const std::string full = section_.empty() ? name : section_ + "." + name;
  const std::string type = fmt::format("{}", fmt::join(names, "|"));
  Add({.name = std::move(name), .type = type, .sentence = std::move(sentence),
       .set =
           [=](const std::string& text) {
             for (size_t i = 0; i < names.size(); ++i) {
               if (names[i] == text) return set(i);
             }
             Reject(full, text, "one of " + type);
           },
       .get = [=] { return names[get()]; }});
}

}  // namespace holba
