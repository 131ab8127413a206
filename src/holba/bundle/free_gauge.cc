// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/free_gauge.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/group/group_type.h"

namespace holba {
namespace {

Rigid3d PoseAt(const double* values) {
  return {Eigen::Quaterniond(values[3], values[0], values[1], values[2]),
          Eigen::Vector3d(values[4], values[5], values[6])};
}

template <typename Blocks>
bool AnyConstant(const Problem& problem, const Blocks& blocks) {
  return std::any_of(blocks.begin(), blocks.end(), [&](const auto& entry) {
    const ParameterBlock& block = problem.block(entry.second);
    return block.constant || block.held != 0;
  });
}

// From the frame that the solver ended in to the one it began in.
Sim3d WayBack(const FreedGauge& freed, const Problem& problem) {
  const Rigid3d there = PoseAt(freed.first_values.data());
  const Rigid3d here = PoseAt(problem.values(freed.first));
  Sim3d back;
  back.rotation = (there.rotation.conjugate() * here.rotation).normalized();
  back.scale = 1.0;
  if (freed.second) {
    // The second camera's translation is scale * (t - R R0^T t0) + R R0^T t0', by which the scale
    // puts the held coordinate where it was.
    const Rigid3d second = PoseAt(problem.values(*freed.second));
    const Eigen::Quaterniond relative = second.rotation * here.rotation.conjugate();
    const double slope = (second.translation - relative * here.translation)[freed.coordinate];
    const double offset = (relative * there.translation)[freed.coordinate];
    const double scale = (freed.coordinate_value - offset) / slope;
    if (std::isfinite(scale) && scale > 0.0) back.scale = scale;
  }
  back.translation =
      there.rotation.conjugate() * (back.scale * here.translation - there.translation);
  return back;
}

}  // namespace

std::optional<FreedGauge> FreeGauge(BundleProblem* bundle) {
  if (!bundle->held_gauge) return std::nullopt;
  Problem& problem = bundle->problem;
  const HeldGauge& held = *bundle->held_gauge;
  const bool has_baseline =
      std::any_of(bundle->sensor_poses.begin(), bundle->sensor_poses.end(),
                  [](const auto& sensor) { return sensor->translation.norm() > 0.0; });
  if (!held.second && !has_baseline) return std::nullopt;
  if (AnyConstant(problem, bundle->points) || AnyConstant(problem, bundle->lines) ||
      AnyConstant(problem, bundle->groups))
    return std::nullopt;
  for (const auto& [frame_id, block] : bundle->poses) {
    if (block != held.first && problem.block(block).constant) return std::nullopt;
  }
  for (const auto& batch : problem.batches()) {
    if (batch->term().ends_with("_3d")) return std::nullopt;  // in model units
  }
  FreedGauge freed;
  freed.first = held.first;
  std::copy_n(problem.values(held.first), 7, freed.first_values.begin());
  problem.block(held.first).constant = false;
  if (held.second) {
    freed.second = held.second;
    freed.coordinate = held.coordinate;
    freed.coordinate_value = problem.values(*held.second)[4 + held.coordinate];
    problem.block(*held.second).held = 0;
  }
  return freed;
}

void RestoreGauge(const FreedGauge& freed, bool moved, BundleProblem* bundle) {
  Problem& problem = bundle->problem;
  problem.block(freed.first).constant = true;
  if (freed.second) problem.block(*freed.second).held = uint32_t{1} << (3 + freed.coordinate);
  if (!moved) return;
  const Sim3d back = WayBack(freed, problem);
  // What no residual sees has not moved.
  std::vector<bool> seen(problem.num_blocks(), false);
  for (const auto& batch : problem.batches()) {
    for (BlockId id : batch->blocks()) seen[id] = true;
  }
  for (const auto& [id, block] : bundle->poses) {
    if (!seen[block]) continue;
    double* values = problem.values(block);
    const Rigid3d pose = back.TransformPose(PoseAt(values));
    const Eigen::Quaterniond q = pose.rotation.normalized();
    const double moved_values[7] = {q.x(),
                                    q.y(),
                                    q.z(),
                                    q.w(),
                                    pose.translation.x(),
                                    pose.translation.y(),
                                    pose.translation.z()};
    std::copy_n(moved_values, 7, values);
  }
  for (const auto& [id, block] : bundle->points) {
    if (!seen[block]) continue;
    Eigen::Map<Eigen::Vector3d> X(problem.values(block));
    X = back * Eigen::Vector3d(X);
  }
  for (const auto& [id, block] : bundle->lines) {
    if (!seen[block]) continue;
    Eigen::Map<Eigen::Vector3d> direction(problem.values(block));
    Eigen::Map<Eigen::Vector3d> anchor(problem.values(block) + 3);
    direction = (back.rotation * Eigen::Vector3d(direction)).normalized();
    anchor = back * Eigen::Vector3d(anchor);
  }
  for (size_t i = 0; i < bundle->groups.size(); ++i) {
    const BlockId block = bundle->groups[i].second;
    if (!seen[block]) continue;
    double transformed[kMaxGroupParams];
    double* values = problem.values(block);
    bundle->group_types[i]->transform(back, values, transformed);
    std::copy_n(transformed, problem.block(block).manifold->ambient, values);
  }
  std::copy(freed.first_values.begin(), freed.first_values.end(), problem.values(freed.first));
  if (freed.second) problem.values(*freed.second)[4 + freed.coordinate] = freed.coordinate_value;
}

}  // namespace holba
