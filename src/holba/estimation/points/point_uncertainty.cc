// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/points/point_uncertainty.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "holba/robust/median.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/geometry/types.h"

namespace holba {

std::optional<Eigen::Matrix3d> PointCovariance(const ViewMap& views, const Eigen::Vector3d& X,
                                               std::span<const PointObservation> observations,
                                               double sigma_px) {
  std::vector<PointView> in_front;
  for (const PointObservation& o : observations) {
    const IdealView& view = views.at(o.image_id);
    if (view.Depth(X) > 0.0) in_front.push_back({&view, Eigen::Vector2d::Zero()});
  }
  if (in_front.size() < 2) return std::nullopt;
  const std::optional<Eigen::Matrix3d> covariance_1px = PointCovariance(in_front, X);
  if (!covariance_1px) return std::nullopt;
  return Eigen::Matrix3d(sigma_px * sigma_px * *covariance_1px);
}

double MaxTriangulationAngleRad(const ViewMap& views, const Eigen::Vector3d& X,
                                std::span<const PointObservation> observations) {
  std::vector<Eigen::Vector3d> rays;
  rays.reserve(observations.size());
  for (const PointObservation& o : observations) {
    rays.push_back((X - views.at(o.image_id).centre()).normalized());
  }
  double least_cosine = 1.0;
  size_t first = 0, second = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    for (size_t j = i + 1; j < rays.size(); ++j) {
      const double cosine = rays[i].dot(rays[j]);
      if (cosine < least_cosine) {
        least_cosine = cosine;
        first = i;
        second = j;
      }
    }
  }
  if (first == second) return 0.0;
  return std::atan2(rays[first].cross(rays[second]).norm(), least_cosine);
}

std::optional<double> GroundSamplingDistance(const ViewMap& views, const Eigen::Vector3d& X,
                                             std::span<const image_t> images) {
  std::vector<double> lengths;
  lengths.reserve(images.size());
  for (const image_t image_id : images) {
    const IdealView& view = views.at(image_id);
    const double depth = view.Depth(X);
    if (depth > 0.0) lengths.push_back(depth / view.focal());
  }
  if (lengths.empty()) return std::nullopt;
  return Median(std::move(lengths));
}

size_t NumImages(std::span<const PointObservation> observations) {
  std::vector<image_t> images;
  images.reserve(observations.size());
  for (const PointObservation& o : observations) images.push_back(o.image_id);
  std::sort(images.begin(), images.end());
  return static_cast<size_t>(std::unique(images.begin(), images.end()) - images.begin());
}

double PointGeometry::LengthPerPx() const {
  constexpr double kWellMet = 0.2588190451025207;  // sin 15 degrees
  const double sine = angle_rad >= 0.5 * std::numbers::pi ? 1.0 : std::sin(angle_rad);
  return gsd * std::clamp(kWellMet / std::max(sine, 1e-9), 1.0, 2.5);
}

std::optional<PointGeometry> GeometryOf(const ViewMap& views, const Point3D& point) {
  std::vector<image_t> images;
  images.reserve(point.track.size());
  for (const PointObservation& o : point.track) images.push_back(o.image_id);
  const std::optional<double> gsd = GroundSamplingDistance(views, point.xyz, images);
  if (!gsd) return std::nullopt;
  return PointGeometry{*gsd, MaxTriangulationAngleRad(views, point.xyz, point.track),
                       NumImages(point.track)};
}

std::optional<double> MeasurePointSigmaPx(const Reconstruction& model, const ViewMap& views) {
  std::vector<double> residuals;
  double num_points = 0.0;
  for (const auto& [id, point] : model.points3D) {
    if (point.track.size() < 2) continue;
    num_points += 1.0;
    for (const PointObservation& o : point.track) {
      const IdealView& view = views.at(o.image_id);
      const auto seen = view.ToIdeal(model.images.at(o.image_id).points2D[o.point2D_idx].xy);
      const auto predicted = view.Project(point.xyz);
      if (!seen || !predicted) continue;
      residuals.push_back(std::abs(seen->x() - predicted->x()));
      residuals.push_back(std::abs(seen->y() - predicted->y()));
    }
  }
  if (residuals.empty()) return std::nullopt;
  const double num = static_cast<double>(residuals.size());
  const double redundancy = std::max(num - 3.0 * num_points, 0.1 * num);
  return Median(std::move(residuals)) / 0.6744897501960817 * std::sqrt(num / redundancy);
}

}  // namespace holba
