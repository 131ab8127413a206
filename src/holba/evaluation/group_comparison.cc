// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/group_comparison.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

using NamedErrors = std::vector<std::pair<std::string, double>>;

Eigen::Vector3d Mean(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) mean += X;
  return mean / static_cast<double>(points.size());
}

NamedErrors PlaneErrors(const MovedGroup& model, const MovedGroup& truth,
                        std::span<const Eigen::Vector3d> true_members) {
  const Eigen::Vector3d n(model.plain.data()), n_true(truth.plain.data());
  const Eigen::Vector3d middle =
      true_members.empty() ? Eigen::Vector3d(-truth.plain[3] * n_true) : Mean(true_members);
  return {{"normal_deg", UnsignedAngleDeg(n, n_true)},
          {"offset", std::abs(n.dot(middle) + model.plain[3])}};
}

// A cuboid as its file has it: faces n_i.x + w_i = 0 with outward normals +R0 -R0 +R1 -R1 +R2 -R2.
struct Cuboid {
  Eigen::Matrix3d axes;  // columns
  Eigen::Vector3d size, centre;
};
Cuboid CuboidOf(const double* plain) {
  Cuboid cuboid;
  cuboid.axes =
      Eigen::Quaterniond(plain[0], plain[1], plain[2], plain[3]).normalized().toRotationMatrix();
  Eigen::Vector3d middle;
  for (int k = 0; k < 3; ++k) {
    const double high = -plain[4 + 2 * k], low = plain[5 + 2 * k];
    cuboid.size[k] = high - low;
    middle[k] = 0.5 * (high + low);
  }
  cuboid.centre = cuboid.axes * middle;
  return cuboid;
}

// Which axis is the first, and which way it points, means nothing: each axis is compared with the
// nearest of the other.
NamedErrors CuboidErrors(const MovedGroup& model, const MovedGroup& truth) {
  const Cuboid a = CuboidOf(model.plain.data()), b = CuboidOf(truth.plain.data());
  Eigen::Vector3d size_off = Eigen::Vector3d::Zero();
  double worst_deg = 0.0;
  for (int i = 0; i < 3; ++i) {
    double best_deg = 90.0;
    for (int k = 0; k < 3; ++k) {
      const double angle_deg = UnsignedAngleDeg(a.axes.col(k), b.axes.col(i));
      if (angle_deg > best_deg) continue;
      best_deg = angle_deg;
      size_off[i] = a.size[k] - b.size[i];
    }
    worst_deg = std::max(worst_deg, best_deg);
  }
  return {
      {"centre", (a.centre - b.centre).norm()}, {"size", size_off.norm()}, {"axes_deg", worst_deg}};
}

// Of a line (d, m): its point nearest to x.
Eigen::Vector3d NearestOnAxis(const double* line, const Eigen::Vector3d& x) {
  const Eigen::Vector3d d(line), m(line + 3);
  const Eigen::Vector3d foot = d.cross(m);
  return foot + d.dot(x - foot) * d;
}

}  // namespace

double UnsignedAngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return kDegPerRad * std::atan2(a.cross(b).norm(), std::abs(a.dot(b)));
}

std::optional<MovedGroup> MoveGroup(const Group3D& group, const Sim3d& new_from_old) {
  std::array<double, kMaxGroupParams> old{};
  MovedGroup moved;
  if (!group.type->from_file(group.params.data(), old.data())) return std::nullopt;
  group.type->transform(new_from_old, old.data(), moved.memory.data());
  group.type->to_file(moved.memory.data(), moved.plain.data());
  return moved;
}

std::vector<Eigen::Vector3d> MemberPoints(const Reconstruction& model, const Group3D& group) {
  std::vector<Eigen::Vector3d> points;
  for (const point3D_t id : group.point3D_ids) points.push_back(model.points3D.at(id).xyz);
  for (const line3D_t id : group.line3D_ids) {
    const Line3D& line = model.lines3D.at(id);
    points.push_back(line.line.ClosestPoint(line.start));
    points.push_back(line.line.ClosestPoint(line.end));
  }
  return points;
}

NamedErrors ParameterErrors(const GroupType& type, const MovedGroup& model, const MovedGroup& truth,
                            std::span<const Eigen::Vector3d> true_members) {
  if (IsPlane(type)) return PlaneErrors(model, truth, true_members);
  if (IsCuboid(type)) return CuboidErrors(model, truth);
  NamedErrors errors;
  if (type.HasDirection()) {
    Eigen::Vector3d a, b;
    type.direction(model.memory.data(), &a, nullptr);
    type.direction(truth.memory.data(), &b, nullptr);
    errors.emplace_back("direction_deg", UnsignedAngleDeg(a, b));
  }
  std::istringstream names{std::string(type.file_params)};
  std::string name;
  for (int i = 0; names >> name && i < type.num_file_params; ++i) {
    const double* const p = model.plain.data() + i;
    const double* const q = truth.plain.data() + i;
    const auto distance = [&] {
      return (Eigen::Map<const Eigen::Vector3d>(p) - Eigen::Map<const Eigen::Vector3d>(q)).norm();
    };
    if (name == "cx") errors.emplace_back("centre", distance());
    if (name == "ax") errors.emplace_back("apex", distance());
    if (name == "dx") {
      errors.emplace_back("axis_deg", UnsignedAngleDeg(Eigen::Map<const Eigen::Vector3d>(p),
                                                       Eigen::Map<const Eigen::Vector3d>(q)));
    }
    if (name == "mx") {
      const Eigen::Vector3d x = true_members.empty() ? Eigen::Vector3d::Zero() : Mean(true_members);
      const Eigen::Vector3d on_true = NearestOnAxis(q - 3, x);
      errors.emplace_back("axis_offset", (NearestOnAxis(p - 3, on_true) - on_true).norm());
    }
    if (name == "r") errors.emplace_back("radius", std::abs(*p - *q));
    if (name == "alpha") errors.emplace_back("half_angle_deg", kDegPerRad * std::abs(*p - *q));
    if (name == "sx") {
      Eigen::Vector3d a(p), b(q);
      std::sort(a.data(), a.data() + 3);
      std::sort(b.data(), b.data() + 3);
      errors.emplace_back("semi_axes", (a - b).norm());
    }
  }
  return errors;
}

}  // namespace holba
