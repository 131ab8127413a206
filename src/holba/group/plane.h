// SPDX-License-Identifier: BSD-3-Clause
// Plane: n.x + w = 0. Parameters [nx ny nz w], |n| = 1, w in model units. 3 dof.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/group/fit.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/mesh.h"

namespace holba {

struct Plane {
  static constexpr std::string_view kName = "PLANE";
  static constexpr int kTypeCode = 1;
  static constexpr std::string_view kFileParams = "nx ny nz w";
  static constexpr int kNumFileParams = 4;
  static constexpr int kMinPoints = 3, kMinLines = 2;
  using Manifold = Product<UnitVector3, Euclidean<1>>;
  using Params = GroupParams<double, Manifold>;

  // Sine of 1 degree: a line nearer to the normal has no projection. There the projected direction
  // turns by 1 / sine of what the line turns: with f = 700 px the group residual of a line moves by
  // 74 px per radian of its direction in the plane, 440 at 20 degrees from the normal, 2.9e3 at 5
  // and 2.8e4 at 1.
  static constexpr double kMinLineSine = 0.017452406437283512;

  static std::string_view Requirement() { return "unit n, n.x + w = 0"; }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 4)) return std::nullopt;
    const Params g(plain[0], plain[1], plain[2], plain[3]);
    const std::optional<double> scale = ScaleToUnit<3>(g.head<3>());
    if (!scale) return std::nullopt;
    return Params(*scale * g);
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    std::copy(g, g + 4, plain);
  }

  // Unit normal.
  template <typename T>
  static Vector3<T> Direction(const T* g) {
    return Vector3<T>(g[0], g[1], g[2]);
  }

  // Nearest point of the plane.
  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    return PointOnto(Vector3<T>(g[0], g[1], g[2]), g[3], X);
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const Eigen::Vector3d n(g[0], g[1], g[2]);
    const double distance = n.dot(X) + g[3];
    Eigen::Map<RowMajor<3, 3>>{d_point} = Eigen::Matrix3d::Identity() - n * n.transpose();
    Eigen::Map<RowMajor<3, 4>> by_group(d_group);
    by_group.leftCols<3>() = -n * X.transpose();
    for (int i = 0; i < 3; ++i) by_group(i, i) -= distance;
    by_group.col(3) = -n;
    return Eigen::Vector3d(X - distance * n);
  }

  // Orthogonal projection of the line with unit d, as unit d' and its moment. Fails along the
  // normal.
  template <typename T>
  static std::optional<std::pair<Vector3<T>, Vector3<T>>> ProjectLine(const T* g,
                                                                      const Vector3<T>& d,
                                                                      const Vector3<T>& m) {
    return LineOnto(Vector3<T>(g[0], g[1], g[2]), g[3], d, m);
  }

  static std::optional<Vector6d> ProjectLineWithJacobian(const double* g, const Eigen::Vector3d& d,
                                                         const Eigen::Vector3d& m, double* d_line,
                                                         double* d_group) {
    RowMajor<6, 3> d_normal;
    Vector6d d_offset;
    const std::optional<Vector6d> projected = LineOntoWithJacobian(
        Eigen::Vector3d(g[0], g[1], g[2]), g[3], d, m, d_line, &d_normal, &d_offset);
    Eigen::Map<RowMajor<6, 4>> by_group(d_group);
    if (projected) by_group << d_normal, d_offset;
    return projected;
  }

  // The formulas by normal and offset; a cuboid projects on its faces with them.
  template <typename T>
  static Vector3<T> PointOnto(const Vector3<T>& n, const T& w, const Vector3<T>& X) {
    return X - (n.dot(X) + w) * n;
  }

  template <typename T>
  static std::optional<std::pair<Vector3<T>, Vector3<T>>> LineOnto(const Vector3<T>& n, const T& w,
                                                                   const Vector3<T>& d,
                                                                   const Vector3<T>& m) {
    using std::sqrt;
    const T a = d.dot(n);
    const Vector3<T> flat = d - a * n;
    const T squared_sine = flat.squaredNorm();
    if (!(squared_sine >= T(kMinLineSine * kMinLineSine))) return std::nullopt;
    const Vector3<T> u = d.cross(n);
    const Vector3<T> moment = (T(1) - a * a) * m + (a * m.dot(n)) * d + (w - u.dot(m)) * u;
    const T scale = T(1) / sqrt(squared_sine);
    return std::pair<Vector3<T>, Vector3<T>>(scale * flat, scale * moment);
  }

  static std::optional<Vector6d> LineOntoWithJacobian(const Eigen::Vector3d& n, double w,
                                                      const Eigen::Vector3d& d,
                                                      const Eigen::Vector3d& m, double* d_line,
                                                      RowMajor<6, 3>* d_normal,
                                                      Vector6d* d_offset) {
    const double a = d.dot(n), gamma = m.dot(n);
    Vector6d line;
    line.head<3>() = d - a * n;
    const double squared_sine = line.head<3>().squaredNorm();
    if (!(squared_sine >= kMinLineSine * kMinLineSine)) return std::nullopt;
    const Eigen::Vector3d u = d.cross(n);
    const double lift = w - u.dot(m);
    line.tail<3>() = (1.0 - a * a) * m + (a * gamma) * d + lift * u;

    // Of the unscaled line (flat, moment) first.
    Eigen::Map<RowMajor<6, 6>> by_line(d_line);
    by_line.topLeftCorner<3, 3>() = -n * n.transpose();
    by_line.topRightCorner<3, 3>().setZero();
    by_line.bottomLeftCorner<3, 3>() = (gamma * d - 2.0 * a * m) * n.transpose() -
                                       u * n.cross(m).transpose() - lift * CrossMatrix(n);
    by_line.bottomRightCorner<3, 3>() = (a * d) * n.transpose() - u * u.transpose();
    RowMajor<6, 3>& by_normal = *d_normal;
    by_normal.topRows<3>() = -n * d.transpose();
    by_normal.bottomRows<3>() = (gamma * d - 2.0 * a * m) * d.transpose() +
                                (a * d) * m.transpose() - u * m.cross(d).transpose() +
                                lift * CrossMatrix(d);
    for (int i = 0; i < 3; ++i) {
      by_line(i, i) += 1.0;
      by_line(3 + i, i) += a * gamma;
      by_line(3 + i, 3 + i) += 1.0 - a * a;
      by_normal(i, i) -= a;
    }
    // Then of the scaling by 1 / |flat|; flat is perpendicular to n.
    const double scale = 1.0 / std::sqrt(squared_sine);
    const Vector6d shrink = line / squared_sine;
    const Eigen::Vector3d flat = line.head<3>();
    by_line.leftCols<3>() -= shrink * flat.transpose();
    by_normal += (a * shrink) * flat.transpose();
    by_line *= scale;
    by_normal *= scale;
    d_offset->head<3>().setZero();
    d_offset->tail<3>() = scale * u;
    return Vector6d(scale * line);
  }

  // Least squares of points and lines in any mix that spans a plane (fit.h); exact through 3
  // points.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    if (points.size() != 3 || !lines.empty()) return FitPlane(points, lines);
    // In the loop of a RANSAC: no eigenvectors, no allocation.
    const Eigen::Vector3d u = points[1] - points[0], v = points[2] - points[0];
    const Eigen::Vector3d normal = u.cross(v);
    const double extent = std::max({u.norm(), v.norm(), (u - v).norm()});
    if (!(normal.norm() > 1e-6 * extent * extent)) return std::nullopt;
    Params g;
    g.head<3>() = normal.normalized();
    g[3] = -g.head<3>().dot(points[0] + (u + v) / 3.0);
    return g;
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    result.template head<3>() = Rotated(new_from_old, Vector3<T>(g[0], g[1], g[2])).normalized();
    result[3] = new_from_old.scale * g[3] -
                Vector3<T>(result.template head<3>()).dot(new_from_old.translation.cast<T>());
    return result;
  }

  static std::vector<Params> Examples() {
    const Eigen::Vector3d slanted(0.36, -0.48, 0.8), steep(-0.6, 0.0, -0.8);
    return {Params(0, 0, 1, 0), Params(1, 0, 0, -2.5),
            Params(slanted.x(), slanted.y(), slanted.z(), 1.75),
            Params(slanted.x(), slanted.y(), slanted.z(), -4e5),
            Params(steep.x(), steep.y(), steep.z(), 3e-7)};
  }

  // The rectangle along their principal axes that the projected members fill.
  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    std::vector<Eigen::Vector3d> projected;
    projected.reserve(member_points.size());
    for (const Eigen::Vector3d& X : member_points) projected.push_back(*ProjectPoint(g, X));
    return RectangleMesh(Eigen::Vector3d(g[0], g[1], g[2]), projected);
  }
};

}  // namespace holba
