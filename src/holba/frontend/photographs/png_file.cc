// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/png_file.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/photographs/decode_fault.h"

namespace holba {
namespace {

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// As libjpeg, libpng leaves by a jump.
struct PngErrorHandler {
  std::jmp_buf back;
  char message[200] = {};
};

[[noreturn]] void Fail(png_structp png, png_const_charp message) {
  auto* handler = static_cast<PngErrorHandler*>(png_get_error_ptr(png));
  std::snprintf(handler->message, sizeof(handler->message), "%s", message);
  std::longjmp(handler->back, 1);
}

void Ignore(png_structp, png_const_charp) {}

// RGB. False: handler->message says why.
bool DecodePng(std::FILE* file, PngErrorHandler* handler, DecodedImage* image) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, handler, Fail, Ignore);
  if (png == nullptr) return false;
  // Before setjmp: what changes after it is lost in the jump.
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(handler->back)) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_init_io(png, file);
  png_read_info(png, info);
  png_set_expand(png);
  png_set_scale_16(png);
  png_set_strip_alpha(png);
  png_set_gray_to_rgb(png);
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const size_t width = png_get_image_width(png, info), height = png_get_image_height(png, info);
  const size_t row_bytes = 3 * width;
  if (png_get_rowbytes(png, info) != row_bytes || row_bytes * height > kMaxImageBytes)
    Fail(png, "images of this kind or size are not read");
  image->width = static_cast<int>(width);
  image->height = static_cast<int>(height);
  image->pixels.resize(row_bytes * height);
  for (int pass = 0; pass < passes; ++pass) {
    for (size_t y = 0; y < height; ++y)
      png_read_row(png, image->pixels.data() + row_bytes * y, nullptr);
  }
  png_read_end(png, nullptr);
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

struct Rows {
  int width, height;
  int bits, colour_type;  // of a channel; libpng's
  const void* first;
  size_t bytes_of_row;
};

bool EncodePng(const Rows& rows, std::FILE* file) {
  PngErrorHandler handler;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &handler, Fail, Ignore);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(handler.back)) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  png_set_IHDR(png, info, static_cast<png_uint_32>(rows.width),
               static_cast<png_uint_32>(rows.height), rows.bits, rows.colour_type,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // Pictures are drawn, so that fast compression makes small files, too.
  png_set_compression_level(png, 3);
  png_write_info(png, info);
  // Files have the larger byte of a number first.
  if (rows.bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
  for (size_t y = 0; y < static_cast<size_t>(rows.height); ++y)
    png_write_row(png, static_cast<png_const_bytep>(rows.first) + rows.bytes_of_row * y);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

bool Write(const Rows& rows, const std::filesystem::path& path) {
  File file(std::fopen(path.c_str(), "wb"), std::fclose);
  if (!file || !EncodePng(rows, file.get())) return false;
  return std::fclose(file.release()) == 0;
}

}  // namespace

DecodedImage ReadPng(const std::filesystem::path& path) {
  const File file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw CannotBeRead(path, SystemFault());
  DecodedImage image;
  PngErrorHandler handler;
  if (!DecodePng(file.get(), &handler, &image)) throw CannotBeDecoded(path, "PNG", handler.message);
  return image;
}

bool WritePng(const ColourImage& image, const std::filesystem::path& path) {
  return Write({image.width, image.height, 8, PNG_COLOR_TYPE_RGB, image.pixels.data(),
                3 * static_cast<size_t>(image.width)},
               path);
}

bool WriteNumberPng(int width, int height, const std::vector<uint16_t>& numbers,
                    const std::filesystem::path& path) {
  return Write({width, height, 16, PNG_COLOR_TYPE_GRAY, numbers.data(),
                sizeof(uint16_t) * static_cast<size_t>(width)},
               path);
}

}  // namespace holba
