// SPDX-License-Identifier: BSD-3-Clause
// Cylinder: distance r from an axis. Parameters [dx dy dz px py pz log_r]: axis as unit direction d
// and a point p on it (AnchoredLine), logarithm of the radius. 5 dof. Its file holds the axis as a
// Pluecker line.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/mesh.h"

namespace holba {

struct Cylinder {
  static constexpr std::string_view kName = "CYLINDER";
  static constexpr int kTypeCode = 3;
  static constexpr std::string_view kFileParams = "dx dy dz mx my mz r";
  static constexpr int kNumFileParams = 7;
  static constexpr int kMinPoints = 5, kMinLines = 0;
  using Manifold = Product<LineManifold, Euclidean<1>>;
  using Params = GroupParams<double, Manifold>;

  // A fitted radius beyond this many root mean square extents of the points is a plane to them.
  static constexpr double kMaxRelativeRadius = 1e3;

  static std::string_view Requirement() { return "unit d, d.m = 0, r > 0"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 7) || !IsPositive(plain[6])) return std::nullopt;
    Eigen::Vector3d d(plain[0], plain[1], plain[2]), m(plain[3], plain[4], plain[5]);
    const std::optional<double> scale = ScaleToUnit<3>(d);
    if (!scale) return std::nullopt;
    d *= *scale;
    m *= *scale;
    // The radius is the unit of an axis through the origin, whose moment is rounding.
    if (!(std::abs(d.dot(m)) <= kFileUnitTolerance * (m.norm() + plain[6]))) return std::nullopt;
    Params g;
    g << d, d.cross(m), std::log(plain[6]);
    return g;
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    using std::exp;
    const Vector3<T> d(g[0], g[1], g[2]), p(g[3], g[4], g[5]);
    Eigen::Map<Vector3<T>>{plain} = d;
    Eigen::Map<Vector3<T>>{plain + 3} = p.cross(d);
    plain[6] = exp(g[6]);
  }

  // Nearest point of the cylinder, perpendicular to the axis. Fails on the axis.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    using std::exp;
    using std::sqrt;
    const Vector3<T> d(g[0], g[1], g[2]), p(g[3], g[4], g[5]);
    const Vector3<T> u = X - p;
    const Vector3<T> along = u.dot(d) * d;
    const Vector3<T> across = u - along;
    const T radius = exp(g[6]);
    const T distance = sqrt(across.squaredNorm());
    if (!(distance > T(kMinRadialFraction) * radius)) return std::nullopt;
    return Vector3<T>(p + along + (radius / distance) * across);
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Vector3d d(g[0], g[1], g[2]), p(g[3], g[4], g[5]);
    const Eigen::Vector3d u = X - p;
    const double h = u.dot(d), radius = std::exp(g[6]);
    Eigen::Vector3d outward = u - h * d;
    const double distance = outward.norm();
    if (!(distance > kMinRadialFraction * radius)) return std::nullopt;
    outward /= distance;
    const Eigen::Vector3d around = d.cross(outward);
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    by_point = d * d.transpose() + (radius / distance * around) * around.transpose();
    // For changes of d perpendicular to it: outward turns by -d (outward.dd) - h/distance around
    // (around.dd).
    Eigen::Map<RowMajor<3, 7>> by_group(d_group);
    by_group.leftCols<3>() = (distance - radius) * d * outward.transpose() -
                             (radius * h / distance * around) * around.transpose();
    for (int i = 0; i < 3; ++i) by_group(i, i) += h;
    by_group.middleCols<3>(3) = Eigen::Matrix3d::Identity() - by_point;
    by_group.col(6) = radius * outward;
    return Eigen::Vector3d(p + h * d + radius * outward);
  }

  // For each of many axis directions the circle through the points along it is linear; the best
  // directions start Levenberg-Marquardt on the distances. 5 points leave up to 6 cylinders, of
  // which one is returned; from 6 on it is unique. Fails on points of a line or plane.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() < kMinPoints) return std::nullopt;
    const std::optional<NormalizedPoints> normalized = NormalizePoints(points);
    if (!normalized) return std::nullopt;
    const std::vector<Eigen::Vector3d> sample = EverySoMany(normalized->points, kMaxSample);
    const auto cost_of = [&sample](const Eigen::Vector3d& d) { return FitAlong(d, sample).second; };
    std::optional<Params> best;
    double best_cost = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& d : BestDirections(cost_of, AxisCandidates(sample), kMaxStarts)) {
      Params g = FitAlong(d, sample).first;
      const std::optional<double> cost = RefineOnPoints<Cylinder>(sample, 60, g.data());
      if (!cost || !(*cost < best_cost) || g[6] > std::log(kMaxRelativeRadius)) continue;
      best = g;
      best_cost = *cost;
      if (best_cost < 1e-20 * static_cast<double>(sample.size())) break;
    }
    if (!best) return std::nullopt;
    if (sample.size() < points.size()) {
      RefineOnPoints<Cylinder>(normalized->points, 30, best->data());
    }
    return Transform(normalized->original_from_normalized, best->data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    result.template head<3>() = Rotated(new_from_old, Vector3<T>(g[0], g[1], g[2])).normalized();
    result.template segment<3>(3) = Moved(new_from_old, Vector3<T>(g[3], g[4], g[5]));
    result[6] = g[6] + std::log(new_from_old.scale);
    return result;
  }

  static std::vector<Params> Examples() {
    const auto make = [](const Eigen::Vector3d& d, const Eigen::Vector3d& p, double radius) {
      Params g;
      g << d.normalized(), p, std::log(radius);
      return g;
    };
    return {make({0, 0, 1}, {0, 0, 0}, 1), make({1, -2, 0.5}, {3, 1, -2}, 0.75),
            make({-0.3, 0.2, 0.9}, {1500, 2200, -700}, 0.02), make({0.5, 0.5, -1}, {1, 2, 3}, 4e4),
            make({-1, 0.1, 0.1}, {0.5, 0, 0.2}, 5e-6)};
  }

  // The full side between the lowest and the highest member along the axis.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    const Eigen::Vector3d d(g[0], g[1], g[2]), p(g[3], g[4], g[5]);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const Eigen::Vector3d& X : member_points) {
      low = std::min(low, d.dot(X - p));
      high = std::max(high, d.dot(X - p));
    }
    if (!(high > low)) return {};
    const double radius = std::exp(g[6]);
    return FrustumMesh(d, p + low * d, radius, p + high * d, radius);
  }

 private:
  static constexpr size_t kMaxSample = 64, kMaxStarts = 8;

  // Cylinder with axis direction d, its circle |x|^2 = 2 c.x + k by linear least squares, and its
  // sum of squared distances; infinite cost: none.
  static std::pair<Params, double> FitAlong(const Eigen::Vector3d& d,
                                            std::span<const Eigen::Vector3d> points) {
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    const double weight = 1.0 / static_cast<double>(points.size());
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector3d& X : points) mean += weight * (basis.transpose() * X);
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    Eigen::Vector2d third_moment = Eigen::Vector2d::Zero();
    double k = 0.0;
    for (const Eigen::Vector3d& X : points) {
      const Eigen::Vector2d u = basis.transpose() * X - mean;
      scatter += weight * u * u.transpose();
      third_moment += weight * u.squaredNorm() * u;
      k += weight * u.squaredNorm();
    }
    if (!(scatter.determinant() > 1e-14 * k * k)) {
      return {Params::Zero(), std::numeric_limits<double>::infinity()};
    }
    const Eigen::Vector2d centre = 0.5 * scatter.inverse() * third_moment;
    const double radius = std::sqrt(k + centre.squaredNorm());
    double cost = 0.0;
    for (const Eigen::Vector3d& X : points) {
      const double distance = (basis.transpose() * X - mean - centre).norm() - radius;
      cost += distance * distance;
    }
    Params g;
    g << d, basis * (mean + centre), std::log(radius);
    return {g, cost};
  }
};

}  // namespace holba
