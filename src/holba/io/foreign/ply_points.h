// SPDX-License-Identifier: BSD-3-Clause
// The vertices of a PLY file (Turk 1994), as ASCII or little-endian binary, with their colours:
// what programs keep sparse points in.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace holba {

struct PlyPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb{0, 0, 0};
};

// Other properties of the vertices, and all elements behind them, are left out. Throws InputError.
std::vector<PlyPoint> ParsePlyPoints(std::string_view bytes, const std::filesystem::path& path);

}  // namespace holba
