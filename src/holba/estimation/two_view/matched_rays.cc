// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/matched_rays.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/base/check.h"

namespace holba {
namespace {

struct RayOfPixel {
  Eigen::Vector3d ray;
  Eigen::Matrix<double, 3, 2> d_ray;
  Eigen::Matrix<double, 2, 3> d_pixel;
};

std::optional<RayOfPixel> Evaluate(const Camera& camera, const Eigen::Vector2d& pixel) {
  const auto ray = camera.model->unproject(camera.params.data(), pixel);
  if (!ray) return std::nullopt;
  RayOfPixel result;
  result.ray = *ray;
  Eigen::Vector2d back;
  RowMajor<2, 3> d_point;
  if (!camera.model->project_with_jacobian(camera.params.data(), *ray, &back, d_point.data(),
                                           nullptr)) {
    return std::nullopt;
  }
  result.d_pixel = d_point;
  const Eigen::Matrix2d square = d_point * d_point.transpose();
  if (!(std::abs(square.determinant()) > 0.0)) return std::nullopt;
  result.d_ray = d_point.transpose() * square.inverse();
  if (!result.d_ray.allFinite()) return std::nullopt;
  return result;
}

}  // namespace

Camera AssumedPinhole(uint64_t width, uint64_t height) {
  Camera camera;
  camera.model = FindCameraModel("SIMPLE_PINHOLE");
  camera.width = width;
  camera.height = height;
  camera.params = {static_cast<double>(std::max<uint64_t>({width, height, 1})), 0.5 * width,
                   0.5 * height};
  return camera;
}

MatchedRays::MatchedRays(const Camera& camera1, std::span<const Eigen::Vector2d> pixels1,
                         const Camera& camera2, std::span<const Eigen::Vector2d> pixels2) {
  HOLBA_CHECK(pixels1.size() == pixels2.size());
  stride_ = (pixels1.size() + kMaxSimdLanes - 1) / kMaxSimdLanes * kMaxSimdLanes;
  values_.resize(kMatchColumns * stride_, 0.0);
  original_.reserve(pixels1.size());
  for (size_t i = 0; i < pixels1.size(); ++i) {
    const auto end1 = Evaluate(camera1, pixels1[i]);
    if (!end1) continue;
    const auto end2 = Evaluate(camera2, pixels2[i]);
    if (!end2) continue;
    const size_t row = original_.size();
    SetEnd(0, row, end1->ray, end1->d_ray, end1->d_pixel);
    SetEnd(kColumnsOfEnd, row, end2->ray, end2->d_ray, end2->d_pixel);
    values_[kWeightColumn * stride_ + row] = 1.0;
    // Rays are of unit length; of two columns of two ends.
    angle_per_pixel_ += (end1->d_ray.norm() + end2->d_ray.norm()) / std::sqrt(8.0);
    original_.push_back(static_cast<uint32_t>(i));
  }
  if (size() > 0) angle_per_pixel_ /= static_cast<double>(size());
}

MatchedRays MatchedRays::Counting(std::span<const uint8_t> flags) const {
  HOLBA_CHECK(flags.size() == size());
  MatchedRays counting = *this;
  for (size_t i = 0; i < flags.size(); ++i) {
    if (!flags[i]) counting.values_[kWeightColumn * stride_ + i] = 0.0;
  }
  return counting;
}

void MatchedRays::SetEnd(size_t column, size_t i, const Eigen::Vector3d& ray,
                         const Eigen::Matrix<double, 3, 2>& d_ray,
                         const Eigen::Matrix<double, 2, 3>& d_pixel) {
  double* v = values_.data() + column * stride_ + i;
  for (int k = 0; k < 3; ++k) v[k * stride_] = ray[k];
  for (int k = 0; k < 6; ++k) v[(3 + k) * stride_] = d_ray(k / 2, k % 2);
  for (int k = 0; k < 6; ++k) v[(9 + k) * stride_] = d_pixel(k / 3, k % 3);
}

}  // namespace holba
