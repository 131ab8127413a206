// SPDX-License-Identifier: BSD-3-Clause
// What a group type can do, detected by the function being there, and derivatives of its formulas
// by dual numbers: the reference of the hand-written ones, and the fallback of a type without them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <concepts>
#include <optional>
#include <span>
#include <utility>

#include "holba/geometry/dual.h"
#include "holba/geometry/line.h"
#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

template <typename G>
concept ProjectsPoints = requires(const double* g, const Eigen::Vector3d& X) {
  { G::ProjectPoint(g, X) } -> std::same_as<std::optional<Eigen::Vector3d>>;
};

template <typename G>
concept ProjectsLines = requires(const double* g, const Eigen::Vector3d& v) {
  {
    G::ProjectLine(g, v, v)
  } -> std::same_as<std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>>>;
};

template <typename G>
concept HasDirection = requires(const double* g) {
  { G::Direction(g) } -> std::same_as<Eigen::Vector3d>;
};

template <typename G>
concept HasPointJacobian = requires(const double* g, const Eigen::Vector3d& X, double* J) {
  { G::ProjectPointWithJacobian(g, X, J, J) } -> std::same_as<std::optional<Eigen::Vector3d>>;
};

template <typename G>
concept HasLineJacobian = requires(const double* g, const Eigen::Vector3d& v, double* J) {
  { G::ProjectLineWithJacobian(g, v, v, J, J) } -> std::same_as<std::optional<Vector6d>>;
};

// A curve has `static double TubeRadius(const double* g)`: its mesh is a tube of that radius about
// it, as triangles of a curve itself would be slivers.
template <typename G>
concept IsCurve = requires(const double* g) {
  { G::TubeRadius(g) } -> std::same_as<double>;
};

// d_point 3x3, d_group 3 x kAmbient, row-major.
template <ProjectsPoints G>
std::optional<Eigen::Vector3d> ProjectPointByDuals(const double* g, const Eigen::Vector3d& X,
                                                   double* d_point, double* d_group) {
  constexpr int kAmbient = G::Manifold::kAmbient;
  using T = Dual<3 + kAmbient>;
  std::array<T, kAmbient> params;
  for (int i = 0; i < kAmbient; ++i) params[i] = T::Variable(g[i], 3 + i);
  const Vector3<T> point(T::Variable(X[0], 0), T::Variable(X[1], 1), T::Variable(X[2], 2));
  const std::optional<Vector3<T>> projected = G::ProjectPoint(params.data(), point);
  if (!projected) return std::nullopt;
  Eigen::Map<RowMajor<3, 3>> by_point(d_point);
  Eigen::Map<RowMajor<3, kAmbient>> by_group(d_group);
  Eigen::Vector3d value;
  for (int i = 0; i < 3; ++i) {
    value[i] = (*projected)[i].value;
    by_point.row(i) = (*projected)[i].gradient.template head<3>().transpose();
    by_group.row(i) = (*projected)[i].gradient.template tail<kAmbient>().transpose();
  }
  return value;
}

// d_line 6x6, d_group 6 x kAmbient, row-major.
template <ProjectsLines G>
std::optional<Vector6d> ProjectLineByDuals(const double* g, const Eigen::Vector3d& d,
                                           const Eigen::Vector3d& m, double* d_line,
                                           double* d_group) {
  constexpr int kAmbient = G::Manifold::kAmbient;
  using T = Dual<6 + kAmbient>;
  std::array<T, kAmbient> params;
  for (int i = 0; i < kAmbient; ++i) params[i] = T::Variable(g[i], 6 + i);
  const Vector3<T> direction(T::Variable(d[0], 0), T::Variable(d[1], 1), T::Variable(d[2], 2));
  const Vector3<T> moment(T::Variable(m[0], 3), T::Variable(m[1], 4), T::Variable(m[2], 5));
  const auto projected = G::ProjectLine(params.data(), direction, moment);
  if (!projected) return std::nullopt;
  Eigen::Map<RowMajor<6, 6>> by_line(d_line);
  Eigen::Map<RowMajor<6, kAmbient>> by_group(d_group);
  Vector6d value;
  for (int i = 0; i < 6; ++i) {
    const T& x = i < 3 ? projected->first[i] : projected->second[i - 3];
    value[i] = x.value;
    by_line.row(i) = x.gradient.template head<6>().transpose();
    by_group.row(i) = x.gradient.template tail<kAmbient>().transpose();
  }
  return value;
}

// d_group 3 x kAmbient, row-major; null: not wanted.
template <HasDirection G>
Eigen::Vector3d DirectionByDuals(const double* g, double* d_group) {
  if (d_group == nullptr) return G::Direction(g);
  constexpr int kAmbient = G::Manifold::kAmbient;
  using T = Dual<kAmbient>;
  std::array<T, kAmbient> params;
  for (int i = 0; i < kAmbient; ++i) params[i] = T::Variable(g[i], i);
  const Vector3<T> direction = G::Direction(params.data());
  Eigen::Vector3d value;
  for (int i = 0; i < 3; ++i) {
    value[i] = direction[i].value;
    Eigen::Map<RowMajor<3, kAmbient>>(d_group).row(i) = direction[i].gradient.transpose();
  }
  return value;
}

// d(plain parameters of the file of the group moved by new_from_old) / d(tangent of g),
// kNumFileParams x kTangent, row-major.
template <typename G>
void FileJacobianByDuals(const Sim3d& new_from_old, const double* g, double* jacobian) {
  constexpr int kAmbient = G::Manifold::kAmbient, kTangent = G::Manifold::kTangent;
  using T = Dual<kAmbient>;
  std::array<T, kAmbient> params;
  for (int i = 0; i < kAmbient; ++i) params[i] = T::Variable(g[i], i);
  const auto moved = G::Transform(new_from_old, params.data());
  std::array<T, G::kNumFileParams> plain;
  G::ToFile(moved.data(), plain.data());
  RowMajor<G::kNumFileParams, kAmbient> by_memory;
  for (int i = 0; i < G::kNumFileParams; ++i) by_memory.row(i) = plain[i].gradient.transpose();
  RowMajor<kAmbient, kTangent> plus;
  G::Manifold::PlusJacobian(g, plus.data());
  Eigen::Map<RowMajor<G::kNumFileParams, kTangent>>{jacobian} = by_memory * plus;
}

}  // namespace holba
