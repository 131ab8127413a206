// SPDX-License-Identifier: BSD-3-Clause
// SIMPLE_RADIAL_FISHEYE: at the angle theta from the axis, theta (1 + k theta^2). Parameters [f cx
// cy k], f cx cy in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct SimpleRadialFisheye : FisheyeCamera<1, RadialDistortion<1>> {
  static constexpr int kModelId = 8;
  static constexpr std::string_view kName = "SIMPLE_RADIAL_FISHEYE";
  static constexpr std::string_view kParamNames = "f cx cy k";
};

}  // namespace holba
