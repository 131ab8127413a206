// SPDX-License-Identifier: BSD-3-Clause
// Ellipsoid: |S^-1 R' (X - c)| = 1, S = diag(sx, sy, sz). Parameters [qx qy qz qw, cx cy cz, log_sx
// log_sy log_sz]: rotation local -> world as unit quaternion, centre, logarithms of the semi-axes.
// 9 dof.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
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

struct Ellipsoid {
  static constexpr std::string_view kName = "ELLIPSOID";
  static constexpr int kTypeCode = 5;
  static constexpr std::string_view kFileParams = "qw qx qy qz cx cy cz sx sy sz";
  static constexpr int kNumFileParams = 10;
  static constexpr int kMinPoints = 9, kMinLines = 0;
  using Manifold = Product<UnitQuaternion, Euclidean<6>>;
  using Params = GroupParams<double, Manifold>;

  static std::string_view Requirement() { return "unit q, sx > 0, sy > 0, sz > 0"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 10)) return std::nullopt;
    const std::optional<Eigen::Vector4d> q = QuaternionFromFile(plain);
    if (!q) return std::nullopt;
    Params g;
    g.head<4>() = *q;
    for (int i = 0; i < 3; ++i) {
      if (!IsPositive(plain[7 + i])) return std::nullopt;
      g[4 + i] = plain[4 + i];
      g[7 + i] = std::log(plain[7 + i]);
    }
    return g;
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    using std::exp;
    QuaternionToFile(g, plain);
    for (int i = 0; i < 3; ++i) {
      plain[4 + i] = g[4 + i];
      plain[7 + i] = exp(g[7 + i]);
    }
  }

  // Scaled-radial: to the unit sphere, normalise, back (not the nearest point). Fails at the
  // centre.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    using std::exp;
    using std::sqrt;
    const Matrix3<T> R = RotationFromXyzw(g);
    const Vector3<T> centre(g[4], g[5], g[6]);
    const Vector3<T> local = R.transpose() * (X - centre);
    const Vector3<T> axes(exp(g[7]), exp(g[8]), exp(g[9]));
    const Vector3<T> z(local.x() / axes.x(), local.y() / axes.y(), local.z() / axes.z());
    const T norm = sqrt(z.squaredNorm());
    if (!(norm > T(kMinRadialFraction))) return std::nullopt;
    return Vector3<T>(centre + R * ((T(1) / norm) * local));
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Matrix3d R = RotationFromXyzw(g);
    const Eigen::Vector3d centre(g[4], g[5], g[6]);
    const Eigen::Vector3d u = X - centre;
    const Eigen::Vector3d inverse_axes(std::exp(-g[7]), std::exp(-g[8]), std::exp(-g[9]));
    const Eigen::Vector3d z = inverse_axes.cwiseProduct(R.transpose() * u);
    const double norm = z.norm();
    if (!(norm > kMinRadialFraction)) return std::nullopt;
    const Eigen::Vector3d n = z / norm;
    const Eigen::Vector3d offset = u / norm;  // from the centre to the projection
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    by_point =
        (Eigen::Matrix3d::Identity() - offset * (R * inverse_axes.cwiseProduct(n)).transpose()) /
        norm;
    Eigen::Map<RowMajor<3, 10>> by_group(d_group);
    const RowMajor<3, 3> by_rotation = by_point * CrossMatrix(u) - CrossMatrix(offset);
    by_group.leftCols<4>() = ByQuaternion<3>(by_rotation, g);
    by_group.middleCols<3>(4) = Eigen::Matrix3d::Identity() - by_point;
    by_group.rightCols<3>() = offset * n.cwiseAbs2().transpose();
    return Eigen::Vector3d(centre + offset);
  }

  // From the quadric of least algebraic error (9 points: the quadric through them), where it is an
  // ellipsoid, and from the principal axes; then least squared distances to the projections.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() < kMinPoints) return std::nullopt;
    const std::optional<NormalizedPoints> normalized = NormalizePoints(points);
    if (!normalized) return std::nullopt;
    std::vector<Params> starts;
    const auto add_start = [&starts](const Eigen::Matrix3d& axes, const Eigen::Vector3d& centre,
                                     const Eigen::Vector3d& semi_axes) {
      Eigen::Matrix3d R = axes;
      R.col(2) = R.col(0).cross(R.col(1));
      Params g;
      g << Eigen::Quaterniond(R).normalized().coeffs(), centre, semi_axes.array().log().matrix();
      if (g.allFinite()) starts.push_back(g);
    };
    if (const std::optional<Quadric> quadric = FitQuadric(normalized->points)) {
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(quadric->A);
      const Eigen::Vector3d& values = eigen.eigenvalues();
      if (values[0] * values[2] > 0.0) {
        const Eigen::Vector3d half = eigen.eigenvectors().transpose() * quadric->b;
        const Eigen::Vector3d centre = -eigen.eigenvectors() * half.cwiseQuotient(values);
        const double k = half.cwiseAbs2().cwiseQuotient(values).sum() - quadric->c;
        if (k * values[0] > 0.0) {
          add_start(eigen.eigenvectors(), centre, (k * values.cwiseInverse()).cwiseSqrt());
        }
      }
    }
    const PrincipalAxes principal = PrincipalAxesOf(normalized->points);
    if (!(principal.variances[0] > 1e-12 * principal.variances[2])) return std::nullopt;
    // The variance of a uniformly covered sphere along any axis is r^2 / 3.
    add_start(principal.axes, principal.centroid, (3.0 * principal.variances).cwiseSqrt());

    std::optional<Params> best;
    double best_cost = std::numeric_limits<double>::infinity();
    for (Params& g : starts) {
      const std::optional<double> cost =
          RefineOnPoints<Ellipsoid>(normalized->points, /*max_iterations=*/100, g.data());
      if (!cost || !(*cost < best_cost)) continue;
      // Longer than this it is a cylinder or a paraboloid to the points.
      if (!(g.tail<3>().maxCoeff() < std::log(1e3))) continue;
      best = g;
      best_cost = *cost;
      if (best_cost < 1e-20 * static_cast<double>(points.size())) break;
    }
    if (!best) return std::nullopt;
    return Transform(normalized->original_from_normalized, best->data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    const Eigen::Quaternion<T> q(g[3], g[0], g[1], g[2]);
    result.template head<4>() = (new_from_old.rotation.cast<T>() * q).normalized().coeffs();
    result.template segment<3>(4) = Moved(new_from_old, Vector3<T>(g[4], g[5], g[6]));
    for (int i = 7; i < 10; ++i) result[i] = g[i] + std::log(new_from_old.scale);
    return result;
  }

  static std::vector<Params> Examples() {
    const auto make = [](const Eigen::Vector3d& rotation, const Eigen::Vector3d& centre,
                         const Eigen::Vector3d& semi_axes) {
      Params g;
      g << ExpRotation(rotation).normalized().coeffs(), centre, semi_axes.array().log().matrix();
      return g;
    };
    return {make({0, 0, 0}, {0, 0, 0}, {1, 1.5, 2}),
            make({0.3, -0.8, 1.9}, {2, -1, 4}, {3, 0.8, 1.4}),
            make({-1.2, 0.4, 0.1}, {2500, -800, 3100}, {0.05, 0.03, 0.04}),
            make({2.1, 1.3, -0.7}, {-5, 3, 1}, {3e4, 2e4, 5e4}),
            make({0.1, 0.2, 0.3}, {0.1, 0.2, 0.3}, {3e-6, 2e-6, 2.5e-6})};
  }

  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    GroupMesh mesh = UnitSphereMesh();
    const Eigen::Matrix3d R = RotationFromXyzw(g);
    const Eigen::Vector3d centre(g[4], g[5], g[6]);
    const Eigen::Vector3d axes(std::exp(g[7]), std::exp(g[8]), std::exp(g[9]));
    for (Eigen::Vector3d& x : mesh.vertices) x = centre + R * axes.cwiseProduct(x);
    return mesh;
  }
};

}  // namespace holba
