// SPDX-License-Identifier: BSD-3-Clause
// Point features of an image before anything of them is known in 3D, as COLMAP's databases hold
// them.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace holba {

struct Keypoints {
  // 2: x y; 4: x y scale orientation; 6: x y a11 a12 a21 a22.
  int num_cols = 2;
  std::vector<float> data;  // row by row

  size_t size() const { return data.size() / num_cols; }
  // Of two columns.
  void Add(const Eigen::Vector2d& xy) {
    data.push_back(static_cast<float>(xy.x()));
    data.push_back(static_cast<float>(xy.y()));
  }
  Eigen::Vector2d Position(size_t idx) const {
    return {data[idx * num_cols], data[idx * num_cols + 1]};
  }
};

struct Descriptors {
  int type = 0;         // COLMAP's: -1 undefined, 0 SIFT, 1 and 2 ALIKED
  int num_bytes = 128;  // of each
  std::vector<uint8_t> data;

  size_t size() const { return data.size() / num_bytes; }
};

}  // namespace holba
