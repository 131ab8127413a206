// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/primitive_errors.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "holba/evaluation/group_comparison.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

struct Primitive {
  group3D_t id = kNoId;
  const Group3D* group = nullptr;
  MovedGroup params;
  std::vector<Eigen::Vector3d> members;  // in the frame of the truth
  double spread = 0.0;                   // root mean square distance from their mean
};

std::vector<Primitive> PrimitivesOf(const Reconstruction& model, const Sim3d& truth_from_model) {
  std::vector<Primitive> primitives;
  for (const auto& [id, group] : model.groups3D) {
    const std::optional<MovedGroup> moved = MoveGroup(group, truth_from_model);
    if (!moved) continue;
    Primitive primitive{id, &group, *moved, MemberPoints(model, group), 0.0};
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    const double num = static_cast<double>(std::max<size_t>(1, primitive.members.size()));
    for (Eigen::Vector3d& X : primitive.members) {
      X = truth_from_model * X;
      mean += X / num;
    }
    double sum = 0.0;
    for (const Eigen::Vector3d& X : primitive.members) sum += (X - mean).squaredNorm();
    primitive.spread = std::sqrt(sum / num);
    primitives.push_back(std::move(primitive));
  }
  return primitives;
}

// Median distance of the points from the surface. Empty: there are none.
std::optional<double> MedianDistance(const std::vector<Eigen::Vector3d>& points,
                                     const Primitive& surface) {
  std::vector<double> distances;
  for (const Eigen::Vector3d& X : points) {
    Eigen::Vector3d projected;
    if (surface.group->type->project_point(surface.params.memory.data(), X, &projected)) {
      distances.push_back((projected - X).norm());
    }
  }
  const auto stats = Summarise(distances);
  return stats ? std::optional<double>(stats->median) : std::nullopt;
}

// Direction of an axis, of a vanishing point, or normal of a plane. Empty: the type has none.
std::optional<double> AngleDeg(const Primitive& a, const Primitive& b) {
  const GroupType& type = *a.group->type;
  if (!type.HasDirection()) return std::nullopt;
  Eigen::Vector3d u, v;
  type.direction(a.params.memory.data(), &u, nullptr);
  type.direction(b.params.memory.data(), &v, nullptr);
  return UnsignedAngleDeg(u, v);
}

// How far two primitives of one type are apart. Empty: too far, or nothing tells.
std::optional<double> Separation(const Primitive& model, const Primitive& truth,
                                 const PrimitiveOptions& options) {
  const std::optional<double> angle_deg = AngleDeg(model, truth);
  if (angle_deg && *angle_deg > options.max_angle_deg) return std::nullopt;
  if (truth.group->type->project_point == nullptr) return angle_deg;
  const std::optional<double> of_true = MedianDistance(truth.members, model);
  const std::optional<double> of_model = MedianDistance(model.members, truth);
  if (!of_true && !of_model) return std::nullopt;
  const double distance = std::max(of_true.value_or(0.0), of_model.value_or(0.0));
  const double spread = std::max(truth.spread, model.spread);
  if (!(distance <= options.max_distance * spread)) return std::nullopt;
  return distance;
}

PrimitivePair PairOf(const Primitive& model, const Primitive& truth, double distance) {
  PrimitivePair pair;
  pair.model_id = model.id;
  pair.truth_id = truth.id;
  pair.type = truth.group->type;
  pair.num_members = model.group->point3D_ids.size() + model.group->line3D_ids.size();
  pair.distance = distance;
  pair.errors = ParameterErrors(*pair.type, model.params, truth.params, truth.members);
  if (pair.type->file_params.ends_with(" r")) {
    const double radius = truth.params.plain[pair.type->num_file_params - 1];
    pair.radius_percent =
        100.0 * std::abs(model.params.plain[pair.type->num_file_params - 1] - radius) / radius;
  }
  return pair;
}

}  // namespace

void PrimitiveOptions::Describe(OptionTable* table) const {
  table->Section("Primitives");
  table->Field("max_distance", &max_distance, GreaterThan(0),
               "A true surface farther from a model's members, in the median, than this part of "
               "their spread is not the model's.");
  table->Field("max_angle_deg", &max_angle_deg, Between(0, 90),
               "A true direction farther from a model's is not the model's, degrees.");
  table->Section("");
}

PrimitiveErrors MeasurePrimitives(const Reconstruction& model, const Reconstruction& truth,
                                  const Sim3d& truth_from_model, const PrimitiveOptions& options) {
  const std::vector<Primitive> found = PrimitivesOf(model, truth_from_model);
  const std::vector<Primitive> exact = PrimitivesOf(truth, Sim3d());
  std::vector<std::tuple<double, size_t, size_t>> candidates;  // distance, true, found
  for (size_t i = 0; i < exact.size(); ++i) {
    for (size_t j = 0; j < found.size(); ++j) {
      if (found[j].group->type != exact[i].group->type) continue;
      if (const auto distance = Separation(found[j], exact[i], options)) {
        candidates.emplace_back(*distance, i, j);
      }
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<bool> is_found(exact.size()), is_taken(found.size());
  PrimitiveErrors errors;
  for (const auto& [distance, i, j] : candidates) {
    if (is_found[i] || is_taken[j]) continue;
    is_found[i] = is_taken[j] = true;
    errors.pairs.push_back(PairOf(found[j], exact[i], distance));
  }
  std::sort(errors.pairs.begin(), errors.pairs.end(),
            [](const PrimitivePair& a, const PrimitivePair& b) { return a.truth_id < b.truth_id; });
  for (size_t i = 0; i < exact.size(); ++i) {
    if (!is_found[i]) errors.missed.push_back(exact[i].id);
  }
  for (size_t j = 0; j < found.size(); ++j) {
    if (!is_taken[j]) errors.extra.push_back(found[j].id);
  }
  return errors;
}

}  // namespace holba
