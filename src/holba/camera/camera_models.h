// SPDX-License-Identifier: BSD-3-Clause
// The list of the camera models, in the order of COLMAP's ids. A new model is its header and a line
// here.
#pragma once

#include "holba/camera/division.h"
#include "holba/camera/equirectangular.h"
#include "holba/camera/eucm.h"
#include "holba/camera/fisheye.h"
#include "holba/camera/fov.h"
#include "holba/camera/full_opencv.h"
#include "holba/camera/opencv.h"
#include "holba/camera/opencv_fisheye.h"
#include "holba/camera/pinhole.h"
#include "holba/camera/rad_tan_thin_prism_fisheye.h"
#include "holba/camera/radial.h"
#include "holba/camera/radial_fisheye.h"
#include "holba/camera/simple_division.h"
#include "holba/camera/simple_fisheye.h"
#include "holba/camera/simple_pinhole.h"
#include "holba/camera/simple_radial.h"
#include "holba/camera/simple_radial_fisheye.h"
#include "holba/camera/thin_prism_fisheye.h"

namespace holba {

template <typename... Models>
struct CameraModelList {};

using CameraModels = CameraModelList<SimplePinhole,           //
                                     Pinhole,                 //
                                     SimpleRadial,            //
                                     Radial,                  //
                                     OpenCV,                  //
                                     OpenCVFisheye,           //
                                     FullOpenCV,              //
                                     Fov,                     //
                                     SimpleRadialFisheye,     //
                                     RadialFisheye,           //
                                     ThinPrismFisheye,        //
                                     RadTanThinPrismFisheye,  //
                                     SimpleDivision,          //
                                     Division,                //
                                     SimpleFisheye,           //
                                     Fisheye,                 //
                                     Eucm,                    //
                                     Equirectangular>;

}  // namespace holba
