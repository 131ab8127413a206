// SPDX-License-Identifier: BSD-3-Clause
// For tests: a type with ProjectLine only, which no type of the list is. Lines in a plane, the
// formulas those of Plane, so that Plane is what its results are compared with.
#pragma once

#include "holba/group/group_table.h"
#include "holba/group/plane.h"

namespace holba {

struct LinesInPlane {
  static constexpr std::string_view kName = "LINES_IN_PLANE";
  static constexpr int kTypeCode = 900;
  static constexpr std::string_view kFileParams = Plane::kFileParams;
  static constexpr int kNumFileParams = Plane::kNumFileParams;
  static constexpr int kMinPoints = 0, kMinLines = 2;
  using Manifold = Plane::Manifold;
  using Params = Plane::Params;
  static std::string_view Requirement() { return Plane::Requirement(); }
  static std::optional<Params> FromFile(const double* plain) { return Plane::FromFile(plain); }
  template <typename T>
  static void ToFile(const T* g, T* plain) {
    Plane::ToFile(g, plain);
  }
  template <typename T>
  static std::optional<std::pair<Vector3<T>, Vector3<T>>> ProjectLine(const T* g,
                                                                      const Vector3<T>& d,
                                                                      const Vector3<T>& m) {
    return Plane::ProjectLine(g, d, m);
  }
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    return Plane::FitMinimal(points, lines);
  }
  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    return Plane::Transform(new_from_old, g);
  }
  static std::vector<Params> Examples() { return Plane::Examples(); }
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    return Plane::Mesh(g, member_points);
  }
};

}  // namespace holba
