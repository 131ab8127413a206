// SPDX-License-Identifier: BSD-3-Clause
// JPEG files by libjpeg.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "holba/frontend/photographs/photograph.h"

namespace holba {

struct DecodedImage {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;  // row by row: one value each, or RGB
};

// Grey: the brightness that the file holds (Y of YCbCr). Throws InputError.
DecodedImage ReadJpeg(const std::filesystem::path& path, bool grey);
// False: it cannot be written.
bool WriteJpeg(const ColourImage& image, const std::filesystem::path& path);

}  // namespace holba
