// SPDX-License-Identifier: BSD-3-Clause
// What the beginning of a photograph says about it, without decoding its pixels.
#pragma once

#include <cstdint>
#include <filesystem>

#include "holba/frontend/photographs/exif.h"

namespace holba {

struct PhotographHeader {
  uint64_t width = 0, height = 0;
  Exif exif;  // of JPEG, TIFF and PNG files; empty: none
};

// Formats as ReadGreyImage. Throws InputError naming the file if that cannot read it, either. (That
// the header is whole says nothing about the pixels behind it.)
PhotographHeader ReadPhotographHeader(const std::filesystem::path& path);

}  // namespace holba
