// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_label_maps.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <set>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/importers/import_arrays.h"
#include "holba/frontend/importers/import_names.h"
#include "holba/frontend/importers/import_png.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr char kExpected[] = "expected {\"labels\": {\"1\": \"plane\", \"7\": \"cylinder\"}}";

std::string Upper(std::string text) {
  for (char& c : text) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  return text;
}

// The types that a region of an image can be.
std::string RegionTypeNames() {
  std::string names;
  for (const GroupType* type : AllGroupTypes()) {
    if (!type->TakesPoints()) continue;
    std::string name(type->name);
    for (char& c : name) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

}  // namespace

std::map<uint16_t, const GroupType*> ParseLabelTypes(std::string_view json, const fs::path& path) {
  const nlohmann::json root = nlohmann::json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (root.is_discarded()) {
    throw InputError(path, std::string("this is no JSON, or it is cut off; ") + kExpected);
  }
  if (!root.is_object() || !root.contains("labels") || !root["labels"].is_object()) {
    throw InputError(path, std::string(kExpected) + ", found no object \"labels\"");
  }
  std::map<uint16_t, const GroupType*> types;
  for (const auto& [key, value] : root["labels"].items()) {
    uint16_t label = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), label);
    if (error != std::errc() || end != key.data() + key.size() || label == 0) {
      throw InputError(path, "expected a label of 1 to 65535 (0 is no region), found '" +
                                 key.substr(0, 40) + "'");
    }
    if (value.is_null()) continue;
    const GroupType* type =
        value.is_string() ? FindGroupType(Upper(value.get<std::string>())) : nullptr;
    if (type == nullptr || !type->TakesPoints()) {
      throw InputError(path, fmt::format("label {} is '{}', expected one of {}, or null", label,
                                         value.is_string() ? value.get<std::string>().substr(0, 40)
                                                           : std::string(value.type_name()),
                                         RegionTypeNames()));
    }
    types[label] = type;
  }
  return types;
}

LabelMap ParseLabelPng(std::string_view png, const fs::path& path) {
  PngImage image = ParsePng(png, path);
  if (image.channels != 1) {
    throw InputError(path,
                     fmt::format("expected one number for each pixel of a label map (grey of 8 or "
                                 "16 bits, or indexed colours), found a picture of {} channels",
                                 image.channels));
  }
  return {image.width, image.height, std::move(image.values), {}};
}

std::optional<fs::path> FindFileOfImage(const fs::path& folder, const std::string& image_name,
                                        const std::vector<std::string>& extensions) {
  for (const std::string& name : {image_name, std::string(WithoutExtension(image_name))}) {
    for (const std::string& extension : extensions) {
      const fs::path path = folder / (name + extension);
      if (fs::is_regular_file(path)) return path;
    }
  }
  return std::nullopt;
}

std::optional<LabelMap> ReadLabelMap(const fs::path& folder, const std::string& image_name) {
  const auto png = FindFileOfImage(folder, image_name, {".png"});
  if (!png) return std::nullopt;
  LabelMap map = ParseLabelPng(ReadFileBytes(*png), *png);
  auto json = FindFileOfImage(folder, image_name, {".json"});
  if (!json) json = folder / "labels.json";
  if (!fs::is_regular_file(*json)) {
    throw InputError(*json, std::string("there is no such file, which says what the labels are; ") +
                                kExpected + " there, or beside the PNG");
  }
  map.types = ParseLabelTypes(ReadFileBytes(*json), *json);
  // labels.json speaks of all images.
  const std::set<uint16_t> present(map.labels.begin(), map.labels.end());
  std::erase_if(map.types, [&](const auto& entry) { return !present.contains(entry.first); });
  return map;
}

}  // namespace holba
