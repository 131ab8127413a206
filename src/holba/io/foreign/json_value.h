// SPDX-License-Identifier: BSD-3-Clause
// A value of a JSON file with its place in it ("shots/01.jpg/rotation"), so that whatever is not as
// it must be is said with file, place and what was expected. Readers of other programs' files go
// through it and never touch a value of the wrong kind.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace holba {

class JsonValue {
 public:
  // `path` is for messages only. Throws InputError with the byte if it is no JSON.
  static JsonValue Parse(std::string_view bytes, const std::filesystem::path& path);

  bool Has(const std::string& key) const { return json_->is_object() && json_->contains(key); }
  // The value of a key, which must be there.
  JsonValue At(const std::string& key) const;
  std::optional<JsonValue> Find(const std::string& key) const;
  JsonValue At(size_t index) const;  // of a list; the index must exist

  // The elements of a list; each key of an object with its value. Throw if it is neither.
  std::vector<JsonValue> List() const;
  std::vector<std::pair<std::string, JsonValue>> Entries() const;
  bool IsList() const { return json_->is_array(); }
  bool IsObject() const { return json_->is_object(); }

  // A finite number; Meshroom's files hold numbers as text, which is read, too.
  double Real() const;
  double RealOr(const std::string& key, double value) const;
  uint64_t Whole() const;  // 0 or more
  std::string Text() const;
  std::string TextOr(const std::string& key, const std::string& value) const;
  // Exactly `size` finite numbers.
  std::vector<double> Reals(size_t size) const;
  Eigen::Vector3d Vector3() const;
  // A list of rows of a matrix, or of its values row by row; more rows than wanted are not looked
  // at (the last one of a transformation).
  Eigen::MatrixXd Matrix(int rows, int cols) const;

  // "expected EXPECTED at PLACE, found ...".
  [[noreturn]] void FailExpected(const std::string& expected) const;
  // `message`: a whole one, with its remedy.
  [[noreturn]] void Fail(const std::string& message) const;
  const std::string& place() const { return place_; }

 private:
  JsonValue(std::shared_ptr<const nlohmann::json> root, const nlohmann::json* json,
            std::shared_ptr<const std::filesystem::path> path, std::string place)
      : root_(std::move(root)), json_(json), path_(std::move(path)), place_(std::move(place)) {}
  JsonValue Below(const nlohmann::json* json, const std::string& name) const;
  std::optional<double> RealIfAny() const;
  std::string Found() const;  // the value, short

  std::shared_ptr<const nlohmann::json> root_;
  const nlohmann::json* json_;
  std::shared_ptr<const std::filesystem::path> path_;
  std::string place_;
};

}  // namespace holba
