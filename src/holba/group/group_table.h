// SPDX-License-Identifier: BSD-3-Clause
// Makes the table of a group type (group_type.h) from its struct; knows no type by name. CMake
// writes one source for each type of the list, so that one change of a type compiles this type
// alone.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>

#include "holba/group/group_capabilities.h"
#include "holba/group/group_type.h"

namespace holba {

constexpr int CountWords(std::string_view text) {
  int num = text.empty() ? 0 : 1;
  for (const char c : text) num += c == ' ';
  return num;
}

template <typename G>
GroupType Describe() {
  constexpr int kAmbient = G::Manifold::kAmbient;
  static_assert(kAmbient <= kMaxGroupParams);
  static_assert(CountWords(G::kFileParams) == G::kNumFileParams);
  static_assert(ProjectsPoints<G> || ProjectsLines<G> || HasDirection<G>,
                "a group type takes points or lines, or has a direction");
  using Params = Eigen::Map<typename G::Params>;

  GroupType type{};
  type.code = G::kTypeCode;
  type.name = G::kName;
  type.file_params = G::kFileParams;
  type.requirement = G::Requirement();
  type.num_file_params = G::kNumFileParams;
  type.manifold = &OpsOf<typename G::Manifold>();
  type.min_points = G::kMinPoints;
  type.min_lines = G::kMinLines;
  type.from_file = [](const double* plain, double* g) {
    const auto params = G::FromFile(plain);
    if (params) Params{g} = *params;
    return params.has_value();
  };
  type.to_file = &G::template ToFile<double>;
  if constexpr (ProjectsPoints<G>) {
    type.project_point = [](const double* g, const Eigen::Vector3d& X, Eigen::Vector3d* projected) {
      const auto result = G::ProjectPoint(g, X);
      if (result) *projected = *result;
      return result.has_value();
    };
    type.project_point_with_jacobian = [](const double* g, const Eigen::Vector3d& X,
                                          Eigen::Vector3d* projected, double* d_point,
                                          double* d_group) {
      std::optional<Eigen::Vector3d> result;
      if constexpr (HasPointJacobian<G>) {
        result = G::ProjectPointWithJacobian(g, X, d_point, d_group);
      } else {
        result = ProjectPointByDuals<G>(g, X, d_point, d_group);
      }
      if (result) *projected = *result;
      return result.has_value();
    };
  }
  if constexpr (ProjectsLines<G>) {
    type.project_line = [](const double* g, const Vector6d& line, Vector6d* projected) {
      const auto result =
          G::ProjectLine(g, Eigen::Vector3d(line.head<3>()), Eigen::Vector3d(line.tail<3>()));
      if (result) *projected << result->first, result->second;
      return result.has_value();
    };
    type.project_line_with_jacobian = [](const double* g, const Vector6d& line, Vector6d* projected,
                                         double* d_line, double* d_group) {
      const Eigen::Vector3d d = line.head<3>(), m = line.tail<3>();
      std::optional<Vector6d> result;
      if constexpr (HasLineJacobian<G>) {
        result = G::ProjectLineWithJacobian(g, d, m, d_line, d_group);
      } else {
        result = ProjectLineByDuals<G>(g, d, m, d_line, d_group);
      }
      if (result) *projected = *result;
      return result.has_value();
    };
  }
  if constexpr (HasDirection<G>) {
    type.direction = [](const double* g, Eigen::Vector3d* direction, double* d_group) {
      *direction = DirectionByDuals<G>(g, d_group);
    };
  }
  type.fit_minimal = [](std::span<const Eigen::Vector3d> points,
                        std::span<const PlueckerLine> lines, double* g) {
    const auto params = G::FitMinimal(points, lines);
    if (params) Params{g} = *params;
    return params.has_value();
  };
  type.transform = [](const Sim3d& new_from_old, const double* g, double* transformed) {
    const typename G::Params params = G::Transform(new_from_old, g);
    Params{transformed} = params;
  };
  type.file_jacobian = [](const Sim3d& new_from_old, const double* g, double* jacobian) {
    FileJacobianByDuals<G>(new_from_old, g, jacobian);
  };
  type.mesh = &G::Mesh;
  return type;
}

template <typename G>
const GroupType& TableOf() {
  static const GroupType table = Describe<G>();
  return table;
}

}  // namespace holba
