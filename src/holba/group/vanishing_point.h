// SPDX-License-Identifier: BSD-3-Clause
// Vanishing point: the direction v that parallel lines share. Parameters [vx vy vz], |v| = 1. 2
// dof. A line with unit direction d belongs to it as far as d x v is 0; v and -v are the same.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "holba/group/group_math.h"
#include "holba/group/group_type.h"

namespace holba {

struct VanishingPoint {
  static constexpr std::string_view kName = "VP";
  static constexpr int kTypeCode = 0;
  static constexpr std::string_view kFileParams = "vx vy vz";
  static constexpr int kNumFileParams = 3;
  static constexpr int kMinPoints = 0, kMinLines = 1;
  using Manifold = UnitVector3;
  using Params = GroupParams<double, Manifold>;

  static std::string_view Requirement() { return "unit v"; }

  static std::optional<Params> FromFile(const double* plain) {
    const Params v(plain[0], plain[1], plain[2]);
    const std::optional<double> scale = ScaleToUnit<3>(v);
    if (!scale) return std::nullopt;
    return Params(*scale * v);
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    std::copy(g, g + 3, plain);
  }

  template <typename T>
  static Vector3<T> Direction(const T* g) {
    return Vector3<T>(g[0], g[1], g[2]);
  }

  // Direction with the greatest sum of squared cosines to the lines. Fails where it is not unique.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (lines.empty()) return std::nullopt;
    if (lines.size() == 1) return Params(lines[0].direction.normalized());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const PlueckerLine& line : lines) {
      const Eigen::Vector3d d = line.direction.normalized();
      scatter += d * d.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
    const Eigen::Vector3d& values = eigen.eigenvalues();
    if (!(values[2] - values[1] > 1e-9 * values[2])) return std::nullopt;
    const Eigen::Vector3d v = eigen.eigenvectors().col(2).normalized();
    return Params(v.dot(lines[0].direction) < 0.0 ? Eigen::Vector3d(-v) : v);
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    return Rotated(new_from_old, Vector3<T>(g[0], g[1], g[2])).normalized();
  }

  static std::vector<Params> Examples() {
    return {Params(0, 0, 1), Params(-1, 0, 0), Params(0.48, -0.6, 0.64),
            Params(1e-7, -3, 0.2).normalized()};
  }

  // A direction has no extent.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    return {};
  }
};

}  // namespace holba
