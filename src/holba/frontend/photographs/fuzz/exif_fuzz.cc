// SPDX-License-Identifier: BSD-3-Clause
// Any bytes as EXIF: nothing is read beyond them.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "holba/frontend/photographs/exif.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const holba::Exif exif =
      holba::ParseExif(std::string_view(reinterpret_cast<const char*>(data), size));
  holba::FocalLengthPx(exif, 640, 480);
  holba::CameraText(exif, 640, 480);
  return 0;
}
