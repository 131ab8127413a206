// SPDX-License-Identifier: BSD-3-Clause
// PINHOLE: (fx x/z + cx, fy y/z + cy). Parameters [fx fy cx cy], pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct Pinhole : PerspectiveCamera<2, NoDistortion> {
  static constexpr int kModelId = 1;
  static constexpr std::string_view kName = "PINHOLE";
  static constexpr std::string_view kParamNames = "fx fy cx cy";
};

}  // namespace holba
