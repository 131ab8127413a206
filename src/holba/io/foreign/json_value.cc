// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/json_value.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

template <typename T>
std::optional<T> NumberOfText(const std::string& text) {
  T value;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

JsonValue JsonValue::Parse(std::string_view bytes, const std::filesystem::path& path) {
  RefuseUtf16(bytes, path);
  try {
    auto root =
        std::make_shared<const nlohmann::json>(nlohmann::json::parse(bytes.begin(), bytes.end()));
    const nlohmann::json* const json = root.get();
    return {std::move(root), json, std::make_shared<const std::filesystem::path>(path), ""};
  } catch (const nlohmann::json::parse_error& error) {
    throw InputError::AtByte(path, error.byte,
                             fmt::format("expected valid JSON, found a fault in it ({}), "
                                         "perhaps the end of a truncated file",
                                         error.what()));
  } catch (const nlohmann::json::exception& error) {
    throw InputError(
        path, fmt::format("expected valid JSON, found what cannot be read ({})", error.what()));
  }
}

JsonValue JsonValue::Below(const nlohmann::json* json, const std::string& name) const {
  return {root_, json, path_, place_.empty() ? name : place_ + "/" + name};
}

JsonValue JsonValue::At(const std::string& key) const {
  if (!json_->is_object()) FailExpected("an object with \"" + key + "\"");
  const auto found = json_->find(key);
  if (found == json_->end()) {
    Fail(fmt::format("expected \"{}\" in {}, found none; export the model anew", key,
                     place_.empty() ? "the file" : "'" + place_ + "'"));
  }
  return Below(&*found, key);
}

std::optional<JsonValue> JsonValue::Find(const std::string& key) const {
  if (!Has(key)) return std::nullopt;
  return Below(&*json_->find(key), key);
}

JsonValue JsonValue::At(size_t index) const {
  if (!json_->is_array() || index >= json_->size())
    FailExpected(fmt::format("a list of more than {} values", index));
  return Below(&(*json_)[index], std::to_string(index));
}

std::vector<JsonValue> JsonValue::List() const {
  if (!json_->is_array()) FailExpected("a list");
  std::vector<JsonValue> list;
  list.reserve(json_->size());
  for (size_t i = 0; i < json_->size(); ++i) list.push_back(At(i));
  return list;
}

std::vector<std::pair<std::string, JsonValue>> JsonValue::Entries() const {
  if (!json_->is_object()) FailExpected("an object");
  std::vector<std::pair<std::string, JsonValue>> entries;
  for (const auto& [key, value] : json_->items()) entries.emplace_back(key, Below(&value, key));
  return entries;
}

std::optional<double> JsonValue::RealIfAny() const {
  std::optional<double> value;
  if (json_->is_number()) value = json_->get<double>();
  if (json_->is_string()) value = NumberOfText<double>(json_->get_ref<const std::string&>());
  return value && std::isfinite(*value) ? value : std::nullopt;
}

double JsonValue::Real() const {
  const std::optional<double> value = RealIfAny();
  if (!value) FailExpected("a finite number");
  return *value;
}

double JsonValue::RealOr(const std::string& key, double value) const {
  const std::optional<JsonValue> found = Find(key);
  return found ? found->Real() : value;
}

uint64_t JsonValue::Whole() const {
  std::optional<uint64_t> value;
  if (json_->is_number_unsigned()) value = json_->get<uint64_t>();
  if (json_->is_string()) value = NumberOfText<uint64_t>(json_->get_ref<const std::string&>());
  // Python writes sizes as 4000.0 at times; above 2^53 not every whole number is a double.
  if (json_->is_number_float()) {
    const double real = json_->get<double>();
    if (real >= 0.0 && real <= 0x1p53 && std::floor(real) == real)
      value = static_cast<uint64_t>(real);
  }
  if (!value) FailExpected("a whole number of 0 or more");
  return *value;
}

std::string JsonValue::Text() const {
  if (!json_->is_string()) FailExpected("text");
  return json_->get<std::string>();
}

std::string JsonValue::TextOr(const std::string& key, const std::string& value) const {
  const std::optional<JsonValue> found = Find(key);
  return found ? found->Text() : value;
}

std::vector<double> JsonValue::Reals(size_t size) const {
  if (!json_->is_array() || json_->size() != size)
    FailExpected(fmt::format("a list of {} numbers", size));
  std::vector<double> values;
  for (const JsonValue& value : List()) values.push_back(value.Real());
  return values;
}

Eigen::Vector3d JsonValue::Vector3() const {
  const std::vector<double> values = Reals(3);
  return {values[0], values[1], values[2]};
}

Eigen::MatrixXd JsonValue::Matrix(int rows, int cols) const {
  const std::string expected = fmt::format("a matrix of {} rows of {} numbers", rows, cols);
  Eigen::MatrixXd matrix(rows, cols);
  if (!json_->is_array() || json_->empty()) FailExpected(expected);
  if (!json_->front().is_array()) {
    if (json_->size() < static_cast<size_t>(rows * cols)) FailExpected(expected);
    for (int i = 0; i < rows * cols; ++i)
      matrix(i / cols, i % cols) = At(static_cast<size_t>(i)).Real();
    return matrix;
  }
  if (json_->size() < static_cast<size_t>(rows)) FailExpected(expected);
  for (int row = 0; row < rows; ++row) {
    const std::vector<double> values =
        At(static_cast<size_t>(row)).Reals(static_cast<size_t>(cols));
    for (int col = 0; col < cols; ++col) matrix(row, col) = values[static_cast<size_t>(col)];
  }
  return matrix;
}

std::string JsonValue::Found() const {
  constexpr size_t kMost = 40;
  if (json_->is_object()) return "an object";
  if (json_->is_array()) return fmt::format("a list of {}", json_->size());
  std::string text = json_->dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  if (text.size() > kMost) text = text.substr(0, kMost) + "...";
  return text;
}

void JsonValue::FailExpected(const std::string& expected) const {
  throw InputError(*path_, fmt::format("expected {} at '{}', found {}", expected,
                                       place_.empty() ? "/" : place_, Found()));
}

void JsonValue::Fail(const std::string& message) const { throw InputError(*path_, message); }

}  // namespace holba
