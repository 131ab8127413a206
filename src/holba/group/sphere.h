// SPDX-License-Identifier: BSD-3-Clause
// Sphere: |X - c| = r. Parameters [cx cy cz log_r]; the logarithm keeps r positive. 4 dof.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/mesh.h"

namespace holba {

struct Sphere {
  static constexpr std::string_view kName = "SPHERE";
  static constexpr int kTypeCode = 2;
  static constexpr std::string_view kFileParams = "cx cy cz r";
  static constexpr int kNumFileParams = 4;
  static constexpr int kMinPoints = 4, kMinLines = 0;
  using Manifold = Euclidean<4>;
  using Params = GroupParams<double, Manifold>;

  static std::string_view Requirement() { return "r > 0"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 4) || !IsPositive(plain[3])) return std::nullopt;
    return Params(plain[0], plain[1], plain[2], std::log(plain[3]));
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    std::copy(g, g + 3, plain);
    using std::exp;
    plain[3] = exp(g[3]);
  }

  // Nearest point of the sphere. Fails at the centre, where every point is nearest.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    using std::exp;
    using std::sqrt;
    const Vector3<T> centre(g[0], g[1], g[2]);
    const Vector3<T> u = X - centre;
    const T radius = exp(g[3]);
    const T distance = sqrt(u.squaredNorm());
    if (!(distance > T(kMinRadialFraction) * radius)) return std::nullopt;
    return Vector3<T>(centre + (radius / distance) * u);
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Vector3d centre(g[0], g[1], g[2]);
    Eigen::Vector3d u = X - centre;
    const double radius = std::exp(g[3]);
    const double distance = u.norm();
    if (!(distance > kMinRadialFraction * radius)) return std::nullopt;
    u /= distance;
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    by_point = (radius / distance) * (Eigen::Matrix3d::Identity() - u * u.transpose());
    Eigen::Map<RowMajor<3, 4>> by_group(d_group);
    by_group.leftCols<3>() = Eigen::Matrix3d::Identity() - by_point;
    by_group.col(3) = radius * u;
    return Eigen::Vector3d(centre + radius * u);
  }

  // |x|^2 = 2 c.x + k, linear: exact through 4 points, least squares above. Fails in a plane.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() < 4) return std::nullopt;
    const std::optional<NormalizedPoints> normalized = NormalizePoints(points);
    if (!normalized) return std::nullopt;
    // The centroid is 0, so that k = 1 (the mean square norm) and only the centre is left.
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    Eigen::Vector3d third_moment = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : normalized->points) {
      scatter += x * x.transpose();
      third_moment += x.squaredNorm() * x;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
    if (!(eigen.eigenvalues()[0] > 1e-12 * eigen.eigenvalues()[2])) return std::nullopt;
    const Eigen::Vector3d centre =
        0.5 * eigen.eigenvectors() *
        (eigen.eigenvectors().transpose() * third_moment).cwiseQuotient(eigen.eigenvalues());
    const Params g(centre.x(), centre.y(), centre.z(), 0.5 * std::log1p(centre.squaredNorm()));
    if (!g.allFinite()) return std::nullopt;
    return Transform(normalized->original_from_normalized, g.data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    result.template head<3>() = Moved(new_from_old, Vector3<T>(g[0], g[1], g[2]));
    result[3] = g[3] + std::log(new_from_old.scale);
    return result;
  }

  static std::vector<Params> Examples() {
    return {Params(0, 0, 0, 0), Params(1.5, -2, 7, std::log(2.5)),
            Params(1200, -3400, 560, std::log(1e-2)), Params(-3, 0.1, 2, std::log(5e4)),
            Params(0.2, 0.3, -0.1, std::log(2e-6))};
  }

  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    GroupMesh mesh = UnitSphereMesh();
    const Eigen::Vector3d centre(g[0], g[1], g[2]);
    for (Eigen::Vector3d& x : mesh.vertices) x = centre + std::exp(g[3]) * x;
    return mesh;
  }
};

}  // namespace holba
