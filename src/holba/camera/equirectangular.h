// SPDX-License-Identifier: BSD-3-Clause
// EQUIRECTANGULAR: the whole sphere. With azimuth theta = atan2(x, z) and elevation phi = atan2(-y,
// |(x, z)|), the pixel is (w (theta/2pi + 1/2), h (1/2 - phi/pi)). Parameters [w h], the size of
// the image in pixels, which are never optimised. Every point but the centre has an image; at the
// poles (x = z = 0) it has no derivative. Its ideal pixels are those of a pinhole that agrees with
// it around the optical axis.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>

#include "holba/camera/camera_model.h"
#include "holba/camera/lens_camera.h"
#include "holba/geometry/dual.h"
#include "holba/geometry/types.h"

namespace holba {

struct Equirectangular {
  static constexpr int kModelId = 17;
  static constexpr std::string_view kName = "EQUIRECTANGULAR";
  static constexpr std::string_view kParamNames = "w h";
  static constexpr int kNumParams = 2;
  static constexpr std::array<int, 0> kFocalIdxs = {}, kPrincipalPointIdxs = {}, kExtraIdxs = {};
  static constexpr bool kIsPinhole = false;

  static IdealCalibration Calibration(const double* params) {
    const double w = params[0], h = params[1];
    return {w / (2.0 * std::numbers::pi), h / std::numbers::pi, 0.5 * w, 0.5 * h, -1, -1, -1, -1};
  }

  template <typename T>
  static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel) {
    using std::abs;
    using std::atan2;
    using std::sqrt;
    const T &x = point_in_cam.x(), &y = point_in_cam.y(), &z = point_in_cam.z();
    const T horizontal = sqrt(T(x * x + z * z));
    if (!(horizontal + abs(y) >= T(kMinDepth))) return false;
    const T azimuth = atan2(x, z), elevation = atan2(T(-y), horizontal);
    pixel->x() = params[0] * (azimuth * (0.5 / std::numbers::pi) + 0.5);
    pixel->y() = params[1] * (0.5 - elevation * (1.0 / std::numbers::pi));
    return std::isfinite(ValueOf(pixel->x())) && std::isfinite(ValueOf(pixel->y()));
  }

  // d_point and d_params may be null: not wanted. False also at the poles if d_point is wanted.
  static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
                                  Eigen::Vector2d* pixel, double* d_point, double* d_params) {
    if (!Project(params, point_in_cam, pixel)) return false;
    const double x = point_in_cam.x(), y = point_in_cam.y(), z = point_in_cam.z();
    if (d_point != nullptr) {
      const double horizontal_squared = x * x + z * z;
      if (!(horizontal_squared > 0.0)) return false;
      const double horizontal = std::sqrt(horizontal_squared);
      const double gx = params[0] * 0.5 / (std::numbers::pi * horizontal_squared);
      const double gy = params[1] / (std::numbers::pi * (horizontal_squared + y * y));
      d_point[0] = gx * z;
      d_point[1] = 0.0;
      d_point[2] = -gx * x;
      d_point[3] = -gy * y * x / horizontal;
      d_point[4] = gy * horizontal;
      d_point[5] = -gy * y * z / horizontal;
    }
    if (d_params != nullptr) {
      d_params[0] = pixel->x() / params[0];
      d_params[1] = d_params[2] = 0.0;
      d_params[3] = pixel->y() / params[1];
    }
    return true;
  }

  // Columns repeat every w pixels; rows outside the image have no ray.
  static std::optional<Eigen::Vector3d> Unproject(const double* params,
                                                  const Eigen::Vector2d& pixel) {
    const double azimuth = 2.0 * std::numbers::pi * (pixel.x() / params[0] - 0.5);
    const double elevation = std::numbers::pi * (0.5 - pixel.y() / params[1]);
    if (!std::isfinite(azimuth) || !(std::abs(elevation) <= std::numbers::pi / 2)) {
      return std::nullopt;
    }
    const double horizontal = std::cos(elevation);
    return Eigen::Vector3d(horizontal * std::sin(azimuth), -std::sin(elevation),
                           horizontal * std::cos(azimuth));
  }
};

}  // namespace holba
