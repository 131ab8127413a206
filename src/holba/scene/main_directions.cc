// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/main_directions.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <optional>

#include "holba/geometry/angle.h"

namespace holba {
namespace {

// A vertical direction among the vanishing points is within this of the cameras' mean down axis.
constexpr double kMaxVerticalAngleDeg = 30.0;
// A level one is at least this far from it.
constexpr double kMinLevelAngleDeg = 60.0;

std::optional<Eigen::Vector3d> DirectionOfVp(const Group3D& group) {
  double g[kMaxGroupParams];
  if (!group.type->IsParallelism() || !group.type->from_file(group.params.data(), g))
    return std::nullopt;
  Eigen::Vector3d direction;
  group.type->direction(g, &direction, nullptr);
  return direction;
}

}  // namespace

Eigen::Vector3d EstimateDown(const Reconstruction& model) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) {
    mean += image.cam_from_world.rotation.normalized().conjugate() * Eigen::Vector3d::UnitY();
  }
  if (mean.norm() < 1e-9) return Eigen::Vector3d::UnitY();
  mean.normalize();
  Eigen::Vector3d down = mean;
  double best = std::cos(DegToRad(kMaxVerticalAngleDeg));
  for (const auto& [id, group] : model.groups3D) {
    const std::optional<Eigen::Vector3d> direction = DirectionOfVp(group);
    if (!direction) continue;
    const double along = direction->dot(mean);
    if (std::abs(along) <= best) continue;
    best = std::abs(along);
    down = along > 0.0 ? *direction : Eigen::Vector3d(-*direction);
  }
  return down.normalized();
}

PlanAxes EstimatePlanAxes(const Reconstruction& model, const Eigen::Vector3d& down) {
  Eigen::Vector3d right = down.unitOrthogonal();
  size_t most = 0;
  for (const auto& [id, group] : model.groups3D) {
    if (group.line3D_ids.size() <= most) continue;
    const std::optional<Eigen::Vector3d> direction = DirectionOfVp(group);
    if (!direction) continue;
    const Eigen::Vector3d level = *direction - down * down.dot(*direction);
    if (level.norm() < std::sin(DegToRad(kMinLevelAngleDeg))) continue;
    most = group.line3D_ids.size();
    right = level.normalized();
  }
  return {right, down.cross(right)};
}

double BarLength(double extent) {
  const double power = std::pow(10.0, std::floor(std::log10(extent / 4.0)));
  for (const double step : {5.0, 2.0})
    if (step * power <= extent / 4.0) return step * power;
  return power;
}

}  // namespace holba
