// SPDX-License-Identifier: BSD-3-Clause
// RADIAL: (u, v) = (x, y)/z times 1 + k1 r^2 + k2 r^4. Parameters [f cx cy k1 k2], f cx cy in
// pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct Radial : PerspectiveCamera<1, RadialDistortion<2>> {
  static constexpr int kModelId = 3;
  static constexpr std::string_view kName = "RADIAL";
  static constexpr std::string_view kParamNames = "f cx cy k1 k2";
};

}  // namespace holba
