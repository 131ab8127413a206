// SPDX-License-Identifier: BSD-3-Clause
// SIMPLE_FISHEYE: equidistant projection, f theta from the centre. Parameters [f cx cy], pixels.
#pragma once

#include <string_view>

#include "holba/camera/distortion.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct SimpleFisheye : FisheyeCamera<1, NoDistortion> {
  static constexpr int kModelId = 14;
  static constexpr std::string_view kName = "SIMPLE_FISHEYE";
  static constexpr std::string_view kParamNames = "f cx cy";
};

}  // namespace holba
