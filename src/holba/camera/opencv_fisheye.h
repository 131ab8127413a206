// SPDX-License-Identifier: BSD-3-Clause
// OPENCV_FISHEYE: at the angle theta from the axis, theta (1 + k1 theta^2 + ... + k4 theta^8)
// (Kannala and Brandt 2006). Parameters [fx fy cx cy k1 k2 k3 k4], the first four in pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct OpenCVFisheye : FisheyeCamera<2, RadialDistortion<4>> {
  static constexpr int kModelId = 5;
  static constexpr std::string_view kName = "OPENCV_FISHEYE";
  static constexpr std::string_view kParamNames = "fx fy cx cy k1 k2 k3 k4";
};

}  // namespace holba
