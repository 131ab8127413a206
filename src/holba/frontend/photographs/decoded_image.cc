// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/decoded_image.h"

namespace holba {

DecodedImage ToGrey(const DecodedImage& colour) {
  DecodedImage grey{colour.width, colour.height, {}, colour.ends_early};
  grey.pixels.resize(colour.pixels.size() / 3);
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const uint8_t* rgb = &colour.pixels[3 * i];
    // In 1 / 65536, rounded.
    grey.pixels[i] =
        static_cast<uint8_t>((19595u * rgb[0] + 38470u * rgb[1] + 7471u * rgb[2] + 32768u) >> 16);
  }
  return grey;
}

}  // namespace holba
