// SPDX-License-Identifier: BSD-3-Clause
// The camera of BAL problems (Snavely's Bundler): RADIAL [f cx cy k1 k2], px, but points behind the camera have an image too,
// that of their reflection through the centre. Published optima of BAL problems count such observations. In files it is a
// RADIAL camera.
#pragma once

#include "holba/camera/camera_model.h"
#include "holba/camera/radial.h"

namespace holba {

struct Snavely : Radial {
  template <typename T>
  static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel) {
    if (point_in_cam.z() < T(0.0)) return Radial::Project<T>(params, -point_in_cam, pixel);
    return Radial::Project<T>(params, point_in_cam, pixel);
  }

  static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
                                  Eigen::Vector2d* pixel, double* d_point, double* d_params) {
    if (!(point_in_cam.z() < 0.0)) {
      return Radial::ProjectWithJacobian(params, point_in_cam, pixel, d_point, d_params);
    }
    if (!Radial::ProjectWithJacobian(params, -point_in_cam, pixel, d_point, d_params)) return false;
    if (d_point) {
      for (int i = 0; i < 6; ++i) d_point[i] = -d_point[i];
    }
    return true;
  }
};

// Not in the list of COLMAP's models: only BAL files have it.
const CameraModel& SnavelyCameraModel();

}  // namespace holba
