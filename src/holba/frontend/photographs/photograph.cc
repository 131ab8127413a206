// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/photograph.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "holba/base/error.h"
#include "holba/frontend/photographs/jpeg_file.h"
#include "holba/frontend/photographs/png_file.h"

namespace holba {
namespace {

// What a file says it is by its first bytes: extensions lie.
enum class Format { kUnknown, kJpeg, kPng };

Format FormatOf(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError(path,
                     "there is no such image; --image_path must be the folder that the image "
                     "names of the model belong to");
  }
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) throw InputError(path, "cannot be opened for reading");
  unsigned char head[8] = {};
  const size_t size = std::fread(head, 1, sizeof(head), file);
  std::fclose(file);
  if (size >= 3 && head[0] == 0xff && head[1] == 0xd8 && head[2] == 0xff) return Format::kJpeg;
  constexpr unsigned char kPng[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  if (size == 8 && std::equal(head, head + 8, kPng)) return Format::kPng;
  return Format::kUnknown;
}

DecodedImage Decode(const std::filesystem::path& path, bool grey) {
  switch (FormatOf(path)) {
    case Format::kJpeg:
      return ReadJpeg(path, grey);
    case Format::kPng:
      return ReadPng(path, grey);
    case Format::kUnknown:
      break;
  }
  throw InputError(path,
                   "this is neither a JPEG nor a PNG file, or it is damaged; convert it to one "
                   "of the two under the same name");
}

}  // namespace

GreyImage ReadGreyImage(const std::filesystem::path& path) {
  DecodedImage image = Decode(path, true);
  return {image.width, image.height, std::move(image.pixels)};
}

ColourImage ReadColourImage(const std::filesystem::path& path) {
  DecodedImage image = Decode(path, false);
  return {image.width, image.height, std::move(image.pixels)};
}

void WriteImage(const ColourImage& image, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  const bool written = extension == ".png" ? WritePng(image, path) : WriteJpeg(image, path);
  if (!written)
    throw InputError(
        path, "the picture cannot be written: is the disk full, or the folder write-protected?");
}

}  // namespace holba
