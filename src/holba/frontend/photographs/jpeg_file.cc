// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/jpeg_file.h"

#include <csetjmp>
#include <cstdio>
// libjpeg's header wants stdio's first.
#include <jpeglib.h>
// Codes of messages.
#include <jerror.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/photographs/decode_fault.h"

namespace holba {
namespace {

constexpr int kQuality = 92;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// libjpeg's way out of an error is a jump: nothing with a destructor may be made between setjmp and
// the calls that may fail.
struct JpegErrorHandler {
  jpeg_error_mgr manager;
  std::jmp_buf back;
  char message[JMSG_LENGTH_MAX] = {};
  bool ends_early = false;
};

void Fail(j_common_ptr info) {
  auto* handler = reinterpret_cast<JpegErrorHandler*>(info->err);
  info->err->format_message(info, handler->message);
  std::longjmp(handler->back, 1);
}

void Ignore(j_common_ptr) {}

// Most warnings are about what does not matter.
void Warn(j_common_ptr info, int level) {
  if (level < 0 && info->err->msg_code == JWRN_JPEG_EOF)
    reinterpret_cast<JpegErrorHandler*>(info->err)->ends_early = true;
}

void SetHandler(JpegErrorHandler* handler) {
  jpeg_std_error(&handler->manager);
  handler->manager.error_exit = Fail;
  handler->manager.emit_message = Warn;
  handler->manager.output_message = Ignore;
}

// False: handler->message says why. `channels`: 1, 3 or 4 (CMYK, whatever `grey` says).
bool DecodeJpeg(std::FILE* file, bool grey, JpegErrorHandler* handler, DecodedImage* image,
                size_t* channels) {
  jpeg_decompress_struct info;
  SetHandler(handler);
  info.err = &handler->manager;
  if (setjmp(handler->back)) {
    jpeg_destroy_decompress(&info);
    return false;
  }
  jpeg_create_decompress(&info);
  jpeg_stdio_src(&info, file);
  jpeg_read_header(&info, TRUE);
  const bool is_cmyk = info.jpeg_color_space == JCS_CMYK || info.jpeg_color_space == JCS_YCCK;
  info.out_color_space = is_cmyk ? JCS_CMYK : grey ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_start_decompress(&info);
  *channels = is_cmyk ? 4 : grey ? 1 : 3;
  const size_t row_bytes = *channels * info.output_width;
  if (static_cast<size_t>(info.output_components) != *channels ||
      row_bytes * info.output_height > kMaxImageBytes) {
    std::snprintf(handler->message, sizeof(handler->message),
                  "images of this kind or size are not read");
    jpeg_destroy_decompress(&info);
    return false;
  }
  image->width = static_cast<int>(info.output_width);
  image->height = static_cast<int>(info.output_height);
  image->pixels.resize(row_bytes * info.output_height);
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = image->pixels.data() + row_bytes * info.output_scanline;
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return true;
}

// `set_destination`: where the bytes go.
template <typename SetDestination>
bool EncodeJpegTo(const ColourImage& image, int quality, SetDestination set_destination) {
  jpeg_compress_struct info;
  JpegErrorHandler handler;
  SetHandler(&handler);
  info.err = &handler.manager;
  if (setjmp(handler.back)) {
    jpeg_destroy_compress(&info);
    return false;
  }
  jpeg_create_compress(&info);
  set_destination(&info);
  info.image_width = static_cast<JDIMENSION>(image.width);
  info.image_height = static_cast<JDIMENSION>(image.height);
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<uint8_t*>(image.pixels.data()) +
                   3 * static_cast<size_t>(image.width) * info.next_scanline;
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  return true;
}

}  // namespace

DecodedImage ReadJpeg(const std::filesystem::path& path, bool grey) {
  const File file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (!file) throw CannotBeRead(path, SystemFault());
  DecodedImage image;
  JpegErrorHandler handler;
  size_t channels = 0;
  if (!DecodeJpeg(file.get(), grey, &handler, &image, &channels))
    throw CannotBeDecoded(path, "JPEG", handler.message);
  image.ends_early = handler.ends_early;
  if (channels < 4) return image;
  const size_t num_pixels = image.pixels.size() / 4;
  for (size_t i = 0; i < num_pixels; ++i) {
    const uint8_t* cmyk = &image.pixels[4 * i];
    const uint32_t cmy[3] = {cmyk[0], cmyk[1], cmyk[2]}, black = cmyk[3];
    for (size_t c = 0; c < 3; ++c)
      image.pixels[3 * i + c] = static_cast<uint8_t>((cmy[c] * black + 127) / 255);
  }
  image.pixels.resize(3 * num_pixels);
  return grey ? ToGrey(image) : image;
}

bool WriteJpeg(const ColourImage& image, const std::filesystem::path& path) {
  File file(std::fopen(path.c_str(), "wb"), std::fclose);
  const auto to_file = [&](jpeg_compress_struct* info) { jpeg_stdio_dest(info, file.get()); };
  if (!file || !EncodeJpegTo(image, kQuality, to_file)) return false;
  return std::fclose(file.release()) == 0;
}

std::string EncodeJpeg(const ColourImage& image, int quality) {
  unsigned char* bytes = nullptr;
  unsigned long size = 0;  // NOLINT: libjpeg's
  const bool encoded = EncodeJpegTo(
      image, quality, [&](jpeg_compress_struct* info) { jpeg_mem_dest(info, &bytes, &size); });
  const std::unique_ptr<unsigned char, decltype(&std::free)> owner(bytes, std::free);
  HOLBA_CHECK(encoded);
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace holba
