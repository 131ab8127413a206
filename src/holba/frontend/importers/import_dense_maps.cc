// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_dense_maps.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/importers/import_arrays.h"
#include "holba/frontend/importers/import_label_maps.h"
#include "holba/frontend/importers/import_png.h"
#include "holba/frontend/importers/npz.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

const std::vector<std::string>& Extensions() {
  static const std::vector<std::string> extensions = {".npy", ".npz",           ".png",
                                                      ".bin", ".geometric.bin", ".photometric.bin"};
  return extensions;
}

nlohmann::json ParseObject(std::string_view json, const fs::path& path, const char* expected) {
  nlohmann::json root = nlohmann::json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!root.is_object()) {
    throw InputError(path, std::string("expected an object like ") + expected);
  }
  return root;
}

// One array: the file's, or that of an archive which has one of the names, or only one.
NumericArray ReadArray(const fs::path& path, const std::vector<std::string>& names) {
  if (path.extension() == ".npy") return ParseNpy(ReadFileBytes(path), path.string());
  const NpzArchive archive(ReadFileBytes(path), path);
  for (const std::string& name : names) {
    if (archive.Contains(name)) return archive.Read(name);
  }
  const std::vector<std::string> all = archive.Names();
  if (all.size() == 1) return archive.Read(all.front());
  throw InputError(path, fmt::format("expected one array, or one named '{}', found {}",
                                     names.front(), all.size()));
}

void CheckSize(uint64_t width, uint64_t height, const fs::path& path) {
  constexpr uint64_t kMaxSide = 1 << 20;
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    throw InputError(
        path, fmt::format("expected a map of 1 to 1048576 pixels on each side, found {} x {}",
                          width, height));
  }
}

}  // namespace

DepthFormat ParseDepthFormat(std::string_view json, const fs::path& path) {
  constexpr char kExpected[] = "{\"scale\": 0.001, \"along\": \"z\"}";
  const nlohmann::json root = ParseObject(json, path, kExpected);
  DepthFormat format;
  for (const auto& [key, value] : root.items()) {
    if (key == "scale" && value.is_number() && value.get<double>() > 0.0) {
      format.scale = value.get<double>();
    } else if (key == "along" && (value == "z" || value == "ray")) {
      format.along_ray = value == "ray";
    } else {
      throw InputError(path, "'" + key.substr(0, 40) + "' is not known or has a wrong value; " +
                                 "expected " + kExpected + " with \"along\" z or ray");
    }
  }
  return format;
}

NormalFormat ParseNormalFormat(std::string_view json, const fs::path& path) {
  constexpr char kExpected[] = "{\"axes\": [\"x\", \"-y\", \"-z\"]}";
  const nlohmann::json root = ParseObject(json, path, kExpected);
  const auto fail = [&] {
    throw InputError(path, std::string("expected ") + kExpected +
                               ": each of x, y, z once, with - where it is turned round");
  };
  if (root.size() != 1 || !root.contains("axes") || !root["axes"].is_array() ||
      root["axes"].size() != 3) {
    fail();
  }
  NormalFormat format;
  bool seen[3] = {};
  for (int channel = 0; channel < 3; ++channel) {
    const nlohmann::json& entry = root["axes"][static_cast<size_t>(channel)];
    if (!entry.is_string()) fail();
    std::string text = entry.get<std::string>();
    format.sign[channel] = text.starts_with('-') ? -1.0f : 1.0f;
    if (text.starts_with('-') || text.starts_with('+')) text.erase(0, 1);
    if (text != "x" && text != "y" && text != "z") fail();
    format.axis[channel] = text[0] - 'x';
    if (seen[format.axis[channel]]) fail();
    seen[format.axis[channel]] = true;
  }
  return format;
}

ColmapArray ParseColmapArray(std::string_view bytes, const fs::path& path) {
  ColmapArray array;
  size_t at = 0;
  for (int* extent : {&array.width, &array.height, &array.channels}) {
    const auto [end, error] =
        std::from_chars(bytes.data() + at, bytes.data() + bytes.size(), *extent);
    at = static_cast<size_t>(end - bytes.data());
    if (error != std::errc() || at == bytes.size() || bytes[at] != '&' || *extent <= 0) {
      throw InputError::AtByte(path, at,
                               "expected WIDTH&HEIGHT&CHANNELS& and float32 numbers, as COLMAP "
                               "writes depth and normal maps");
    }
    ++at;
  }
  CheckSize(static_cast<uint64_t>(array.width), static_cast<uint64_t>(array.height), path);
  const uint64_t size = static_cast<uint64_t>(array.width) * static_cast<uint64_t>(array.height) *
                        static_cast<uint64_t>(array.channels);
  if (array.channels > 16 || (bytes.size() - at) / sizeof(float) != size ||
      (bytes.size() - at) % sizeof(float) != 0) {
    throw InputError(
        path, fmt::format("expected {1} bytes of numbers for {2} x {3} pixels and {4} channels, "
                          "found {0}; copy the file anew, as it is truncated or damaged",
                          bytes.size() - at, size * sizeof(float), array.width, array.height,
                          array.channels));
  }
  array.values.resize(size);
  std::memcpy(array.values.data(), bytes.data() + at, size * sizeof(float));
  if constexpr (std::endian::native == std::endian::big) {
    for (float& value : array.values) {
      value = std::bit_cast<float>(__builtin_bswap32(std::bit_cast<uint32_t>(value)));
    }
  }
  return array;
}

