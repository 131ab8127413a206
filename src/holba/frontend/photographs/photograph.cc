// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/photograph.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/photographs/jpeg_file.h"
#include "holba/frontend/photographs/plain_files.h"
#include "holba/frontend/photographs/png_file.h"
#include "holba/frontend/photographs/tiff_file.h"

namespace holba {
namespace {

std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw CannotBeRead(path, SystemFault());
  return bytes;
}

// What a file says it is by its first bytes: extensions lie.
enum class Format { kUnknown, kJpeg, kPng, kTiff, kBmp, kPnm };

Format FormatOf(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError(path,
                     "there is no such image; --image_path must be the folder that the image "
                     "names of the model belong to");
  }
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) throw CannotBeRead(path, SystemFault());
  char bytes[8] = {};
  const std::string_view head(bytes, std::fread(bytes, 1, sizeof(bytes), file));
  std::fclose(file);
  using namespace std::string_view_literals;
  if (head.starts_with("\xff\xd8\xff"sv)) return Format::kJpeg;
  if (head == "\x89PNG\r\n\x1a\n"sv) return Format::kPng;
  // Also with 64 bit offsets (43, '+').
  for (const std::string_view tiff : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv}) {
    if (head.starts_with(tiff)) return Format::kTiff;
  }
  if (head.starts_with("BM"sv)) return Format::kBmp;
  if (head.size() > 2 && head[0] == 'P' && head[1] >= '1' && head[1] <= '6' &&
      (std::isspace(static_cast<unsigned char>(head[2])) || head[2] == '#')) {
    return Format::kPnm;
  }
  return Format::kUnknown;
}

DecodedImage Decode(const std::filesystem::path& path, bool grey) {
  DecodedImage colour;
  switch (FormatOf(path)) {
    case Format::kJpeg:
      return ReadJpeg(path, grey);
    case Format::kPng:
      colour = ReadPng(path);
      break;
    case Format::kTiff:
      colour = ReadTiff(path);
      break;
    case Format::kBmp:
      colour = ParseBmp(ReadAll(path), path);
      break;
    case Format::kPnm:
      colour = ParsePnm(ReadAll(path), path);
      break;
    case Format::kUnknown:
      throw InputError(path,
                       "expected a JPEG, PNG, TIFF, BMP or PNM (PPM, PGM) file, found another or a "
                       "damaged one; convert it to one of these under the same name");
  }
  return grey ? ToGrey(colour) : colour;
}

}  // namespace

GreyImage ReadGreyImage(const std::filesystem::path& path) {
  DecodedImage image = Decode(path, true);
  return {image.width, image.height, std::move(image.pixels), image.ends_early};
}

ColourImage ReadColourImage(const std::filesystem::path& path) {
  DecodedImage image = Decode(path, false);
  return {image.width, image.height, std::move(image.pixels)};
}

void WriteImage(const ColourImage& image, const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  errno = 0;
  const bool written = extension == ".png" ? WritePng(image, path) : WriteJpeg(image, path);
  if (!written) throw CannotBeWritten(path, SystemFault());
}

}  // namespace holba
