// SPDX-License-Identifier: BSD-3-Clause
// Depth and normal maps from files: npy, npz, PNG, and COLMAP's binary form (docs: Importing
// features).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/frontend/importers/dense_maps.h"

namespace holba {

// FOLDER/depth.json: {"scale": 0.001, "along": "z"}. Scale: depth of a value 1 (PNG: 0.001 without
// the file, others: 1). Along: "z", the optical axis, or "ray".
struct DepthFormat {
  std::optional<double> scale;
  bool along_ray = false;
};
DepthFormat ParseDepthFormat(std::string_view json, const std::filesystem::path& path);

// FOLDER/normals.json: {"axes": ["x", "-y", "-z"]}: what the channels are in the camera frame (x
// right, y down, z forward).
struct NormalFormat {
  int axis[3] = {0, 1, 2};  // of each channel
  float sign[3] = {1.0f, 1.0f, 1.0f};
};
NormalFormat ParseNormalFormat(std::string_view json, const std::filesystem::path& path);

// One file of any of the forms, by its extension. Throw InputError.
DepthMap ReadDepthMap(const std::filesystem::path& path, const DepthFormat& format);
NormalMap ReadNormalMap(const std::filesystem::path& path, const NormalFormat& format);

// Those of an image in a folder: NAME.npy, .npz, .png, .bin, .geometric.bin, .photometric.bin, or
// with NAME's own extension replaced. Empty: there is none.
std::optional<DepthMap> FindDepthMap(const std::filesystem::path& folder,
                                     const std::string& image_name);
std::optional<NormalMap> FindNormalMap(const std::filesystem::path& folder,
                                       const std::string& image_name);

// COLMAP's "width&height&channels&" and float32 values, a plane of the picture for each channel.
struct ColmapArray {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<float> values;
};
ColmapArray ParseColmapArray(std::string_view bytes, const std::filesystem::path& path);

}  // namespace holba
