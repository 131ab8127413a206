// SPDX-License-Identifier: BSD-3-Clause
// A world point from its observations in two or more posed views: robust against wrong
// observations, at the least squares optimum of the right ones, with its covariance.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "holba/geometry/types.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PointView {
  const IdealView* view = nullptr;
  Eigen::Vector2d ideal = Eigen::Vector2d::Zero();  // ideal pixel
};

struct PointTriangulationOptions {
  double max_error_px = 2.0;   // of an observation that takes part, in ideal pixels
  double min_angle_deg = 1.5;  // widest angle between two of its rays; COLMAP's bound
  size_t min_num_views = 2;    // that take part
  // Pairs of views tried as first estimates where not all views agree; all pairs of 11 views.
  size_t max_num_samples = 55;
};

enum class PointTriangulationFailure { kNone, kFewViews, kSmallAngle };

struct TriangulatedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::vector<bool> is_inlier;  // for each view
  size_t num_inliers = 0;
  double rms_error_px = 0.0;   // root mean square distance of the inliers, ideal pixels
  double max_angle_rad = 0.0;  // between the rays of two inliers
  // Of xyz, for independent observations of one pixel standard deviation per coordinate.
  Eigen::Matrix3d covariance_1px = Eigen::Matrix3d::Zero();
};

// Empty: no point in front of enough views explains enough observations; `failure`, if given, says
// why. Repeatable: the same views give the same point.
std::optional<TriangulatedPoint> TriangulatePoint(std::span<const PointView> views,
                                                  const PointTriangulationOptions& options,
                                                  PointTriangulationFailure* failure = nullptr);

// d(ideal pixel) / d(world point), for a point in front of the view.
Matrix23d ProjectionJacobian(const IdealView& view, const Eigen::Vector3d& X);

// Least squares on the reprojection errors of all views, from a start in front of all of them.
// Empty: it runs behind a view or is not determined (rays without an angle between them).
std::optional<Eigen::Vector3d> RefinePoint(std::span<const PointView> views,
                                           const Eigen::Vector3d& start);

// Inverse of the normal matrix: of an observed point with one pixel standard deviation per
// coordinate. Empty: not determined, or behind a view.
std::optional<Eigen::Matrix3d> PointCovariance(std::span<const PointView> views,
                                               const Eigen::Vector3d& X);

// Largest number of pixels that a unit of length at X has in one of the views; 0: in front of none.
// Its inverse is the finest ground sampling distance (GSD).
double PixelsPerLength(std::span<const PointView> views, const Eigen::Vector3d& X);

// Mean distance between a point's observations and its projections, in pixels of the photographs
// (what Point3D::error holds). Empty: no observation has a projection.
std::optional<double> MeanReprojectionErrorPx(const Reconstruction& model, const Point3D& point);

// A new point with 2D points of its own (image, pixel), its error set. Returns its id.
point3D_t AddPointOfStructure(const Eigen::Vector3d& xyz, PointOrigin origin,
                              const std::array<uint8_t, 3>& rgb,
                              std::span<const std::pair<image_t, Eigen::Vector2d>> observations,
                              Reconstruction* model);

}  // namespace holba