DepthMap ReadDepthMap(const fs::path& path, const DepthFormat& format) {
  DepthMap map;
  map.along_ray = format.along_ray;
  double scale = format.scale.value_or(1.0);
  if (path.extension() == ".png") {
    constexpr double kMillimetre = 0.001;
    scale = format.scale.value_or(kMillimetre);
    const PngImage image = ParsePng(ReadFileBytes(path), path);
    if (image.channels != 1 || image.bit_depth != 16) {
      throw InputError(
          path,
          fmt::format("expected a PNG of 16-bit grey as depth map, found {} channels of {} bits",
                      image.channels, image.bit_depth));
    }
    map.width = image.width;
    map.height = image.height;
    map.depth.assign(image.values.begin(), image.values.end());
  } else if (path.extension() == ".bin") {
    ColmapArray array = ParseColmapArray(ReadFileBytes(path), path);
    if (array.channels != 1) {
      throw InputError(path,
                       fmt::format("expected 1 channel of a depth map, found {}", array.channels));
    }
    map.width = array.width;
    map.height = array.height;
    map.depth = std::move(array.values);
  } else {
    const NumericArray array = ReadArray(path, {"depth", "depths", "distance"});
    std::vector<uint64_t> shape = array.shape;
    if (shape.size() == 3 && shape[0] == 1) shape.erase(shape.begin());
    if (shape.size() == 3 && shape[2] == 1) shape.pop_back();
    if (shape.size() != 2) {
      throw InputError(path, "expected a depth map of shape (H, W), found " + array.ShapeText());
    }
    CheckSize(shape[1], shape[0], path);
    map.width = static_cast<int>(shape[1]);
    map.height = static_cast<int>(shape[0]);
    map.depth = array.Values<float>();
  }
  for (float& depth : map.depth) depth = static_cast<float>(depth * scale);
  return map;
}

NormalMap ReadNormalMap(const fs::path& path, const NormalFormat& format) {
  NormalMap map;
  std::vector<float> values;
  bool planes = false;  // all of channel 0, then of 1, of 2
  if (path.extension() == ".png") {
    const PngImage image = ParsePng(ReadFileBytes(path), path);
    if (image.channels != 3) {
      throw InputError(path, fmt::format("expected a PNG of RGB as normal map, found {} channels",
                                         image.channels));
    }
    map.width = image.width;
    map.height = image.height;
    const float full = static_cast<float>((1 << image.bit_depth) - 1);
    values.resize(image.values.size());
    for (size_t i = 0; i < values.size(); ++i) values[i] = 2.0f * image.values[i] / full - 1.0f;
    // Black is what tools write where there is no normal.
    for (size_t i = 0; i < values.size(); i += 3) {
      if (image.values[i] == 0 && image.values[i + 1] == 0 && image.values[i + 2] == 0) {
        values[i] = values[i + 1] = values[i + 2] = 0.0f;
      }
    }
  } else if (path.extension() == ".bin") {
    ColmapArray array = ParseColmapArray(ReadFileBytes(path), path);
    if (array.channels != 3) {
      throw InputError(
          path, fmt::format("expected 3 channels of a normal map, found {}", array.channels));
    }
    map.width = array.width;
    map.height = array.height;
    values = std::move(array.values);
    planes = true;
  } else {
    const NumericArray array = ReadArray(path, {"normals", "normal"});
    std::vector<uint64_t> shape = array.shape;
    if (shape.size() == 4 && shape[0] == 1) shape.erase(shape.begin());
    if (shape.size() == 3 && shape[0] == 3 && shape[2] != 3) {
      planes = true;
      shape = {shape[1], shape[2], 3};
    }
    if (shape.size() != 3 || shape[2] != 3) {
      throw InputError(path, "expected a normal map of shape (H, W, 3) or (3, H, W), found " +
                                 array.ShapeText());
    }
    CheckSize(shape[1], shape[0], path);
    map.width = static_cast<int>(shape[1]);
    map.height = static_cast<int>(shape[0]);
    values = array.Values<float>();
  }
  const size_t size = static_cast<size_t>(map.width) * static_cast<size_t>(map.height);
  map.normals_in_cam.resize(size);
  for (size_t i = 0; i < size; ++i) {
    for (size_t channel = 0; channel < 3; ++channel) {
      const float value = planes ? values[channel * size + i] : values[3 * i + channel];
      map.normals_in_cam[i][format.axis[channel]] = format.sign[channel] * value;
    }
  }
  return map;
}

std::optional<DepthMap> FindDepthMap(const fs::path& folder, const std::string& image_name) {
  const auto path = FindFileOfImage(folder, image_name, Extensions());
  if (!path) return std::nullopt;
  const fs::path json = folder / "depth.json";
  DepthFormat format;
  if (fs::is_regular_file(json)) format = ParseDepthFormat(ReadFileBytes(json), json);
  return ReadDepthMap(*path, format);
}

std::optional<NormalMap> FindNormalMap(const fs::path& folder, const std::string& image_name) {
  const auto path = FindFileOfImage(folder, image_name, Extensions());
  if (!path) return std::nullopt;
  const fs::path json = folder / "normals.json";
  NormalFormat format;
  if (fs::is_regular_file(json)) format = ParseNormalFormat(ReadFileBytes(json), json);
  return ReadNormalMap(*path, format);
}

}  // namespace holba
