// SPDX-License-Identifier: BSD-3-Clause
// The list of the camera models. A new model is its header and a line here, or in
// vectorised_models.h.
#pragma once

#include "holba/camera/division.h"
#include "holba/camera/equirectangular.h"
#include "holba/camera/eucm.h"
#include "holba/camera/fisheye.h"
#include "holba/camera/fov.h"
#include "holba/camera/opencv_fisheye.h"
#include "holba/camera/rad_tan_thin_prism_fisheye.h"
#include "holba/camera/radial_fisheye.h"
#include "holba/camera/simple_division.h"
#include "holba/camera/simple_fisheye.h"
#include "holba/camera/simple_radial_fisheye.h"
#include "holba/camera/thin_prism_fisheye.h"
#include "holba/camera/vectorised_models.h"

namespace holba {

namespace internal {
template <typename... Vectorised, typename... Others>
CameraModelList<Vectorised..., Others...> Join(CameraModelList<Vectorised...>,
                                               CameraModelList<Others...>);

using OtherCameraModels = CameraModelList<OpenCVFisheye,           //
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
}  // namespace internal

using CameraModels =
    decltype(internal::Join(VectorisedCameraModels(), internal::OtherCameraModels()));

}  // namespace holba
