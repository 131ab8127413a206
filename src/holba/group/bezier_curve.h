// SPDX-License-Identifier: BSD-3-Clause
// Cubic Bezier curve, C(t) = sum_i B_i(t) p_i for t in [0, 1]: cables, rails, bent edges; a spline
// of several pieces is several of these. Parameters [x0 y0 z0 .. x3 y3 z3]: the four control
// points. 12 numbers, of which points of the curve determine 10: its ends may slide along it.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "holba/geometry/dual.h"
#include "holba/geometry/least_squares.h"
#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"

namespace holba {

struct BezierCurve {
  static constexpr std::string_view kName = "BEZIER_CURVE";
  static constexpr int kTypeCode = 8;
  static constexpr std::string_view kFileParams = "x0 y0 z0 x1 y1 z1 x2 y2 z2 x3 y3 z3";
  static constexpr int kNumFileParams = 12;
  static constexpr int kMinPoints = 5, kMinLines = 0;
  using Manifold = Euclidean<12>;
  using Params = GroupParams<double, Manifold>;

  static std::string_view Requirement() { return "control points that are not all the same"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 12)) return std::nullopt;
    const Params g = Eigen::Map<const Params>(plain);
    if (!(ControlLength(g.data()) > 0.0)) return std::nullopt;
    return g;
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    std::copy(g, g + 12, plain);
  }

  // Nearest point of the curve, of its ends beyond them. Fails where a centre of curvature is
  // nearest to no point of it, and where the curve stands still (a cusp).
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    double values[12];
    for (int i = 0; i < 12; ++i) values[i] = ValueOf(g[i]);
    const std::optional<Foot> foot =
        FootOf(values, Eigen::Vector3d(ValueOf(X[0]), ValueOf(X[1]), ValueOf(X[2])));
    if (!foot) return std::nullopt;
    if (foot->is_end) {
      const T* end = g + (foot->t == 0.0 ? 0 : 9);
      return Vector3<T>(end[0], end[1], end[2]);
    }
    // A step of Newton at the solution leaves t as it is and gives it its derivatives.
    const double t = foot->t;
    const Vector3<T> point = At(g, Bernstein(t)), speed = At(g, BernsteinSpeed(t));
    const Vector3<T> off = point - X;
    const T moved = T(t) - off.dot(speed) / T(foot->curvature);
    return At(g, Bernstein(moved));
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const std::optional<Foot> foot = FootOf(g, X);
    if (!foot) return std::nullopt;
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    Eigen::Map<RowMajor<3, 12>> by_group(d_group);
    by_point.setZero();
    by_group.setZero();
    if (foot->is_end) {
      const int first = foot->t == 0.0 ? 0 : 9;
      by_group.middleCols<3>(first).setIdentity();
      return Eigen::Vector3d(g[first], g[first + 1], g[first + 2]);
    }
    // f(t, p, X) = (C - X).C' = 0 determines t: dt = -(df by p and X) / f'.
    double t = foot->t;
    const std::array<double, 4> speeds = BernsteinSpeed(t);
    const Eigen::Vector3d speed = At(g, speeds);
    const Eigen::Vector3d off = At(g, Bernstein(t)) - X;
    t -= off.dot(speed) / foot->curvature;  // as in ProjectPoint
    const std::array<double, 4> weights = Bernstein(t);
    by_point = speed * speed.transpose() / foot->curvature;
    for (int i = 0; i < 4; ++i) {
      const Eigen::RowVector3d d_t =
          -(weights[i] * speed + speeds[i] * off).transpose() / foot->curvature;
      by_group.middleCols<3>(3 * i) = speed * d_t;
      for (int k = 0; k < 3; ++k) by_group(k, 3 * i + k) += weights[i];
    }
    return At(g, weights);
  }

  // Points in an order along the curve have parameters by the lengths between them, control points
  // by linear least squares, then Levenberg-Marquardt on the distances. Orders: along the longest
  // principal axis, around the centroid, and from neighbour to neighbour; the nearest curve of
  // them. It goes on beyond the points as far as another of its points may lie, with their number.
  // Fails on points of a line.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() < kMinPoints) return std::nullopt;
    const std::optional<NormalizedPoints> normalized = NormalizePoints(points);
    if (!normalized) return std::nullopt;
    const std::vector<Eigen::Vector3d> sample = EverySoMany(normalized->points, kMaxSample);
    const PrincipalAxes principal = PrincipalAxesOf(sample);
    if (!(principal.variances[1] > 1e-12 * principal.variances[2])) return std::nullopt;
    std::optional<Params> best;
    double best_cost = std::numeric_limits<double>::infinity();
    for (const std::vector<size_t>& order :
         {AlongAxis(principal, sample), AroundCentroid(principal, sample), Neighbours(sample)}) {
      std::optional<Params> g = Through(sample, order);
      if (!g) continue;
      std::optional<double> cost = RefineOnPoints<BezierCurve>(sample, 50, g->data());
      if (!cost) continue;
      *g = Extended(*g, sample);
      cost = RefineOnPoints<BezierCurve>(sample, 100, g->data());
      if (!cost || !(*cost < best_cost) || !g->allFinite()) continue;
      best = g;
      best_cost = *cost;
      if (best_cost < 1e-20 * static_cast<double>(sample.size())) break;
    }
    if (!best || !(ControlLength(best->data()) < kMaxRelativeLength)) return std::nullopt;
    if (sample.size() < points.size()) {
      RefineOnPoints<BezierCurve>(normalized->points, 30, best->data());
    }
    return Transform(normalized->original_from_normalized, best->data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    for (int i = 0; i < 12; i += 3) {
      result.template segment<3>(i) = Moved(new_from_old, Vector3<T>(g[i], g[i + 1], g[i + 2]));
    }
    return result;
  }

  static std::vector<Params> Examples() {
    Params bow, wave, far, small;
    // No longer than 1: the tests' points are of a cube of that size about a point of it.
    bow << -0.5, 0, 0, -0.2, 0.2, 0, 0.2, 0.2, 0, 0.5, 0, 0;
    wave << 0, 0, 0, 0.3, 0.12, 0.03, 0.6, -0.09, 0.09, 0.9, 0.06, 0.15;
    far << 120, -340, 56, 120.25, -340.1, 56.15, 120.5, -340.15, 56.3, 120.65, -340.1, 56.5;
    small << 1e-3, 2e-3, 0, 2e-3, 2.4e-3, 1e-4, 3e-3, 2.3e-3, 3e-4, 4e-3, 2e-3, 3e-4;
    return {bow, wave, far, small};
  }

  // A curve is drawn as a tube, of this radius about it.
  static double TubeRadius(const double* g) { return 0.004 * ControlLength(g); }

  // From the first to the last member along it; without members, all of it.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    constexpr uint32_t kAlong = 48, kAround = 8;
    double first = 1.0, last = 0.0;
    for (const Eigen::Vector3d& X : member_points) {
      const std::optional<Foot> foot = FootOf(g, X);
      if (!foot) continue;
      first = std::min(first, foot->t);
      last = std::max(last, foot->t);
    }
    if (!(last > first)) first = 0.0, last = 1.0;
    const double radius = TubeRadius(g);
    GroupMesh mesh;
    Eigen::Vector3d side = Eigen::Vector3d::Zero();
    for (uint32_t i = 0; i <= kAlong; ++i) {
      const double t = first + (last - first) * i / kAlong;
      const Eigen::Vector3d speed = At(g, BernsteinSpeed(t));
      if (!(speed.norm() > 0.0)) continue;
      const Eigen::Vector3d along = speed.normalized();
      // The last side, turned as little as possible: the tube is not twisted.
      side -= side.dot(along) * along;
      side = side.norm() > 1e-6 ? side.normalized() : Eigen::Vector3d(TangentBasis(along).col(0));
      const Eigen::Vector3d up = along.cross(side);
      for (uint32_t k = 0; k < kAround; ++k) {
        const double phi = 2.0 * std::numbers::pi * k / kAround;
        mesh.vertices.push_back(At(g, Bernstein(t)) +
                                radius * (std::cos(phi) * side + std::sin(phi) * up));
      }
    }
    const uint32_t num_rings = static_cast<uint32_t>(mesh.vertices.size()) / kAround;
    for (uint32_t i = 0; i + 1 < num_rings; ++i) {
      for (uint32_t k = 0; k < kAround; ++k) {
        const uint32_t next = (k + 1) % kAround;
        const uint32_t a = i * kAround + k, b = i * kAround + next;
        mesh.triangles.push_back({a, b, b + kAround});
        mesh.triangles.push_back({a, b + kAround, a + kAround});
      }
    }
    return mesh;
  }

 private:
  static constexpr size_t kMaxSample = 64;
  // Control points of a fit further away are a curve that points do not determine.
  static constexpr double kMaxRelativeLength = 1e3;

  // Place of the nearest point. curvature: derivative of (C - X).C' there.
  struct Foot {
    double t, curvature;
    bool is_end;
  };

  template <typename T>
  static std::array<T, 4> Bernstein(const T& t) {
    const T s = T(1) - t;
    return {s * s * s, T(3) * s * s * t, T(3) * s * t * t, t * t * t};
  }
  static std::array<double, 4> BernsteinSpeed(double t) {
    const double s = 1.0 - t;
    return {-3 * s * s, 3 * s * s - 6 * s * t, 6 * s * t - 3 * t * t, 3 * t * t};
  }
  static std::array<double, 4> BernsteinBend(double t) {
    const double s = 1.0 - t;
    return {6 * s, 6 * t - 12 * s, 6 * s - 12 * t, 6 * t};
  }

  template <typename T, typename W>
  static Vector3<T> At(const T* g, const std::array<W, 4>& weights) {
    Vector3<T> sum(T(0), T(0), T(0));
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) sum[k] = sum[k] + weights[i] * g[3 * i + k];
    }
    return sum;
  }

  static double ControlLength(const double* g) {
    double length = 0.0;
    for (int i = 0; i < 9; i += 3) {
      length += Eigen::Vector3d(g[i + 3] - g[i], g[i + 4] - g[i + 1], g[i + 5] - g[i + 2]).norm();
    }
    return length;
  }

  // The nearest of places so near to each other that a curve of one bend is told from its other
  // branches there, then Newton's steps between its neighbours, by halves where these leave them.
  static std::optional<Foot> FootOf(const double* g, const Eigen::Vector3d& X) {
    constexpr int kNumPlaces = 32;
    int nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= kNumPlaces; ++i) {
      const double square = (At(g, Bernstein(1.0 * i / kNumPlaces)) - X).squaredNorm();
      if (square < least) least = square, nearest = i;
    }
    if (!std::isfinite(least)) return std::nullopt;
    double low = std::max(nearest - 1, 0) / (1.0 * kNumPlaces);
    double high = std::min(nearest + 1, kNumPlaces) / (1.0 * kNumPlaces);
    const auto slope = [&](double t, double* curvature) {
      const Eigen::Vector3d off = At(g, Bernstein(t)) - X, speed = At(g, BernsteinSpeed(t));
      *curvature = speed.squaredNorm() + off.dot(At(g, BernsteinBend(t)));
      return off.dot(speed);
    };
    double curvature = 0.0;
    if (low == 0.0 && slope(0.0, &curvature) >= 0.0 && nearest == 0) {
      return Foot{0.0, curvature, true};
    }
    if (high == 1.0 && slope(1.0, &curvature) <= 0.0 && nearest == kNumPlaces) {
      return Foot{1.0, curvature, true};
    }
    double t = std::clamp(nearest / (1.0 * kNumPlaces), low, high);
    for (int iteration = 0; iteration < 100; ++iteration) {
      const double f = slope(t, &curvature);
      if (f == 0.0) break;
      (f > 0.0 ? high : low) = t;
      double next = t - f / curvature;
      if (!(curvature > 0.0) || !(next >= low && next <= high)) next = 0.5 * (low + high);
      const double change = std::abs(next - t);
      t = next;
      if (change <= 4.0 * std::numeric_limits<double>::epsilon()) break;
    }
    slope(t, &curvature);
    const double speed = At(g, BernsteinSpeed(t)).squaredNorm();
    if (!(curvature > kMinRadialFraction * speed) || !(speed > 0.0)) return std::nullopt;
    return Foot{t, curvature, false};
  }

  // How far a curve of this many points may go on beyond them, of its length between them: with 10
  // times the mean gap at each end, one in 20 000 others lies outside.
  static double Margin(size_t num_points) {
    return std::min(0.25, 10.0 / static_cast<double>(num_points));
  }

  // The same curve from a little before the first of the points to a little behind the last.
  static Params Extended(const Params& g, std::span<const Eigen::Vector3d> points) {
    double first = 1.0, last = 0.0;
    for (const Eigen::Vector3d& X : points) {
      const std::optional<Foot> foot = FootOf(g.data(), X);
      if (!foot) continue;
      first = std::min(first, foot->t);
      last = std::max(last, foot->t);
    }
    if (!(last > first)) return g;
    const double margin = Margin(points.size()) * (last - first);
    const double a = first - margin, b = last + margin;
    // Blossoms of the cubic at (a, a, a), (a, a, b), (a, b, b) and (b, b, b).
    Params extended;
    for (int i = 0; i < 4; ++i) {
      Eigen::Matrix<double, 3, 4> level = Eigen::Map<const Eigen::Matrix<double, 3, 4>>(g.data());
      for (int round = 0; round < 3; ++round) {
        const double t = round < 3 - i ? a : b;
        for (int k = 0; k + round < 3; ++k) {
          level.col(k) = (1.0 - t) * level.col(k) + t * level.col(k + 1);
        }
      }
      extended.segment<3>(3 * i) = level.col(0);
    }
    return extended;
  }

  static std::vector<size_t> InOrder(const std::vector<double>& keys) {
    std::vector<size_t> order(keys.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&keys](size_t a, size_t b) { return keys[a] < keys[b]; });
    return order;
  }

  static std::vector<size_t> AlongAxis(const PrincipalAxes& principal,
                                       std::span<const Eigen::Vector3d> points) {
    std::vector<double> keys;
    for (const Eigen::Vector3d& X : points) keys.push_back(principal.axes.col(2).dot(X));
    return InOrder(keys);
  }

  // For arcs of more than a half turn: begins behind the widest gap.
  static std::vector<size_t> AroundCentroid(const PrincipalAxes& principal,
                                            std::span<const Eigen::Vector3d> points) {
    std::vector<double> angles;
    for (const Eigen::Vector3d& X : points) {
      const Eigen::Vector3d u = X - principal.centroid;
      angles.push_back(std::atan2(principal.axes.col(1).dot(u), principal.axes.col(2).dot(u)));
    }
    std::vector<size_t> order = InOrder(angles);
    size_t widest = 0;
    double width = -1.0;
    for (size_t i = 0; i < order.size(); ++i) {
      const size_t before = i == 0 ? order.size() - 1 : i - 1;
      double gap = angles[order[i]] - angles[order[before]];
      if (i == 0) gap += 2.0 * std::numbers::pi;
      if (gap > width) width = gap, widest = i;
    }
    std::rotate(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(widest), order.end());
    return order;
  }

  // From the point farthest from the centroid always to the nearest that is left.
  static std::vector<size_t> Neighbours(std::span<const Eigen::Vector3d> points) {
    std::vector<bool> taken(points.size(), false);
    size_t at = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      if (points[i].squaredNorm() > points[at].squaredNorm()) at = i;
    }
    std::vector<size_t> order{at};
    taken[at] = true;
    while (order.size() < points.size()) {
      size_t next = points.size();
      for (size_t i = 0; i < points.size(); ++i) {
        if (taken[i]) continue;
        if (next == points.size() ||
            (points[i] - points[at]).squaredNorm() < (points[next] - points[at]).squaredNorm()) {
          next = i;
        }
      }
      taken[next] = true;
      order.push_back(next);
      at = next;
    }
    return order;
  }

  static std::optional<Params> Through(std::span<const Eigen::Vector3d> points,
                                       const std::vector<size_t>& order) {
    std::vector<double> along(points.size(), 0.0);
    for (size_t i = 1; i < order.size(); ++i) {
      along[order[i]] = along[order[i - 1]] + (points[order[i]] - points[order[i - 1]]).norm();
    }
    const double length = along[order.back()];
    if (!(length > 0.0)) return std::nullopt;
    Eigen::MatrixXd A(points.size(), 4), b(points.size(), 3);
    for (size_t i = 0; i < points.size(); ++i) {
      const std::array<double, 4> weights = Bernstein(along[i] / length);
      A.row(static_cast<Eigen::Index>(i)) << weights[0], weights[1], weights[2], weights[3];
      b.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
    }
    const Eigen::MatrixXd x = LeastSquares(A, b);
    if (!x.allFinite()) return std::nullopt;
    Params g;
    for (int i = 0; i < 4; ++i) g.segment<3>(3 * i) = x.row(i).transpose();
    return g;
  }
};

}  // namespace holba
