// SPDX-License-Identifier: BSD-3-Clause
// SIMPLE_RADIAL: (u, v) = (x, y)/z times 1 + k r^2. Parameters [f cx cy k], f cx cy in pixels. The
// model that COLMAP gives to photographs of unknown cameras.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct SimpleRadial : PerspectiveCamera<1, RadialDistortion<1>> {
  static constexpr int kModelId = 2;
  static constexpr std::string_view kName = "SIMPLE_RADIAL";
  static constexpr std::string_view kParamNames = "f cx cy k";
};

}  // namespace holba
