// SPDX-License-Identifier: BSD-3-Clause
// JPEG files by libjpeg.
#pragma once

#include <filesystem>
#include <string>

#include "holba/frontend/photographs/decoded_image.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

// Grey: the brightness that the file holds (Y of YCbCr). CMYK becomes RGB as in COLMAP's reader:
// R = C K, for the values as stored, which programs invert. A file that ends within its pixels is
// read as far as it goes. Throws InputError.
DecodedImage ReadJpeg(const std::filesystem::path& path, bool grey);
// False: it cannot be written.
bool WriteJpeg(const ColourImage& image, const std::filesystem::path& path);
// The bytes of a JPEG file. `quality`: libjpeg's, 0 to 100. At least one pixel.
std::string EncodeJpeg(const ColourImage& image, int quality);

}  // namespace holba
