// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <type_traits>

#include "holba/base/error.h"

namespace holba {
namespace {

template <typename T>
std::optional<T> ParseNumber(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<OptionValue> ParseNumbers(std::string_view text) {
  std::vector<double> numbers;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::optional<double> number = ParseNumber<double>(text.substr(begin, end - begin));
    if (!number) return std::nullopt;
    numbers.push_back(*number);
    begin = end + 1;
  }
  return numbers;
}

std::optional<OptionValue> Parse(OptionType type, const std::string& text) {
  switch (type) {
    case OptionType::kBool:
      if (text == "1" || text == "true") return true;
      if (text == "0" || text == "false") return false;
      return std::nullopt;
    case OptionType::kInt:
      return ParseNumber<int>(text);
    case OptionType::kUint:
      return ParseNumber<uint64_t>(text);
    case OptionType::kDouble:
      return ParseNumber<double>(text);
    case OptionType::kText:
    case OptionType::kChoice:
      return text;
    case OptionType::kDoubles:
      return ParseNumbers(text);
  }
  return std::nullopt;
}

// The alternative of OptionValue that the type says.
size_t IndexOf(OptionType type) {
  return type == OptionType::kChoice ? OptionValue(std::string()).index()
                                     : static_cast<size_t>(type);
}

bool IsAllowed(const Option& option, const OptionValue& value) {
  if (value.index() != IndexOf(option.type)) return false;
  const auto is_allowed = [&](double x) { return std::isfinite(x) && option.range.Contains(x); };
  return std::visit(
      [&](const auto& v) {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, std::vector<double>>) {
          return std::all_of(v.begin(), v.end(), is_allowed);
        } else if constexpr (std::is_same_v<T, std::string>) {
          return option.type != OptionType::kChoice ||
                 std::find(option.choices.begin(), option.choices.end(), v) != option.choices.end();
        } else if constexpr (std::is_same_v<T, bool>) {
          return true;
        } else {
          return is_allowed(static_cast<double>(v));
        }
      },
      value);
}

std::string Expected(const Option& option) {
  const auto with_range = [&](const char* what) {
    const std::string range = option.range.Text();
    return range.empty() ? std::string(what) : fmt::format("{} {}", what, range);
  };
  switch (option.type) {
    case OptionType::kBool:
      return "0 or 1";
    case OptionType::kInt:
      return with_range("a whole number");
    case OptionType::kUint:
      return with_range("a whole number, not negative,");
    case OptionType::kDouble:
      return with_range("a number");
    case OptionType::kText:
      return "a text";
    case OptionType::kDoubles:
      return with_range("a list a,b,c of numbers");
    case OptionType::kChoice:
      return "one of " + option.TypeText();
  }
  return "";
}

}  // namespace

bool Range::Contains(double x) const {
  return (low_is_open ? x > low : x >= low) && (high_is_open ? x < high : x <= high);
}

std::string Range::Text() const {
  const std::string above = fmt::format("{} {}", low_is_open ? "greater than" : "at least", low);
  const std::string below = fmt::format("{} {}", high_is_open ? "less than" : "at most", high);
  if (std::isinf(low) && std::isinf(high)) return "";
  if (std::isinf(high)) return above;
  if (std::isinf(low)) return below;
  if (low_is_open || high_is_open) return above + ", " + below;
  return fmt::format("between {} and {}", low, high);
}

Range AnyValue() { return {}; }
Range AtLeast(double low) { return {.low = low}; }
Range GreaterThan(double low) { return {.low = low, .low_is_open = true}; }
Range Between(double low, double high) { return {.low = low, .high = high}; }

std::string NameOf(OptionType type) {
  switch (type) {
    case OptionType::kBool:
      return "bool";
    case OptionType::kInt:
      return "int";
    case OptionType::kUint:
      return "uint";
    case OptionType::kDouble:
      return "double";
    case OptionType::kText:
      return "text";
    case OptionType::kDoubles:
      return "doubles";
    case OptionType::kChoice:
      return "choice";
  }
  return "";
}

