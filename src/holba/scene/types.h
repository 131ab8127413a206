// SPDX-License-Identifier: BSD-3-Clause
// Ids and indices, as in COLMAP: an id is a key, an idx counts from 0.
#pragma once

#include <compare>
#include <cstdint>
#include <limits>

namespace holba {

using camera_t = uint32_t;
using rig_t = uint32_t;
using frame_t = uint32_t;
using image_t = uint32_t;
using point2D_t = uint32_t;
using line2D_t = uint32_t;
using group2D_t = uint32_t;
using point3D_t = uint64_t;
using line3D_t = uint64_t;
using group3D_t = uint64_t;

// "No feature" and "no group": -1 in text, 2^64 - 1 in binary.
inline constexpr uint64_t kNoId = std::numeric_limits<uint64_t>::max();
inline constexpr uint32_t kInvalidId32 = std::numeric_limits<uint32_t>::max();

enum class SensorType : int32_t { kInvalid = -1, kCamera = 0, kImu = 1 };

struct SensorId {
  SensorType type = SensorType::kInvalid;
  uint32_t id = kInvalidId32;
  friend auto operator<=>(const SensorId&, const SensorId&) = default;
};

}  // namespace holba
