// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/tiff_file.h"

#include <tiffio.h>

#include <cstdarg>
#include <cstdio>
#include <memory>
#include <string>

#include "holba/base/error.h"
#include "holba/frontend/photographs/decode_fault.h"

namespace holba {
namespace {

// Keeps the first message. One: it is not passed on to the default handler, which prints.
int KeepMessage(TIFF*, void* message, const char*, const char* format, va_list arguments) {
  auto* kept = static_cast<std::string*>(message);
  if (!kept->empty()) return 1;
  char text[200];
  std::vsnprintf(text, sizeof(text), format, arguments);
  *kept = text;
  return 1;
}

int IgnoreMessage(TIFF*, void*, const char*, const char*, va_list) { return 1; }

[[noreturn]] void Refuse(const std::filesystem::path& path, const std::string& why) {
  throw CannotBeDecoded(path, "TIFF", why);
}

}  // namespace

DecodedImage ReadTiff(const std::filesystem::path& path) {
  std::string message;
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), KeepMessage, &message);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxImageBytes);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), IgnoreMessage, nullptr);
  const std::unique_ptr<TIFF, void (*)(TIFF*)> tiff(TIFFOpenExt(path.c_str(), "r", options.get()),
                                                    TIFFClose);
  if (!tiff) Refuse(path, message);
  TIFFRGBAImage image;
  char why[1024] = {};
  if (!TIFFRGBAImageOK(tiff.get(), why) || !TIFFRGBAImageBegin(&image, tiff.get(), 1, why))
    Refuse(path, why);
  const std::unique_ptr<TIFFRGBAImage, void (*)(TIFFRGBAImage*)> end(&image, TIFFRGBAImageEnd);
  // Rows as they are stored, whatever the orientation says.
  image.req_orientation = image.orientation;
  const size_t num_pixels = size_t{image.width} * image.height;
  if (num_pixels == 0 || num_pixels > kMaxImageBytes / 3)
    Refuse(path, "it has no size, or one that is too large");
  std::vector<uint32_t> rgba(num_pixels);
  if (!TIFFRGBAImageGet(&image, rgba.data(), image.width, image.height)) Refuse(path, message);
  DecodedImage decoded;
  decoded.width = static_cast<int>(image.width);
  decoded.height = static_cast<int>(image.height);
  decoded.pixels.resize(3 * num_pixels);
  for (size_t i = 0; i < num_pixels; ++i) {
    decoded.pixels[3 * i] = static_cast<uint8_t>(TIFFGetR(rgba[i]));
    decoded.pixels[3 * i + 1] = static_cast<uint8_t>(TIFFGetG(rgba[i]));
    decoded.pixels[3 * i + 2] = static_cast<uint8_t>(TIFFGetB(rgba[i]));
  }
  return decoded;
}

}  // namespace holba
