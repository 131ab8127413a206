// SPDX-License-Identifier: BSD-3-Clause
// What the reader of a format of files gives.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace holba {

struct DecodedImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // row by row: one value each, or RGB
  bool ends_early = false;      // the file was cut off; what it lacks is grey
};

// A header may claim any size; this is 200 megapixels in colour.
inline constexpr size_t kMaxImageBytes = size_t{600} << 20;

// The brightness of RGB: 0.299 R + 0.587 G + 0.114 B.
DecodedImage ToGrey(const DecodedImage& colour);

}  // namespace holba
