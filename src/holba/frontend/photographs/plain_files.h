// SPDX-License-Identifier: BSD-3-Clause
// Photographs in formats simple enough to be read without a library: BMP and PNM (PPM, PGM, PBM).
#pragma once

#include <filesystem>
#include <string_view>

#include "holba/frontend/photographs/decoded_image.h"

namespace holba {

// RGB. Of Windows' BMP: 1, 4, 8 bits with a palette, 16, 24, 32 bits, uncompressed. Throws
// InputError naming `path`.
DecodedImage ParseBmp(std::string_view bytes, const std::filesystem::path& path);

// RGB. P1 to P6; values are brought to 8 bits. Throws InputError naming `path`.
DecodedImage ParsePnm(std::string_view bytes, const std::filesystem::path& path);

}  // namespace holba
