// SPDX-License-Identifier: BSD-3-Clause
// SIMPLE_PINHOLE: (f x/z + cx, f y/z + cy). Parameters [f cx cy], pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct SimplePinhole : PerspectiveCamera<1, NoDistortion> {
  static constexpr int kModelId = 0;
  static constexpr std::string_view kName = "SIMPLE_PINHOLE";
  static constexpr std::string_view kParamNames = "f cx cy";
};

}  // namespace holba
