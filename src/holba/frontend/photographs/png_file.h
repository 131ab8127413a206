// SPDX-License-Identifier: BSD-3-Clause
// Photographs and pictures as PNG files, by libpng. (Label maps are read by import_png.h: their
// values are numbers, not colours.)
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "holba/frontend/photographs/decoded_image.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

// Of any kind of PNG: palettes and 16 bits are brought to 8 bits a channel, transparency is left
// out. RGB. Throws InputError.
DecodedImage ReadPng(const std::filesystem::path& path);
// False: it cannot be written.
bool WritePng(const ColourImage& image, const std::filesystem::path& path);
// Numbers row by row, as grey of 16 bits: a label map. False: it cannot be written.
bool WriteNumberPng(int width, int height, const std::vector<uint16_t>& numbers,
                    const std::filesystem::path& path);

}  // namespace holba