std::string ToText(const OptionValue& value) {
  return std::visit(
      [](const auto& v) -> std::string {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, bool>) {
          return v ? "1" : "0";
        } else if constexpr (std::is_same_v<T, std::vector<double>>) {
          return fmt::format("{}", fmt::join(v, ","));
        } else {
          return fmt::format("{}", v);
        }
      },
      value);
}

Option& Option::Basic() {
  level = OptionLevel::kBasic;
  return *this;
}

Option& Option::Advanced() {
  level = OptionLevel::kAdvanced;
  return *this;
}

Option& Option::Required() {
  required = true;
  return Basic();
}

std::string Option::TypeText() const {
  switch (type) {
    case OptionType::kUint:
      return NameOf(OptionType::kInt);
    case OptionType::kDouble:
      return "float";
    case OptionType::kDoubles:
      return "float,...";
    case OptionType::kChoice:
      return fmt::format("{}", fmt::join(choices, "|"));
    default:
      return NameOf(type);
  }
}

void Option::Reject(const std::string& text) const {
  throw InputError(fmt::format("--{}: expected {}, found '{}'", name, Expected(*this), text));
}

void Option::Set(const OptionValue& value) const {
  HOLBA_CHECK_MSG(write_ != nullptr, "the table of --" + name + " is not bound: it only reads");
  if (!IsAllowed(*this, value)) Reject(ToText(value));
  write_(value);
}

void Option::SetText(const std::string& text) const {
  const std::optional<OptionValue> value = Parse(type, text);
  if (!value || !IsAllowed(*this, *value)) Reject(text);
  Set(*value);
}

Option& OptionTable::Add(std::string name, OptionType type, std::string sentence, Option option) {
  option.section = prefix_ + section_;
  if (section_.empty() && !prefix_.empty()) option.section.pop_back();
  option.name = option.section.empty() ? std::move(name) : option.section + "." + name;
  for (const Option& other : options_) {
    HOLBA_CHECK_MSG(other.name != option.name, "option declared twice: " + option.name);
  }
  option.type = type;
  option.sentence = std::move(sentence);
  option.level = option.section.empty() ? OptionLevel::kBasic : OptionLevel::kAdvanced;
  option.default_value = option.Value();
  options_.push_back(std::move(option));
  return options_.back();
}

template <typename T>
Option& OptionTable::AddField(std::string name, OptionType type, const T* value, Range range,
                              std::string sentence) {
  Option option;
  option.range = range;
  option.read_ = [value]() -> OptionValue { return *value; };
  if (T* const variable = Variable(value))
    option.write_ = [variable](const OptionValue& given) { *variable = std::get<T>(given); };
  return Add(std::move(name), type, std::move(sentence), std::move(option));
}

Option& OptionTable::Field(std::string name, const bool* value, std::string sentence) {
  return AddField(std::move(name), OptionType::kBool, value, {}, std::move(sentence));
}

Option& OptionTable::Field(std::string name, const int* value, Range range, std::string sentence) {
  return AddField(std::move(name), OptionType::kInt, value, range, std::move(sentence));
}

Option& OptionTable::Field(std::string name, const uint64_t* value, Range range,
                           std::string sentence) {
  return AddField(std::move(name), OptionType::kUint, value, range, std::move(sentence));
}

Option& OptionTable::Field(std::string name, const double* value, Range range,
                           std::string sentence) {
  return AddField(std::move(name), OptionType::kDouble, value, range, std::move(sentence));
}

Option& OptionTable::Field(std::string name, const std::string* value, std::string sentence) {
  return AddField(std::move(name), OptionType::kText, value, {}, std::move(sentence));
}

Option& OptionTable::Field(std::string name, const std::vector<double>* value, Range range,
                           std::string sentence) {
  return AddField(std::move(name), OptionType::kDoubles, value, range, std::move(sentence));
}

}  // namespace holba
