// SPDX-License-Identifier: BSD-3-Clause
// SIMPLE_DIVISION: DIVISION (division.h) with one focal length. Parameters [f cx cy k], f cx cy in
// pixels.
#pragma once

#include <string_view>

#include "holba/camera/division.h"
#include "holba/camera/lens_camera.h"

namespace holba {

struct SimpleDivision : PerspectiveCamera<1, DivisionDistortion> {
  static constexpr int kModelId = 12;
  static constexpr std::string_view kName = "SIMPLE_DIVISION";
  static constexpr std::string_view kParamNames = "f cx cy k";
};

}  // namespace holba
