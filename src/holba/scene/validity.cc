// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/validity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace holba {
namespace {

// At most this much may the norm of a quaternion or direction of a file differ from 1.
constexpr double kMaxQuaternionNormError = 1e-3;
constexpr double kMaxDirectionNormError = 1e-6;
constexpr double kMaxRelativeMomentError = 1e-6;
// Lines through the origin have moments of rounding errors only.
constexpr double kMaxAbsoluteMomentError = 1e-9;

template <typename Index>
Fault FindRepetition(std::vector<Index> members, const char* kind) {
  std::sort(members.begin(), members.end());
  const auto twice = std::adjacent_find(members.begin(), members.end());
  if (twice == members.end()) return std::nullopt;
  return fmt::format("has {} {} twice among its members", kind, *twice);
}

template <typename PointIndex, typename LineIndex>
Fault FindMemberFault(const GroupType* type, const std::vector<PointIndex>& points,
                      const std::vector<LineIndex>& lines) {
  if (type == nullptr) return "has no type";
  if (!points.empty() && !type->TakesPoints()) {
    return fmt::format("is a {}, which takes no points, but has {} of them", type->name,
                       points.size());
  }
  if (!lines.empty() && !type->TakesLines()) {
    return fmt::format("is a {}, which takes no lines, but has {} of them", type->name,
                       lines.size());
  }
  if (Fault fault = FindRepetition(points, "point")) return fault;
  return FindRepetition(lines, "line");
}

}  // namespace

Fault FindFault(const Rigid3d& pose) {
  if (!pose.rotation.coeffs().allFinite()) return "has a rotation that is not finite";
  if (!pose.translation.allFinite()) return "has a translation that is not finite";
  const double norm = pose.rotation.norm();
  if (!(std::abs(norm - 1.0) <= kMaxQuaternionNormError)) {
    return fmt::format("has a rotation quaternion of norm {:.6g}, expected 1", norm);
  }
  return std::nullopt;
}

Fault FindFault(const Camera& camera) {
  if (camera.model == nullptr) return "has no camera model";
  if (camera.params.size() != static_cast<size_t>(camera.model->num_params)) {
    return fmt::format("has {} parameters, but {} takes {} ({})", camera.params.size(),
                       camera.model->name, camera.model->num_params, camera.model->param_names);
  }
  for (const double param : camera.params) {
    if (!std::isfinite(param)) return "has a parameter that is not finite";
  }
  for (const int idx : camera.model->focal_idxs) {
    if (camera.params[idx] == 0.0) return "has a focal length of 0";
  }
  return std::nullopt;
}

Fault FindFault(const Point3D& point) {
  if (!point.xyz.allFinite()) return "has a position that is not finite";
  if (!std::isfinite(point.error)) return "has an error that is not finite";
  return std::nullopt;
}

Fault FindFault(const Line3D& line) {
  const Eigen::Vector3d& d = line.line.direction;
  const Eigen::Vector3d& m = line.line.moment;
  if (!d.allFinite() || !m.allFinite()) return "has a direction or moment that is not finite";
  if (!line.start.allFinite() || !line.end.allFinite()) return "has an end that is not finite";
  if (!std::isfinite(line.error)) return "has an error that is not finite";
  if (!(std::abs(d.norm() - 1.0) <= kMaxDirectionNormError)) {
    return fmt::format("has a direction of length {:.9g}, expected 1", d.norm());
  }
  const double scale = std::max({m.norm(), line.start.norm(), line.end.norm()});
  if (!(std::abs(d.dot(m)) <= kMaxRelativeMomentError * scale + kMaxAbsoluteMomentError)) {
    return fmt::format("has a moment that is not perpendicular to its direction (d.m = {:.3g})",
                       d.dot(m));
  }
  return std::nullopt;
}

Fault FindFault(const Group2D& group) {
  if (group.type != nullptr && group.point2D_idxs.empty() && group.line2D_idxs.empty())
    return fmt::format("is a {} without members", group.type->name);
  return FindMemberFault(group.type, group.point2D_idxs, group.line2D_idxs);
}

Fault FindFault(const Group3D& group) {
  if (group.type == nullptr) return "has no type";
  if (group.params.size() != static_cast<size_t>(group.type->num_file_params)) {
    return fmt::format("has {} parameters, but a {} has {} ({})", group.params.size(),
                       group.type->name, group.type->num_file_params, group.type->file_params);
  }
  for (const double param : group.params) {
    if (!std::isfinite(param)) return "has a parameter that is not finite";
  }
  double g[kMaxGroupParams];
  if (!group.type->from_file(group.params.data(), g)) {
    return fmt::format("has parameters that are no {} (expected {}: {})", group.type->name,
                       group.type->file_params, group.type->requirement);
  }
  return FindMemberFault(group.type, group.point3D_ids, group.line3D_ids);
}

std::string ToString(const SensorId& sensor) {
  switch (sensor.type) {
    case SensorType::kCamera:
      return fmt::format("camera {}", sensor.id);
    case SensorType::kImu:
      return fmt::format("IMU {}", sensor.id);
    case SensorType::kInvalid:
      break;
  }
  return fmt::format("sensor {} of unknown type", sensor.id);
}

std::string GroupTypeNames() {
  std::string names;
  for (const GroupType* type : AllGroupTypes()) {
    if (!names.empty()) names += ", ";
    names += type->name;
  }
  return names;
}

}  // namespace holba
