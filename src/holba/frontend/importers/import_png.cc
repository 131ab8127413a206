// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_png.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);
constexpr uint64_t kMaxPixels = uint64_t{1} << 28;

uint32_t BigEndian(std::string_view bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = (value << 8) | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

uint8_t Paeth(int a, int b, int c) {
  const int p = a + b - c;
  const int pa = std::abs(p - a), pb = std::abs(p - b), pc = std::abs(p - c);
  return static_cast<uint8_t>(pa <= pb && pa <= pc ? a : pb <= pc ? b : c);
}

// Undoes a row's filter; `above` is zero for the first. False: no such filter.
bool Unfilter(int filter, size_t pixel_bytes, const std::vector<uint8_t>& above,
              std::vector<uint8_t>* row) {
  std::vector<uint8_t>& x = *row;
  const auto left = [&](size_t i) { return i < pixel_bytes ? 0 : x[i - pixel_bytes]; };
  const auto corner = [&](size_t i) { return i < pixel_bytes ? 0 : above[i - pixel_bytes]; };
  switch (filter) {
    case 0:
      return true;
    case 1:
      for (size_t i = 0; i < x.size(); ++i) x[i] = static_cast<uint8_t>(x[i] + left(i));
      return true;
    case 2:
      for (size_t i = 0; i < x.size(); ++i) x[i] = static_cast<uint8_t>(x[i] + above[i]);
      return true;
    case 3:
      for (size_t i = 0; i < x.size(); ++i) {
        x[i] = static_cast<uint8_t>(x[i] + (left(i) + above[i]) / 2);
      }
      return true;
    case 4:
      for (size_t i = 0; i < x.size(); ++i) {
        x[i] = static_cast<uint8_t>(x[i] + Paeth(left(i), above[i], corner(i)));
      }
      return true;
    default:
      return false;
  }
}

constexpr const char* kEndsEarly = "the PNG picture is truncated";
constexpr const char* kDamagedHeader = "the PNG picture has a damaged header";

}  // namespace

PngImage ParsePng(std::string_view bytes, const std::filesystem::path& path) {
  const auto fail = [&](const std::string& message) {
    throw InputError(path, message + "; save it anew as PNG without interlacing");
  };
  if (!bytes.starts_with(kSignature)) fail("this is no PNG picture");
  PngImage image;
  int colour_type = -1;
  std::string packed;
  bool at_end = false;
  for (size_t at = kSignature.size(); !at_end;) {
    if (bytes.size() - at < 12) fail(kEndsEarly);
    const uint32_t size = BigEndian(bytes, at);
    if (size > bytes.size() - at - 12) fail(kEndsEarly);
    const std::string_view type = bytes.substr(at + 4, 4), data = bytes.substr(at + 8, size);
    const uLong crc = crc32(0, reinterpret_cast<const Bytef*>(bytes.data() + at + 4),
                            static_cast<uInt>(size + 4));
    if (crc != BigEndian(bytes, at + 8 + size)) {
      fail(fmt::format("the PNG picture is damaged (wrong checksum at byte {})", at));
    }
    if (type == "IHDR") {
      if (size != 13 || colour_type != -1) fail(kDamagedHeader);
      const uint64_t width = BigEndian(data, 0), height = BigEndian(data, 4);
      if (width == 0 || height == 0 || width > kMaxPixels || width * height > kMaxPixels) {
        fail(fmt::format("the PNG picture is {} x {} pixels, expected at most {} in all", width,
                         height, kMaxPixels));
      }
      image.width = static_cast<int>(width);
      image.height = static_cast<int>(height);
      image.bit_depth = data[8];
      colour_type = data[9];
      constexpr int kChannels[] = {1, 0, 3, 1, 2, 0, 4};
      image.channels = colour_type >= 0 && colour_type < 7 ? kChannels[colour_type] : 0;
      const int depth = image.bit_depth;
      const bool small = depth == 1 || depth == 2 || depth == 4;
      if (image.channels == 0 || data[10] != 0 || data[11] != 0 ||
          !(depth == 8 || (depth == 16 && colour_type != 3) ||
            (small && (colour_type == 0 || colour_type == 3)))) {
        fail(kDamagedHeader);
      }
      if (data[12] != 0) {
        fail("the PNG picture is interlaced, which is not read");
      }
    } else if (type == "IDAT") {
      packed += data;
    } else if (type == "IEND") {
      at_end = true;
    }
    if (colour_type == -1) fail(kDamagedHeader);
    at += size_t{12} + size;
  }

  const size_t row_bytes =
      (static_cast<size_t>(image.width) * image.channels * image.bit_depth + 7) / 8;
  const uint64_t unpacked = (row_bytes + 1) * static_cast<uint64_t>(image.height);
  // As for archives: deflate cannot make more.
  if (unpacked / 1032 > packed.size() + 64) {
    fail(fmt::format("the PNG picture announces {} x {} pixels but has only {} bytes of them",
                     image.width, image.height, packed.size()));
  }
  z_stream stream{};
  HOLBA_CHECK(inflateInit(&stream) == Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_in = static_cast<uInt>(packed.size());
  const size_t pixel_bytes =
      std::max<size_t>(1, static_cast<size_t>(image.channels) * image.bit_depth / 8);
  const size_t per_row = static_cast<size_t>(image.width) * image.channels;
  image.values.resize(per_row * static_cast<size_t>(image.height));
  std::vector<uint8_t> above(row_bytes, 0), row(row_bytes, 0);
  std::string fault;
  for (int y = 0; y < image.height && fault.empty(); ++y) {
    uint8_t filter = 0;
    const auto read = [&](uint8_t* to, size_t size) {
      stream.next_out = to;
      stream.avail_out = static_cast<uInt>(size);
      const int status = inflate(&stream, Z_SYNC_FLUSH);
      return (status == Z_OK || status == Z_STREAM_END) && stream.avail_out == 0;
    };
    if (!read(&filter, 1) || !read(row.data(), row_bytes)) {
      fault = fmt::format("the PNG picture cannot be unpacked in row {}: it is damaged", y);
    } else if (!Unfilter(filter, pixel_bytes, above, &row)) {
      fault = fmt::format("the PNG picture has an unknown filter in row {}: it is damaged", y);
    }
    uint16_t* out = image.values.data() + per_row * static_cast<size_t>(y);
    if (image.bit_depth == 16) {
      for (size_t i = 0; i < per_row; ++i) {
        out[i] = static_cast<uint16_t>((row[2 * i] << 8) | row[2 * i + 1]);
      }
    } else {
      const int depth = image.bit_depth;
      for (size_t i = 0; i < per_row; ++i) {
        const size_t bit = i * depth;
        out[i] = static_cast<uint16_t>((row[bit / 8] >> (8 - depth - static_cast<int>(bit % 8))) &
                                       ((1 << depth) - 1));
      }
    }
    std::swap(above, row);
  }
  inflateEnd(&stream);
  if (!fault.empty()) fail(fault);
  return image;
}

}  // namespace holba
