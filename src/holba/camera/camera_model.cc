// SPDX-License-Identifier: BSD-3-Clause
#include "holba/camera/camera_model.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>

#include "holba/camera/camera_models.h"
#include "holba/camera/snavely.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

// Null: a model without MaxAngle.
template <typename Model>
constexpr auto MaxAngleOf() -> double (*)(const double*) {
  if constexpr (requires(const double* params) { Model::MaxAngle(params); }) {
    return &Model::MaxAngle;
  } else {
    return nullptr;
  }
}

template <typename Model>
constexpr CameraModel Describe() {
  return {Model::kModelId,
          Model::kName,
          Model::kParamNames,
          Model::kNumParams,
          Model::kFocalIdxs,
          Model::kPrincipalPointIdxs,
          Model::kExtraIdxs,
          Model::kIsPinhole,
          &Model::template Project<double>,
          &Model::ProjectWithJacobian,
          &Model::Unproject,
          &Model::Calibration,
          MaxAngleOf<Model>()};
}

template <typename... Models>
constexpr std::array<CameraModel, sizeof...(Models)> DescribeAll(CameraModelList<Models...>) {
  std::array<CameraModel, sizeof...(Models)> models{Describe<Models>()...};
  std::sort(models.begin(), models.end(),
            [](const CameraModel& a, const CameraModel& b) { return a.id < b.id; });
  return models;
}

constexpr auto kModels = DescribeAll(CameraModels());

constexpr auto kModelPointers = [] {
  std::array<const CameraModel*, kModels.size()> pointers{};
  for (size_t i = 0; i < kModels.size(); ++i) pointers[i] = &kModels[i];
  return pointers;
}();

// Ideal pixel of a ray, if it is in front of the camera.
std::optional<Eigen::Vector2d> ProjectIdeal(const IdealCalibration& K, const Eigen::Vector3d& ray) {
  if (!(ray.z() >= kMinDepth)) return std::nullopt;
  return Eigen::Vector2d(K.fx * ray.x() / ray.z() + K.cx, K.fy * ray.y() / ray.z() + K.cy);
}

}  // namespace

const CameraModel& SnavelyCameraModel() {
  static constexpr CameraModel model = Describe<Snavely>();
  return model;
}

const CameraModel* FindCameraModel(int model_id) {
  for (const CameraModel& model : kModels) {
    if (model.id == model_id) return &model;
  }
  return nullptr;
}

const CameraModel* FindCameraModel(std::string_view name) {
  for (const CameraModel& model : kModels) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

std::span<const CameraModel* const> AllCameraModels() { return kModelPointers; }

std::optional<Eigen::Vector2d> IdealPixel(const CameraModel& model, const double* params,
                                          const Eigen::Vector2d& pixel) {
  if (model.is_pinhole) return pixel;
  const std::optional<Eigen::Vector3d> ray = model.unproject(params, pixel);
  if (!ray) return std::nullopt;
  return ProjectIdeal(model.ideal_calibration(params), *ray);
}

std::optional<Eigen::Vector2d> IdealPixelWithJacobian(const CameraModel& model,
                                                      const double* params,
                                                      const Eigen::Vector2d& pixel,
                                                      double* d_params) {
  const int n = model.num_params;
  Eigen::Map<RowMajor<2, Eigen::Dynamic>> J(d_params, 2, n);
  J.setZero();
  if (model.is_pinhole) return pixel;
  const std::optional<Eigen::Vector3d> ray = model.unproject(params, pixel);
  if (!ray) return std::nullopt;
  const IdealCalibration K = model.ideal_calibration(params);
  const std::optional<Eigen::Vector2d> ideal = ProjectIdeal(K, *ray);
  if (!ideal) return std::nullopt;

  // Project(params, (a, b, 1)) = pixel defines (a, b) as a function of the parameters.
  const Eigen::Vector3d at(ray->x() / ray->z(), ray->y() / ray->z(), 1.0);
  Eigen::Vector2d projected;
  double d_point[6], d_projected[2 * kMaxCameraParams];
  if (!model.project_with_jacobian(params, at, &projected, d_point, d_projected)) {
    return std::nullopt;
  }
  const double det = d_point[0] * d_point[4] - d_point[1] * d_point[3];
  if (!std::isfinite(1.0 / det)) return std::nullopt;
  for (int i = 0; i < n; ++i) {
    const double px = d_projected[i], py = d_projected[n + i];
    J(0, i) = -K.fx * (d_point[4] * px - d_point[1] * py) / det;
    J(1, i) = -K.fy * (d_point[0] * py - d_point[3] * px) / det;
  }
  if (K.fx_idx >= 0) {
    J(0, K.fx_idx) += at.x();
    J(1, K.fy_idx) += at.y();
    J(0, K.cx_idx) += 1.0;
    J(1, K.cy_idx) += 1.0;
  } else {
    // K is linear in the parameters: its derivatives are its values at the unit vectors.
    for (int i = 0; i < n; ++i) {
      std::array<double, kMaxCameraParams> unit{};
      unit[i] = 1.0;
      const IdealCalibration d = model.ideal_calibration(unit.data());
      J(0, i) += d.fx * at.x() + d.cx;
      J(1, i) += d.fy * at.y() + d.cy;
    }
  }
  return ideal;
}

}  // namespace holba
