// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/onnx/onnx_description.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"

namespace holba {
namespace {

using nlohmann::json;

struct NamesOfKind {
  OnnxKind kind;
  std::string_view name;
  std::vector<std::string> inputs, outputs, optional_inputs, optional_outputs;
};
const std::vector<NamesOfKind>& Kinds() {
  static const std::vector<NamesOfKind> kinds = {
      {OnnxKind::kPoints, "points", {"image"}, {"keypoints", "descriptors"}, {}, {"scores"}},
      {OnnxKind::kSegments, "segments", {"image"}, {"segments"}, {}, {"scores"}},
      {OnnxKind::kMatcher,
       "matcher",
       {"keypoints1", "keypoints2", "descriptors1", "descriptors2"},
       {"matches"},
       {},
       {"scores"}}};
  return kinds;
}

const NamesOfKind& NamesOf(OnnxKind kind) {
  for (const NamesOfKind& names : Kinds()) {
    if (names.kind == kind) return names;
  }
  return Kinds()[0];
}

// An object whose keys are taken one by one; what is left over is a mistake.
class Reader {
 public:
  Reader(const std::filesystem::path& path, const json& object) : path_(path), object_(object) {}

  [[noreturn]] void Fail(const std::string& key, const std::string& expected) const {
    const auto found = object_.find(key);
    throw InputError(path_, fmt::format("'{}': {}, found {}", key, expected,
                                        found == object_.end() ? "nothing" : found->dump()));
  }

  const json* Take(const std::string& key) {
    taken_.insert(key);
    const auto found = object_.find(key);
    return found == object_.end() ? nullptr : &*found;
  }

  std::string Text(const std::string& key, const std::optional<std::string>& without) {
    const json* value = Take(key);
    if (value == nullptr && without) return *without;
    if (value == nullptr || !value->is_string() || value->get<std::string>().empty())
      Fail(key, "expected a text");
    return value->get<std::string>();
  }
  double Number(const std::string& key, double without, double low, double high) {
    const json* value = Take(key);
    if (value == nullptr) return without;
    if (!value->is_number() || !(value->get<double>() >= low && value->get<double>() <= high))
      Fail(key, fmt::format("expected a number from {:g} to {:g}", low, high));
    return value->get<double>();
  }
  int Whole(const std::string& key, int without, int low, int high) {
    const double value = Number(key, without, low, high);
    if (value != std::floor(value)) Fail(key, "expected a whole number");
    return static_cast<int>(value);
  }
  bool Truth(const std::string& key, bool without) {
    const json* value = Take(key);
    if (value == nullptr) return without;
    if (!value->is_boolean()) Fail(key, "expected true or false");
    return value->get<bool>();
  }
  std::vector<double> Numbers(const std::string& key, size_t count) {
    const json* value = Take(key);
    if (value == nullptr) return {};
    const std::string expected = fmt::format("expected a list of {} numbers", count);
    if (!value->is_array() || value->size() != count) Fail(key, expected);
    std::vector<double> numbers;
    for (const json& number : *value) {
      if (!number.is_number()) Fail(key, expected);
      numbers.push_back(number.get<double>());
    }
    return numbers;
  }
  std::map<std::string, std::string> Names(const std::string& key,
                                           const std::vector<std::string>& required,
                                           const std::vector<std::string>& optional) {
    const json* value = Take(key);
    if (value == nullptr || !value->is_object())
      Fail(key, "expected an object with names of the model");
    Reader names(path_, *value);
    std::map<std::string, std::string> result;
    for (const std::string& name : required) result[name] = names.Text(name, std::nullopt);
    for (const std::string& name : optional) {
      if (value->contains(name)) result[name] = names.Text(name, std::nullopt);
    }
    names.RefuseOthers();
    return result;
  }

  void RefuseOthers() const {
    for (const auto& [key, value] : object_.items()) {
      if (taken_.contains(key)) continue;
      std::string known;
      for (const std::string& name : taken_) known += (known.empty() ? "" : ", ") + name;
      throw InputError(path_, fmt::format("expected keys among {}, found '{}'", known, key));
    }
  }

 private:
  const std::filesystem::path& path_;
  const json& object_;
  std::set<std::string> taken_;
};

}  // namespace

OnnxDescription ReadOnnxDescription(const std::filesystem::path& path, OnnxKind kind) {
  const std::string bytes = ReadFileBytes(path);
  const json document = json::parse(bytes, nullptr, false);
  if (!document.is_object())
    throw InputError(path,
                     "expected a JSON object that describes an ONNX model, found another text");
  const NamesOfKind& names = NamesOf(kind);
  Reader reader(path, document);
  OnnxDescription result;
  result.kind = kind;
  if (reader.Text("kind", std::nullopt) != names.name)
    reader.Fail("kind", fmt::format("expected '{}'", names.name));
  const auto beside = [&](const std::string& name) {
    return name.empty() ? std::filesystem::path() : path.parent_path() / name;
  };
  result.model = beside(reader.Text("model", std::nullopt));
  result.library = beside(reader.Text("library", ""));
  result.inputs = reader.Names("inputs", names.inputs, names.optional_inputs);
  result.outputs = reader.Names("outputs", names.outputs, names.optional_outputs);
  result.first_pixel = reader.Number("first_pixel", result.first_pixel, 0.0, 1.0);
  result.min_score = reader.Number("min_score", result.min_score, -1e30, 1e30);
  if (kind == OnnxKind::kMatcher) {
    const std::string form = reader.Text("form", "pairs");
    if (form != "pairs" && form != "of_first")
      reader.Fail("form", "expected 'pairs' or 'of_first'");
    result.is_of_first = form == "of_first";
    result.are_normalised = reader.Truth("normalised", result.are_normalised);
    result.are_columns = reader.Truth("columns", result.are_columns);
  } else {
    const std::string colours = reader.Text("colours", "grey");
    if (colours != "grey" && colours != "rgb") reader.Fail("colours", "expected 'grey' or 'rgb'");
    result.channels = colours == "rgb" ? 3 : 1;
    result.max_image_size = reader.Whole("max_image_size", result.max_image_size, 16, 1 << 16);
    result.multiple_of = reader.Whole("multiple_of", result.multiple_of, 1, 1024);
    result.range = reader.Number("range", result.range, 1e-6, 1e6);
    const auto num_channels = static_cast<size_t>(result.channels);
    result.mean = reader.Numbers("mean", num_channels);
    result.deviation = reader.Numbers("deviation", num_channels);
    for (const double value : result.deviation) {
      if (!(value > 0.0)) reader.Fail("deviation", "expected positive numbers");
    }
    result.max_num = reader.Whole("max_num", result.max_num, 1, 1 << 20);
    if (kind == OnnxKind::kPoints) result.are_columns = reader.Truth("columns", false);
  }
  reader.RefuseOthers();
  return result;
}

}  // namespace holba
