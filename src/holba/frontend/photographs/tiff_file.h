// SPDX-License-Identifier: BSD-3-Clause
// Photographs as TIFF files, by libtiff.
#pragma once

#include <filesystem>

#include "holba/frontend/photographs/decoded_image.h"

namespace holba {

// RGB of the first image of a file with 1 to 16 bits a channel: grey, palettes, RGB, CMYK, YCbCr;
// 16 bits are brought to 8. As stored, without turning it as its orientation says. Throws
// InputError.
DecodedImage ReadTiff(const std::filesystem::path& path);

}  // namespace holba
