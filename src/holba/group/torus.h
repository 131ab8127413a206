// SPDX-License-Identifier: BSD-3-Clause
// Ring torus: points at distance r from a circle of radius R > r about the centre c, in the plane
// across the axis d. Parameters [cx cy cz dx dy dz log_hole log_r]: centre, unit axis, logarithms
// of the radius R - r of the hole and of that of the tube, so that R > r holds whatever a solver
// does. 7 dof.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "holba/geometry/least_squares.h"
#include "holba/geometry/symmetric_solve.h"
#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/mesh.h"

namespace holba {

struct Torus {
  static constexpr std::string_view kName = "TORUS";
  static constexpr int kTypeCode = 7;
  static constexpr std::string_view kFileParams = "cx cy cz dx dy dz R r";
  static constexpr int kNumFileParams = 8;
  static constexpr int kMinPoints = 13, kMinLines = 0;
  using Manifold = Product<Euclidean<3>, UnitVector3, Euclidean<2>>;
  using Params = GroupParams<double, Manifold>;

  // A fitted ring of more than this many root mean square extents is a cylinder to the points.
  static constexpr double kMaxRelativeRadius = 1e3;

  static std::string_view Requirement() { return "unit d, 0 < r < R"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 8) || !IsPositive(plain[7]) || !IsPositive(plain[6] - plain[7])) {
      return std::nullopt;
    }
    const Eigen::Vector3d d(plain[3], plain[4], plain[5]);
    const std::optional<double> scale = ScaleToUnit<3>(d);
    if (!scale) return std::nullopt;
    Params g;
    g << plain[0], plain[1], plain[2], *scale * d, std::log(plain[6] - plain[7]),
        std::log(plain[7]);
    return g;
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    using std::exp;
    for (int i = 0; i < 6; ++i) plain[i] = g[i];
    plain[7] = exp(g[7]);
    plain[6] = exp(g[6]) + plain[7];
  }

  // Nearest point: from the nearest point of the circle, r towards X. Fails on the axis and on the
  // circle.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    using std::exp;
    using std::sqrt;
    const Vector3<T> centre(g[0], g[1], g[2]), d(g[3], g[4], g[5]);
    const T r = exp(g[7]), R = exp(g[6]) + r;
    const Vector3<T> u = X - centre;
    const T h = u.dot(d);
    const Vector3<T> across = u - h * d;
    const T rho = sqrt(across.squaredNorm());
    if (!(rho > T(kMinRadialFraction) * R)) return std::nullopt;
    const Vector3<T> outward = across / rho;
    const Vector3<T> from_circle = (rho - R) * outward + h * d;
    const T distance = sqrt(from_circle.squaredNorm());
    if (!(distance > T(kMinRadialFraction) * r)) return std::nullopt;
    return Vector3<T>(centre + R * outward + (r / distance) * from_circle);
  }

  // With phi the angle around the tube, n = cos(phi) e + sin(phi) d from the circle to X (e:
  // outward from the axis, t: around it), m the tangent that phi turns n to: P = c + R e + r n.
  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Vector3d centre(g[0], g[1], g[2]), d(g[3], g[4], g[5]);
    const double hole = std::exp(g[6]), r = std::exp(g[7]), R = hole + r;
    const Eigen::Vector3d u = X - centre;
    const double h = u.dot(d);
    Eigen::Vector3d e = u - h * d;
    const double rho = e.norm();
    if (!(rho > kMinRadialFraction * R)) return std::nullopt;
    e /= rho;
    const double distance = std::hypot(rho - R, h);
    if (!(distance > kMinRadialFraction * r)) return std::nullopt;
    const double cos_phi = (rho - R) / distance, sin_phi = h / distance;
    const Eigen::Vector3d t = d.cross(e), n = cos_phi * e + sin_phi * d;
    const Eigen::Vector3d m = cos_phi * d - sin_phi * e;
    const double reach = R + r * cos_phi;  // distance of P from the axis
    Eigen::Map<RowMajor<3, 3>> by_point(d_point);
    Eigen::Map<RowMajor<3, 8>> by_group(d_group);
    by_point = (reach / rho * t) * t.transpose() + (r / distance * m) * m.transpose();
    by_group.leftCols<3>() = Eigen::Matrix3d::Identity() - by_point;
    // For changes of d perpendicular to it: e turns by -d (e.dd) - h / rho t (t.dd).
    by_group.middleCols<3>(3) =
        (r * sin_phi * e - reach * d + r * (rho * cos_phi + h * sin_phi) / distance * m) *
            e.transpose() +
        ((r * sin_phi - reach * h / rho) * t) * t.transpose();
    const Eigen::Vector3d by_R = e + r * sin_phi / distance * m;
    by_group.col(6) = hole * by_R;
    by_group.col(7) = r * (by_R + n);
    return Eigen::Vector3d(centre + R * e + r * n);
  }

  // With q = |X|^2 the torus is the quartic (q - 2 c.X + K)^2 = 4 R^2 |X - c across d|^2, K = |c|^2
  // + R^2 - r^2: linear in 13 coefficients of q X, XX' and X, of which the torus is read off, and
  // the start of Levenberg-Marquardt on the distances. Where noise bends the quartic, circles about
  // the directions of least spread start it as well. Fails on points of a plane, and where a
  // cylinder explains them.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() < kMinPoints) return std::nullopt;
    const std::optional<NormalizedPoints> normalized = NormalizePoints(points);
    if (!normalized) return std::nullopt;
    const PrincipalAxes principal = PrincipalAxesOf(normalized->points);
    if (!(principal.variances[0] > 1e-12 * principal.variances[2])) return std::nullopt;
    const std::vector<Eigen::Vector3d> sample = EverySoMany(normalized->points, kMaxSample);
    std::optional<Params> best;
    double best_cost = std::numeric_limits<double>::infinity();
    const auto consider = [&](const std::optional<Params>& start) {
      if (!start || best_cost < 1e-20 * static_cast<double>(sample.size())) return;
      Params g = *start;
      const std::optional<double> cost = RefineOnPoints<Torus>(sample, 100, g.data());
      if (!cost || !(*cost < best_cost) || !IsProper(g)) return;
      best = g;
      best_cost = *cost;
    };
    consider(FromQuartic(normalized->points));
    for (int i = 0; i < 3; ++i) consider(AboutAxis(principal.axes.col(i), sample));
    for (const Eigen::Vector3d& d : AxisCandidates(sample)) consider(AboutAxis(d, sample));
    if (!best) return std::nullopt;
    if (sample.size() < points.size()) RefineOnPoints<Torus>(normalized->points, 30, best->data());
    return Transform(normalized->original_from_normalized, best->data());
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    result.template head<3>() = Moved(new_from_old, Vector3<T>(g[0], g[1], g[2]));
    result.template segment<3>(3) =
        Rotated(new_from_old, Vector3<T>(g[3], g[4], g[5])).normalized();
    for (int i : {6, 7}) result[i] = g[i] + std::log(new_from_old.scale);
    return result;
  }

  static std::vector<Params> Examples() {
    const auto make = [](const Eigen::Vector3d& c, const Eigen::Vector3d& d, double R, double r) {
      Params g;
      g << c, d.normalized(), std::log(R - r), std::log(r);
      return g;
    };
    return {make({0, 0, 0}, {0, 0, 1}, 1.0, 0.3), make({1, -2, 3}, {0.4, 1, -0.3}, 2.0, 0.9),
            make({210, -130, 90}, {-1, 0.2, 0.6}, 0.5, 0.05), make({0.5, 4, 1}, {-1, 0, 0}, 3, 2)};
  }

  // All of it: rings around the tube.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    constexpr uint32_t kAround = 64, kOfTube = 24;
    const Eigen::Vector3d centre(g[0], g[1], g[2]), d(g[3], g[4], g[5]);
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    const double r = std::exp(g[7]), R = std::exp(g[6]) + r;
    GroupMesh mesh;
    for (uint32_t i = 0; i < kAround; ++i) {
      const double theta = 2.0 * std::numbers::pi * i / kAround;
      const Eigen::Vector3d e = basis * Eigen::Vector2d(std::cos(theta), std::sin(theta));
      for (uint32_t k = 0; k < kOfTube; ++k) {
        const double phi = 2.0 * std::numbers::pi * k / kOfTube;
        mesh.vertices.push_back(centre + (R + r * std::cos(phi)) * e + r * std::sin(phi) * d);
      }
    }
    const auto at = [](uint32_t i, uint32_t k) { return i % kAround * kOfTube + k % kOfTube; };
    // (basis, d) may be left-handed to the viewer's eye: the order below is seen from outside.
    const bool right_handed = basis.col(0).cross(basis.col(1)).dot(d) > 0.0;
    for (uint32_t i = 0; i < kAround; ++i) {
      for (uint32_t k = 0; k < kOfTube; ++k) {
        const uint32_t a = at(i, k), b = at(i + 1, k), c = at(i + 1, k + 1), e = at(i, k + 1);
        if (right_handed) {
          mesh.triangles.push_back({a, b, c});
          mesh.triangles.push_back({a, c, e});
        } else {
          mesh.triangles.push_back({a, c, b});
          mesh.triangles.push_back({a, e, c});
        }
      }
    }
    return mesh;
  }

 private:
  static constexpr size_t kMaxSample = 64;

  static bool IsProper(const Params& g) {
    return g.allFinite() && std::exp(g[6]) + std::exp(g[7]) < kMaxRelativeRadius &&
           std::exp(g[7]) > 1e-6 && std::exp(g[6]) > 1e-6;
  }

  static std::optional<Params> Make(const Eigen::Vector3d& c, const Eigen::Vector3d& d, double R,
                                    double r) {
    if (!c.allFinite() || !(R > 0.0) || !(r > 0.0)) return std::nullopt;
    // A start on the border of what a ring is, where a circle's points seem to cross its axis.
    r = std::min(r, 0.9 * R);
    Params g;
    g << c, d.normalized(), std::log(R - r), std::log(r);
    return g;
  }

  // Of points about the origin. Empty: the quartic is no torus.
  static std::optional<Params> FromQuartic(std::span<const Eigen::Vector3d> points) {
    Eigen::MatrixXd A(points.size(), 13);
    Eigen::VectorXd b(points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d& X = points[i];
      const double q = X.squaredNorm();
      A.row(static_cast<Eigen::Index>(i)) << q * X.transpose(), X[0] * X[0], X[1] * X[1],
          X[2] * X[2], 2 * X[0] * X[1], 2 * X[0] * X[2], 2 * X[1] * X[2], X.transpose(), 1.0;
      b[static_cast<Eigen::Index>(i)] = -q * q;
    }
    const Eigen::VectorXd x = LeastSquares(A, b);
    if (!x.allFinite()) return std::nullopt;
    const Eigen::Vector3d c = -0.25 * x.head<3>();
    Eigen::Matrix3d form;
    form << x[3], x[6], x[7], x[6], x[4], x[8], x[7], x[8], x[5];
    form -= 4.0 * c * c.transpose();  // (2K - 4R^2) I + 4R^2 dd'
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(form);
    const Eigen::Vector3d& values = eigen.eigenvalues();
    const double R_squared = 0.25 * (values[2] - 0.5 * (values[0] + values[1]));
    if (!(R_squared > 0.0)) return std::nullopt;
    const double r_squared = c.squaredNorm() + R_squared - 0.5 * values[2];
    if (!(r_squared > 0.0)) return std::nullopt;
    return Make(c, eigen.eigenvectors().col(2), std::sqrt(R_squared), std::sqrt(r_squared));
  }

  // Of an axis direction: circle through the points seen along it, tube by what is left over.
  static std::optional<Params> AboutAxis(const Eigen::Vector3d& d,
                                         std::span<const Eigen::Vector3d> points) {
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double height = 0.0;
    for (const Eigen::Vector3d& X : points) {
      const Eigen::Vector2d u = basis.transpose() * X;
      const Eigen::Vector3d row(2.0 * u.x(), 2.0 * u.y(), 1.0);
      A += row * row.transpose();
      b += u.squaredNorm() * row;
      height += d.dot(X) / static_cast<double>(points.size());
    }
    const Eigen::Vector3d circle = SolveSymmetric<3>(A, b);
    const double R = std::sqrt(circle[2] + circle.head<2>().squaredNorm());
    const Eigen::Vector3d c = basis * circle.head<2>() + height * d;
    if (!c.allFinite() || !std::isfinite(R)) return std::nullopt;
    double sum = 0.0;
    for (const Eigen::Vector3d& X : points) {
      const Eigen::Vector3d u = X - c;
      const double h = d.dot(u);
      sum += h * h + std::pow((u - h * d).norm() - R, 2);
    }
    return Make(c, d, R, std::sqrt(sum / static_cast<double>(points.size())));
  }
};

}  // namespace holba
