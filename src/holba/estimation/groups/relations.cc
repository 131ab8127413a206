// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/relations.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/geometry/angle.h"
#include "holba/group/fit.h"
#include "holba/group/known_types.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

// Least ratio of the variances across and along the members of a plane; members below it are
// collinear up to rounding.
constexpr double kMinAspect = 1e-12;

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * kDegPerRad;
}

struct Direction {
  group3D_t id;
  const GroupType* type;
  Eigen::Vector3d unit;
  double sigma_deg;
};

// Standard deviation of the mean of the members' directions, from the median of their deviations,
// so that inaccurate lines count little.
double FitSigmaDeg(const Reconstruction& model, const Group3D& vp, const Eigen::Vector3d& unit) {
  std::vector<double> angles;
  for (const line3D_t id : vp.line3D_ids) {
    angles.push_back(AngleDeg(model.lines3D.at(id).line.direction, unit));
  }
  if (angles.empty()) return 0.0;  // refitted to segments, not to lines
  const double root = std::sqrt(static_cast<double>(angles.size()));
  return kSigmaPerMedian * Median(std::move(angles)) / root;
}

// Standard deviation of the normal's angle about the axis along which the members spread most: the
// members' distances from the plane over their spread across that axis. Empty: the members do not
// span a plane.
std::optional<double> PlaneSigmaDeg(const Reconstruction& model, const Group3D& plane) {
  std::vector<Eigen::Vector3d> points;
  for (const point3D_t id : plane.point3D_ids) points.push_back(model.points3D.at(id).xyz);
  for (const line3D_t id : plane.line3D_ids) {
    const Line3D& line = model.lines3D.at(id);
    points.push_back(line.start);
    points.push_back(line.end);
  }
  if (points.size() < 3) return std::nullopt;
  const Eigen::Vector3d n(plane.params[0], plane.params[1], plane.params[2]);
  double sum = 0.0;
  for (const Eigen::Vector3d& X : points) {
    const double distance = n.dot(X) + plane.params[3];
    sum += distance * distance;
  }
  const Eigen::Vector3d variances = PrincipalAxesOf(points).variances;
  if (!(variances[1] > kMinAspect * variances[2])) return std::nullopt;
  return std::atan(std::sqrt(sum / variances[1]) / static_cast<double>(points.size())) * kDegPerRad;
}

std::vector<Direction> Directions(const RelationOptions& options, const Reconstruction& model,
                                  RelationReport* report) {
  std::vector<Direction> directions;
  for (const auto& [id, group] : model.groups3D) {
    const bool is_vp = group.type->IsParallelism();
    // Relations are not defined for other types with a direction (axes).
    if (!is_vp && !IsPlane(*group.type)) continue;
    Direction direction = {id, group.type, {group.params[0], group.params[1], group.params[2]}, 0};
    direction.unit.normalize();
    if (is_vp) {
      direction.sigma_deg =
          std::hypot(options.vp_sigma_deg, FitSigmaDeg(model, group, direction.unit));
    } else {
      const std::optional<double> sigma_deg = PlaneSigmaDeg(model, group);
      if (!sigma_deg) {
        ++report->dropped["plane: its members do not span it"];
        continue;
      }
      direction.sigma_deg = std::hypot(options.plane_sigma_deg, *sigma_deg);
    }
    directions.push_back(direction);
  }
  return directions;
}

}  // namespace

void RelationOptions::Describe(OptionTable* table) const {
  table->Section("Relations");
  table->Field("max_deviation_deg", &max_deviation_deg, Between(0, 30),
               "Largest deviation from orthogonal or parallel.");
  table->Field("max_sigmas", &max_sigmas, GreaterThan(0),
               "The same in standard deviations of the angle.");
  table->Field("vp_sigma_deg", &vp_sigma_deg, AtLeast(0),
               "Standard deviation of a vanishing point beside that of its fit.");
  table->Field("plane_sigma_deg", &plane_sigma_deg, AtLeast(0),
               "Standard deviation of a plane's normal beside that of its fit.");
}

RelationReport FormRelations(const RelationOptions& options, Reconstruction* model) {
  RelationReport report;
  const std::vector<Direction> directions = Directions(options, *model, &report);
  std::set<std::pair<group3D_t, group3D_t>> known;
  for (const Relation& relation : model->relations) {
    known.insert(std::minmax(relation.group3D_id1, relation.group3D_id2));
  }
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = i + 1; j < directions.size(); ++j) {
      const Direction &a = directions[i], &b = directions[j];
      const double angle_deg = AngleDeg(a.unit, b.unit);
      const bool is_parallel = angle_deg < 45.0;
      const double deviation_deg = is_parallel ? angle_deg : 90.0 - angle_deg;
      if (!(deviation_deg <= options.max_deviation_deg)) continue;
      if (!(deviation_deg <= options.max_sigmas * std::hypot(a.sigma_deg, b.sigma_deg))) {
        ++report.dropped["pair: deviates more than its uncertainty"];
        continue;
      }
      if (known.contains(std::minmax(a.id, b.id))) {
        ++report.num_known;
        continue;
      }
      const RelationType type = is_parallel ? RelationType::kParallel : RelationType::kOrthogonal;
      model->AddRelation({a.id, b.id, type});
      const auto names = std::minmax(a.type->name, b.type->name);
      ++report.formed[std::string(names.first) + "-" + std::string(names.second) +
                      (is_parallel ? " parallel" : " orthogonal")];
      ++report.num_formed;
    }
  }
  return report;
}

}  // namespace holba
