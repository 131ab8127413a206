// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>

#include "holba/base/error.h"
#include "holba/frontend/importers/import_dense_maps.h"
#include "holba/frontend/importers/import_label_maps.h"
#include "holba/frontend/importers/import_png.h"

namespace {

template <typename F>
void Try(F&& f) {
  try {
    f();
  } catch (const holba::InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  Try([&] {
    const holba::PngImage image = holba::ParsePng(bytes, "input");
    const size_t expected = static_cast<size_t>(image.width) * static_cast<size_t>(image.height) *
                            static_cast<size_t>(image.channels);
    if (image.values.size() != expected) std::abort();
  });
  Try([&] { holba::ParseColmapArray(bytes, "input"); });
  Try([&] { holba::ParseLabelTypes(bytes, "input"); });
  Try([&] { holba::ParseDepthFormat(bytes, "input"); });
  Try([&] { holba::ParseNormalFormat(bytes, "input"); });
  return 0;
}
