// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_estimation.h"

#include <algorithm>
#include <cmath>

#include "holba/geometry/angle.h"

namespace holba {

const MeasuredPoint* FeatureLookup::Point(point3D_t id) {
  auto [it, is_new] = points_.try_emplace(id);
  if (is_new) {
    const Point3D* point = model_.points3D.Find(id);
    const auto geometry = point ? GeometryOf(views_, *point) : std::nullopt;
    if (geometry) it->second = MeasuredPoint{point->xyz, geometry->LengthPerPx()};
  }
  return it->second ? &*it->second : nullptr;
}

const MeasuredLine* FeatureLookup::Line(line3D_t id) {
  auto [it, is_new] = lines_.try_emplace(id);
  if (is_new) {
    const Line3D* line = model_.lines3D.Find(id);
    if (line) {
      std::vector<image_t> images;
      for (const LineObservation& o : line->track) images.push_back(o.image_id);
      const auto gsd = GroundSamplingDistance(views_, 0.5 * (line->start + line->end), images);
      if (gsd) it->second = MeasuredLine{line->line, line->start, line->end, *gsd};
    }
  }
  return it->second ? &*it->second : nullptr;
}

GroupFeatures FeatureLookup::Find(const GroupType& type, std::span<const point3D_t> point_ids,
                                  std::span<const line3D_t> line_ids) {
  GroupFeatures features;
  for (const point3D_t id : point_ids) {
    const MeasuredPoint* point = type.TakesPoints() ? Point(id) : nullptr;
    if (!point) continue;
    features.point_ids.push_back(id);
    features.points.push_back(*point);
  }
  for (const line3D_t id : line_ids) {
    const MeasuredLine* line = type.TakesLines() ? Line(id) : nullptr;
    if (!line) continue;
    features.line_ids.push_back(id);
    features.lines.push_back(*line);
  }
  return features;
}

double GroupResidual(const GroupType& type, const double* g, const MeasuredPoint& point) {
  Eigen::Vector3d projected;
  if (!type.project_point(g, point.X, &projected)) return HUGE_VAL;
  return (point.X - projected).norm() / point.length_per_px;
}

double GroupResidual(const GroupType& type, const double* g, const MeasuredLine& line) {
  if (type.IsParallelism()) {
    Eigen::Vector3d v;
    type.direction(g, &v, nullptr);
    const Eigen::Vector3d& d = line.line.direction;
    return RadToDeg(std::atan2(v.cross(d).norm(), std::abs(v.dot(d))));
  }
  return std::max(GroupResidual(type, g, MeasuredPoint{line.start, line.length_per_px}),
                  GroupResidual(type, g, MeasuredPoint{line.end, line.length_per_px}));
}

namespace {

GroupResiduals ResidualsOf(const GroupType& type, const GroupFeatures& features) {
  return [&type, &features](const double* g, std::vector<double>* residuals) {
    size_t i = 0;
    for (const MeasuredPoint& point : features.points)
      (*residuals)[i++] = GroupResidual(type, g, point);
    for (const MeasuredLine& line : features.lines)
      (*residuals)[i++] = GroupResidual(type, g, line);
  };
}

// As FitMinimal takes them.
std::vector<Eigen::Vector3d> PointsOf(const GroupFeatures& features) {
  std::vector<Eigen::Vector3d> points;
  for (const MeasuredPoint& point : features.points) points.push_back(point.X);
  return points;
}

std::vector<PlueckerLine> LinesOf(const GroupFeatures& features) {
  std::vector<PlueckerLine> lines;
  for (const MeasuredLine& line : features.lines) lines.push_back(line.line);
  return lines;
}

}  // namespace

GroupFit EvaluateGroup(const GroupType& type, const double* g, const GroupFeatures& features,
                       double limit) {
  return JudgeGroup(type, g, features.size(), ResidualsOf(type, features), limit);
}

std::optional<std::array<double, kMaxGroupParams>> FitAll(const GroupType& type,
                                                          const GroupFeatures& features) {
  if (features.size() == 0) return std::nullopt;
  std::array<double, kMaxGroupParams> g{};
  if (!type.fit_minimal(PointsOf(features), LinesOf(features), g.data())) return std::nullopt;
  if (!std::all_of(g.begin(), g.end(), [](double x) { return std::isfinite(x); })) {
    return std::nullopt;
  }
  return g;
}

std::optional<GroupFit> FitGroup(const GroupType& type, const GroupFeatures& features,
                                 const GroupFitOptions& options, const double* start) {
  return FitGroupRobustly(type, PointsOf(features), LinesOf(features), ResidualsOf(type, features),
                          {.limit = options.Limit(type),
                           .confidence = options.confidence,
                           .max_samples = options.max_samples,
                           .seed = options.seed},
                          start);
}

}  // namespace holba
