// SPDX-License-Identifier: BSD-3-Clause
// Cone of one nappe: angle alpha between X - a and the axis d. Parameters [ax ay az dx dy dz
// log_alpha]: apex, unit axis into the cone, logarithm of the half-angle in radians. 6 dof.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/geometry/symmetric_solve.h"
#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/mesh.h"

namespace holba {

struct Cone {
  static constexpr std::string_view kName = "CONE";
  static constexpr int kTypeCode = 4;
  static constexpr std::string_view kFileParams = "ax ay az dx dy dz alpha";
  static constexpr int kNumFileParams = 7;
  static constexpr int kMinPoints = 6, kMinLines = 0;
  using Manifold = Product<Euclidean<3>, UnitVector3, Euclidean<1>>;
  using Params = GroupParams<double, Manifold>;

  // A fitted cone with its apex beyond this many root mean square extents is a cylinder to the
  // points.
  static constexpr double kMaxRelativeApex = 1e3;

  static std::string_view Requirement() { return "unit d, 0 < alpha < pi/2"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 7) || !IsPositive(plain[6])) return std::nullopt;
    if (!(plain[6] < 0.5 * std::numbers::pi)) return std::nullopt;
    const Eigen::Vector3d d(plain[3], plain[4], plain[5]);
    const std::optional<double> scale = ScaleToUnit<3>(d);
    if (!scale) return std::nullopt;
    Params g;
    g << plain[0], plain[1], plain[2], *scale * d, std::log(plain[6]);
    return g;
  }

  // Past pi/2, where an adjustment may take the half-angle, the same surface opens the other way.
  template <typename T>
  static void ToFile(const T* g, T* plain) {
    using std::exp;
    const T alpha = exp(g[6]);
    const bool flip = alpha > T(0.5 * std::numbers::pi);
    for (int i = 0; i < 3; ++i) {
      plain[i] = g[i];
      plain[3 + i] = flip ? T(-g[3 + i]) : g[3 + i];
    }
    plain[6] = flip ? T(std::numbers::pi - alpha) : alpha;
  }

  // Nearest point of the cone: along the perpendicular to the generatrix in the half-plane of axis
  // and point, or the apex where the foot would lie before it (on the other nappe). Fails on the
  // axis inside.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    using std::cos;
    using std::exp;
    using std::sin;
    using std::sqrt;
    const Vector3<T> apex(g[0], g[1], g[2]), d(g[3], g[4], g[5]);
    const T alpha = exp(g[6]);
    if (!(alpha < T(std::numbers::pi))) return std::nullopt;
    const T cos_alpha = cos(alpha), sin_alpha = sin(alpha);
    const Vector3<T> u = X - apex;
    const T h = u.dot(d);
    const Vector3<T> across = u - h * d;
    const T squared_distance = across.squaredNorm();
    const double square = ValueOf(squared_distance);
    const double foot = ValueOf(h) * ValueOf(cos_alpha) + std::sqrt(square) * ValueOf(sin_alpha);
    if (foot <= 0.0) return apex;
    if (!(square > kMinRadialFraction * kMinRadialFraction * ValueOf(h) * ValueOf(h))) {
      return std::nullopt;
    }
    const T distance = sqrt(squared_distance);
    const T s = h * cos_alpha + distance * sin_alpha;
    return Vector3<T>(apex + s * (cos_alpha * d + (sin_alpha / distance) * across));
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Vector3d apex(g[0], g[1], g[2]), d(g[3], g[4], g[5]);
    const double alpha = std::exp(g[6]);
    if (!(alpha < std::numbers::pi)) return std::nullopt;
    const double cos_alpha = std::cos(alpha), sin_alpha = std::sin(alpha);
    const Eigen::Vector3d u = X - apex;
    const double h = u.dot(d);
    Eigen::Vector3d outward = u - h * d;
    const double distance = outward.norm();
    const double s = h * cos_alpha + distance * sin_alpha;
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    Eigen::Map<RowMajor<3, 7>> by_group(d_group);
    if (s <= 0.0) {
      by_point.setZero();
      by_group.setZero();
      by_group.leftCols<3>().setIdentity();
      return apex;
    }
    if (!(distance > kMinRadialFraction * std::abs(h))) return std::nullopt;
    outward /= distance;
    const Eigen::Vector3d around = d.cross(outward);
    const Eigen::Vector3d generatrix = cos_alpha * d + sin_alpha * outward;
    const Eigen::Vector3d turned = cos_alpha * outward - sin_alpha * d;  // d generatrix / d alpha
    const double d_s = distance * cos_alpha - h * sin_alpha;             // d s / d alpha
    by_point = generatrix * generatrix.transpose() +
               (s * sin_alpha / distance * around) * around.transpose();
    by_group.leftCols<3>() = Eigen::Matrix3d::Identity() - by_point;
    // For changes of d perpendicular to it: outward turns by -d (outward.dd) - h/distance around
    // (around.dd).
    by_group.middleCols<3>(3) = (d_s * generatrix - s * sin_alpha * d) * outward.transpose() -
                                (s * sin_alpha * h / distance * around) * around.transpose();
    for (int i = 0; i < 3; ++i) by_group(i, 3 + i) += s * cos_alpha;
    by_group.col(6) = alpha * (d_s * generatrix + s * turned);
    return Eigen::Vector3d(apex + s * generatrix);
  }

  // For each of many axis directions the cone is nearly linear (FitAlong); the best directions
  // start Levenberg-Marquardt on the distances. 6 points leave several cones, of which one is
  // returned; fails on points of a line or plane, and where a cylinder explains them.
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
      const std::optional<double> cost = RefineOnPoints<Cone>(sample, 100, g.data());
      if (!cost || !(*cost < best_cost) || !IsProper(g)) continue;
      best = g;
      best_cost = *cost;
      if (best_cost < 1e-20 * static_cast<double>(sample.size())) break;
    }
    if (!best) return std::nullopt;
    if (sample.size() < points.size()) {
      RefineOnPoints<Cone>(normalized->points, 30, best->data());
    }
    double plain[kNumFileParams];
    ToFile(best->data(), plain);
    best->segment<3>(3) << plain[3], plain[4], plain[5];
    (*best)[6] = std::log(plain[6]);
    return Transform(normalized->original_from_normalized, best->data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    result.template head<3>() = Moved(new_from_old, Vector3<T>(g[0], g[1], g[2]));
    result.template segment<3>(3) =
        Rotated(new_from_old, Vector3<T>(g[3], g[4], g[5])).normalized();
    result[6] = g[6];
    return result;
  }

  static std::vector<Params> Examples() {
    const auto make = [](const Eigen::Vector3d& apex, const Eigen::Vector3d& d, double alpha) {
      Params g;
      g << apex, d.normalized(), std::log(alpha);
      return g;
    };
    return {make({0, 0, 0}, {0, 0, 1}, 0.5), make({1, -2, 3}, {0.4, 1, -0.3}, 1.2),
            make({2100, -1300, 900}, {-1, 0.2, 0.6}, 0.3), make({0.5, 4, 1}, {-0.2, -1, 0.3}, 0.05),
            make({-3, 1, 0}, {1, 1, 1}, 1.5)};
  }

  // The full side between the lowest and the highest member along the generatrix.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    double plain[kNumFileParams];
    ToFile(g, plain);
    const Eigen::Vector3d apex(plain[0], plain[1], plain[2]), d(plain[3], plain[4], plain[5]);
    const double cos_alpha = std::cos(plain[6]), sin_alpha = std::sin(plain[6]);
    double low = std::numeric_limits<double>::infinity(), high = 0.0;
    for (const Eigen::Vector3d& X : member_points) {
      const double h = d.dot(X - apex);
      const double s = h * cos_alpha + (X - apex - h * d).norm() * sin_alpha;
      low = std::min(low, std::max(s, 0.0));
      high = std::max(high, s);
    }
    if (!(high > low)) return {};
    if (low < 1e-9 * high) low = 0.0;
    return FrustumMesh(d, apex + low * cos_alpha * d, low * sin_alpha, apex + high * cos_alpha * d,
                       high * sin_alpha);
  }

 private:
  static constexpr size_t kMaxSample = 64, kMaxStarts = 10;

  static bool IsProper(const Params& g) {
    const double alpha = std::exp(g[6]);
    return alpha < std::numbers::pi && std::abs(std::cos(alpha)) > 1e-3 && std::sin(alpha) > 1e-3 &&
           g.head<3>().norm() < kMaxRelativeApex;
  }

  // Cone with axis direction d or -d and its sum of squared distances; infinite cost: none. Two
  // linear fits, the better one: |u|^2 = 2 c.u + t^2 h^2 + B h + C in (c, t^2, B, C), with apex
  // height -B / 2t^2, exact for the true d; and |u - c| = t (h - h0) about the centre of a circle,
  // sane for all d.
  static std::pair<Params, double> FitAlong(const Eigen::Vector3d& d,
                                            std::span<const Eigen::Vector3d> points) {
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    Eigen::Matrix<double, 5, 5> A = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> b = Eigen::Matrix<double, 5, 1>::Zero(), row;
    Eigen::Matrix3d circle_A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d circle_b = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& X : points) {
      const Eigen::Vector2d u = basis.transpose() * X;
      const double h = d.dot(X), square = u.squaredNorm();
      row << 2.0 * u, h * h, h, 1.0;
      A += row * row.transpose();
      b += square * row;
      const Eigen::Vector3d circle_row(2.0 * u.x(), 2.0 * u.y(), 1.0);
      circle_A += circle_row * circle_row.transpose();
      circle_b += square * circle_row;
    }
    std::pair<Params, double> best{Params::Zero(), std::numeric_limits<double>::infinity()};
    const auto consider = [&](const Eigen::Vector2d& centre, double t, double h0) {
      if (!(std::abs(t) > 1e-4) || !std::isfinite(h0)) return;
      double side = 0.0;  // of the apex on which the points are
      for (const Eigen::Vector3d& X : points) side += d.dot(X) - h0;
      Params g;
      g << basis * centre + h0 * d, side < 0.0 ? Eigen::Vector3d(-d) : d,
          std::log(std::atan(std::abs(t)));
      if (!g.allFinite()) return;
      double cost = 0.0;
      for (const Eigen::Vector3d& X : points) {
        const std::optional<Eigen::Vector3d> projected = ProjectPoint(g.data(), X);
        if (!projected) return;
        cost += (X - *projected).squaredNorm();
      }
      if (cost < best.second) best = {g, cost};
    };
    const Eigen::Matrix<double, 5, 1> solution = SolveSymmetric<5>(A, b);
    if (solution.allFinite() && solution[2] > 0.0) {
      consider(solution.head<2>(), std::sqrt(solution[2]), -0.5 * solution[3] / solution[2]);
    }
    const Eigen::Vector3d circle = SolveSymmetric<3>(circle_A, circle_b);
    if (circle.allFinite()) {
      double sum_h = 0.0, sum_hh = 0.0, sum_r = 0.0, sum_hr = 0.0;
      const double num = static_cast<double>(points.size());
      for (const Eigen::Vector3d& X : points) {
        const double h = d.dot(X), r = (basis.transpose() * X - circle.head<2>()).norm();
        sum_h += h;
        sum_hh += h * h;
        sum_r += r;
        sum_hr += h * r;
      }
      const double t = (num * sum_hr - sum_h * sum_r) / (num * sum_hh - sum_h * sum_h);
      consider(circle.head<2>(), t, (sum_h - sum_r / t) / num);
    }
    return best;
  }
};

}  // namespace holba
