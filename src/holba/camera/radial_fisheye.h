// SPDX-License-Identifier: BSD-3-Clause
// RADIAL_FISHEYE: at the angle theta from the axis, theta (1 + k1 theta^2 + k2 theta^4). Parameters
// [f cx cy k1 k2], f cx cy in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct RadialFisheye : FisheyeCamera<1, RadialDistortion<2>> {
  static constexpr int kModelId = 9;
  static constexpr std::string_view kName = "RADIAL_FISHEYE";
  static constexpr std::string_view kParamNames = "f cx cy k1 k2";
};

}  // namespace holba
