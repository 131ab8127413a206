// SPDX-License-Identifier: BSD-3-Clause
// The camera of BAL problems (Snavely's Bundler): RADIAL [f cx cy k1 k2], px, but points behind the
// camera have an image too, that of their reflection through the centre. Published optima of BAL
// problems count such observations. In files it is a RADIAL camera.
#pragma once

#include "holba/camera/radial.h"
#include "holba/simd/lanes.h"

#ifndef HOLBA_SIMD_TARGET
#include "holba/camera/camera_model.h"
#endif

namespace holba {

struct Snavely : Radial {
  // As LensFormulas::ProjectNormalised; the reflected point has the negative derivative.
  template <typename T>
  static HOLBA_SIMD_INLINE MaskOf<T> ProjectNormalised(const T* params, const T* point_in_cam,
                                                       T* pixel, T* d_point, T* d_params) {
    const T side = Lanes<T>::SignOf(point_in_cam[2]);
    const T in_front[3] = {side * point_in_cam[0], side * point_in_cam[1], side * point_in_cam[2]};
    const MaskOf<T> seen = Radial::ProjectNormalised(params, in_front, pixel, d_point, d_params);
    if (d_point != nullptr && !IsSingleFalse<T>(seen)) {
      for (int i = 0; i < 6; ++i) d_point[i] = side * d_point[i];
    }
    return seen;
  }

#ifndef HOLBA_SIMD_TARGET
  template <typename T>
  static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel) {
    if (point_in_cam.z() < T(0.0)) return Radial::Project<T>(params, -point_in_cam, pixel);
    return Radial::Project<T>(params, point_in_cam, pixel);
  }

  static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
                                  Eigen::Vector2d* pixel, double* d_point, double* d_params) {
    return ProjectNormalised(params, point_in_cam.data(), pixel->data(), d_point, d_params);
  }
#endif
};

#ifndef HOLBA_SIMD_TARGET
// Not in the list of COLMAP's models: only BAL files have it.
const CameraModel& SnavelyCameraModel();
#endif

}  // namespace holba
