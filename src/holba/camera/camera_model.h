// SPDX-License-Identifier: BSD-3-Clause
// The contract of a camera model and the list of them (ids, names and parameter orders are
// COLMAP's).
//
// A model is one header with a struct:
//   static constexpr int kModelId;                     // COLMAP's
//   static constexpr std::string_view kName;           // "SIMPLE_RADIAL"
//   static constexpr std::string_view kParamNames;     // "f cx cy k"
//   static constexpr int kNumParams;
//   static constexpr std::array<int, ..> kFocalIdxs, kPrincipalPointIdxs, kExtraIdxs;
//   // Pixel of a point in the camera frame. False: the point has no image (behind the camera).
//   template <typename T>
//   static bool Project(const T* params, const Vector3<T>& point_in_cam, Vector2<T>* pixel);
//   // The same with derivatives, written by hand: d_point 2x3, d_params 2 x kNumParams, row-major.
//   static bool ProjectWithJacobian(const double* params, const Eigen::Vector3d& point_in_cam,
//                                   Eigen::Vector2d* pixel, double* d_point, double* d_params);
//   // Null d_point or d_params: not wanted.
//   // Unit ray in the camera frame of a pixel. Empty: no ray of that pixel exists or is found.
//   static std::optional<Eigen::Vector3d> Unproject(const double* params,
//                                                   const Eigen::Vector2d& pixel);
//   static constexpr bool kIsPinhole;                  // pixels are ideal pixels
//   static IdealCalibration Calibration(const double* params);
// Optional, of lenses that see beyond 90 degrees from their axis:
//   // How far from the axis points have an image with these parameters, radians.
//   static double MaxAngle(const double* params);
// and one line in the list of camera_models.h or, for one whose formulas are templates on packs,
// too, of vectorised_models.h. A model is perspective-like if straight lines stay
// straight in its ideal pixels (K applied to (x/z, y/z)); every model offers that K from its
// parameters.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>

#include "holba/geometry/types.h"

namespace holba {

inline constexpr int kMaxCameraParams = 16;

// Ideal pixels of a camera: (fx x/z + cx, fy y/z + cy). idx_*: which parameter, -1: not a
// parameter.
struct IdealCalibration {
  double fx, fy, cx, cy;
  int fx_idx, fy_idx, cx_idx, cy_idx;
};

// A camera model as data, for those that handle cameras of any model.
struct CameraModel {
  int id;
  std::string_view name;
  std::string_view param_names;
  int num_params;
  std::span<const int> focal_idxs;
  std::span<const int> principal_point_idxs;
  std::span<const int> extra_idxs;
  // True for SIMPLE_PINHOLE and PINHOLE: pixels are ideal pixels.
  bool is_pinhole;
  bool (*project)(const double* params, const Eigen::Vector3d& point_in_cam,
                  Eigen::Vector2d* pixel);
  bool (*project_with_jacobian)(const double* params, const Eigen::Vector3d& point_in_cam,
                                Eigen::Vector2d* pixel, double* d_point, double* d_params);
  std::optional<Eigen::Vector3d> (*unproject)(const double* params, const Eigen::Vector2d& pixel);
  IdealCalibration (*ideal_calibration)(const double* params);
  double (*max_angle)(const double* params);  // null: a model without MaxAngle
};

// Null: unknown.
const CameraModel* FindCameraModel(int model_id);
const CameraModel* FindCameraModel(std::string_view name);
std::span<const CameraModel* const> AllCameraModels();

// A pixel in ideal pixels. Empty: no ray, or a ray at 90 degrees or more from the axis.
std::optional<Eigen::Vector2d> IdealPixel(const CameraModel& model, const double* params,
                                          const Eigen::Vector2d& pixel);
// The same with d(ideal pixel)/d(params), 2 x num_params row-major (by the implicit function
// theorem: the pixel is fixed, the ray moves with the parameters).
std::optional<Eigen::Vector2d> IdealPixelWithJacobian(const CameraModel& model,
                                                      const double* params,
                                                      const Eigen::Vector2d& pixel,
                                                      double* d_params);

}  // namespace holba
