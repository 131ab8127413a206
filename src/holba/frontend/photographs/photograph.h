// SPDX-License-Identifier: BSD-3-Clause
// Photographs as they are on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace holba {

struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // row by row
};

struct ColourImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // RGB, row by row
};

// As stored, without turning it as its EXIF orientation says (COLMAP's habit, too). Throw
// InputError naming the file.
GreyImage ReadGreyImage(const std::filesystem::path& path);
ColourImage ReadColourImage(const std::filesystem::path& path);
// By the file's extension (png, jpg). Throws InputError.
void WriteImage(const ColourImage& image, const std::filesystem::path& path);

}  // namespace holba
