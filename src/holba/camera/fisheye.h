// SPDX-License-Identifier: BSD-3-Clause
// FISHEYE: equidistant projection, theta from the centre, scaled by fx and fy. Parameters [fx fy cx
// cy], pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct Fisheye : FisheyeCamera<2, NoDistortion> {
  static constexpr int kModelId = 15;
  static constexpr std::string_view kName = "FISHEYE";
  static constexpr std::string_view kParamNames = "fx fy cx cy";
};

}  // namespace holba
