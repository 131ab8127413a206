// SPDX-License-Identifier: BSD-3-Clause
// The camera models whose formulas are templates on the scalar (lens_formulas.h): residuals in them
// are evaluated in packs. A new one is its header and a line here; camera_models.h has the rest.
#pragma once

#include "holba/camera/full_opencv.h"
#include "holba/camera/opencv.h"
#include "holba/camera/pinhole.h"
#include "holba/camera/radial.h"
#include "holba/camera/simple_pinhole.h"
#include "holba/camera/simple_radial.h"

namespace holba {

template <typename... Models>
struct CameraModelList {};

using VectorisedCameraModels = CameraModelList<SimplePinhole,  //
                                               Pinhole,        //
                                               SimpleRadial,   //
                                               Radial,         //
                                               OpenCV,         //
                                               FullOpenCV>;

}  // namespace holba
