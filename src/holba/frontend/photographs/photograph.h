// SPDX-License-Identifier: BSD-3-Clause
// Photographs as they are on disk.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace holba {

struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // row by row
  bool ends_early = false;      // the file was cut off (JPEG); what it lacks is grey
};

struct ColourImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // RGB, row by row
};

// JPEG, PNG, TIFF, BMP and PNM, whatever the file's name. As stored, without turning it as its EXIF
// orientation says (COLMAP's habit, too). Throw InputError naming the file.
GreyImage ReadGreyImage(const std::filesystem::path& path);
ColourImage ReadColourImage(const std::filesystem::path& path);
// A mask says where features are looked for: not where it is 0. True where it is not; outside of
// the mask it is 0.
inline bool IsUnmasked(const GreyImage& mask, const Eigen::Vector2d& pixel) {
  if (!(pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < mask.width && pixel.y() < mask.height))
    return false;
  const auto row = static_cast<size_t>(pixel.y()), column = static_cast<size_t>(pixel.x());
  return mask.pixels[row * static_cast<size_t>(mask.width) + column] != 0;
}

// By the file's extension (png, jpg). Throws InputError.
void WriteImage(const ColourImage& image, const std::filesystem::path& path);

}  // namespace holba
