// SPDX-License-Identifier: BSD-3-Clause
// Parameters of one group of any type from points and lines of a model, some of which may be wrong:
// the robust fit (robust/group_fit.h) on distances in pixels and angles in degrees.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/line.h"
#include "holba/group/group_type.h"
#include "holba/robust/group_fit.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// A feature and the length that is a pixel there.
struct MeasuredPoint {
  Eigen::Vector3d X = Eigen::Vector3d::Zero();
  double length_per_px = 1.0;  // PointGeometry::LengthPerPx
};
struct MeasuredLine {
  PlueckerLine line;
  Eigen::Vector3d start = Eigen::Vector3d::Zero(), end = Eigen::Vector3d::Zero();
  double length_per_px = 1.0;  // GSD at its middle
};

// What a group is fitted to; ids beside the features, in the same order.
struct GroupFeatures {
  std::vector<point3D_t> point_ids;
  std::vector<MeasuredPoint> points;
  std::vector<line3D_t> line_ids;
  std::vector<MeasuredLine> lines;
  size_t size() const { return points.size() + lines.size(); }
};

// Looks features up in a model (which must outlive it, unchanged) and remembers them.
class FeatureLookup {
 public:
  explicit FeatureLookup(const Reconstruction& model) : model_(model), views_(model) {}
  const ViewMap& views() const { return views_; }
  // Null: the model does not have the feature, or it lies behind all images that observe it.
  const MeasuredPoint* Point(point3D_t id);
  const MeasuredLine* Line(line3D_t id);
  // The features among these that are known and that the type takes.
  GroupFeatures Find(const GroupType& type, std::span<const point3D_t> point_ids,
                     std::span<const line3D_t> line_ids);

 private:
  const Reconstruction& model_;
  ViewMap views_;
  std::unordered_map<point3D_t, std::optional<MeasuredPoint>> points_;
  std::unordered_map<line3D_t, std::optional<MeasuredLine>> lines_;
};

// Distance of a member from the group of in-memory parameters g: of a point to the surface, and of
// a line's farther end, in pixels (units of length_per_px); for types of parallelism the angle of a
// line in degrees. Infinite: undefined.
double GroupResidual(const GroupType& type, const double* g, const MeasuredPoint& point);
double GroupResidual(const GroupType& type, const double* g, const MeasuredLine& line);

struct GroupFitOptions {
  double max_error_px = 4.0;
  double max_angle_deg = 3.0;  // for types of parallelism instead
  // Probability that one of the samples holds inliers only, for the share of inliers of the best
  // fit so far. 300 samples of five points reach it at a share of 0.45.
  double confidence = 0.999;
  int max_samples = 300;
  uint64_t seed = 0;

  double Limit(const GroupType& type) const {
    return type.IsParallelism() ? max_angle_deg : max_error_px;
  }
};

// Residuals of given parameters.
GroupFit EvaluateGroup(const GroupType& type, const double* g, const GroupFeatures& features,
                       double limit);

// Least squares of all features. Empty: they do not determine the group.
std::optional<std::array<double, kMaxGroupParams>> FitAll(const GroupType& type,
                                                          const GroupFeatures& features);

// The parameters of the greatest gain. `start`: in-memory parameters to be considered too, or null.
// Empty: too few features for the type, or nothing fits.
std::optional<GroupFit> FitGroup(const GroupType& type, const GroupFeatures& features,
                                 const GroupFitOptions& options, const double* start = nullptr);

}  // namespace holba
