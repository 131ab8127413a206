// SPDX-License-Identifier: BSD-3-Clause
// PNG pictures that hold numbers rather than colours: label maps, depth, normals. What is stored
// is returned: indices of a palette instead of its colours, 1 to 16 bits as they are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace holba {

struct PngImage {
  int width = 0;
  int height = 0;
  int channels = 0;              // 1: grey or indices; 2: grey and alpha; 3: RGB; 4: RGB and alpha
  int bit_depth = 0;             // of a number: 1, 2, 4, 8 or 16
  std::vector<uint16_t> values;  // row by row, channels of a pixel together
};

// Throws InputError; interlaced files are refused.
PngImage ParsePng(std::string_view bytes, const std::filesystem::path& path);

}  // namespace holba
