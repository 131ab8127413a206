// SPDX-License-Identifier: BSD-3-Clause
// Cuboid: six faces n_i.x + w_i = 0 with outward normals +R0 -R0 +R1 -R1 +R2 -R2 (columns of R).
// Parameters [qx qy qz qw, w0 .. w5]: rotation R local -> world as unit quaternion, face offsets. 9
// dof. A feature is projected on the plane of its nearest face; derivatives hold that face.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "holba/geometry/dual.h"
#include "holba/group/fit_box.h"
#include "holba/group/group_math.h"
#include "holba/group/group_type.h"
#include "holba/group/plane.h"

namespace holba {

struct Cuboid {
  static constexpr std::string_view kName = "CUBOID";
  static constexpr int kTypeCode = 6;
  static constexpr std::string_view kFileParams = "qw qx qy qz w0 w1 w2 w3 w4 w5";
  static constexpr int kNumFileParams = 10;
  static constexpr int kMinPoints = kMinBoxPoints, kMinLines = kMinBoxLines;
  using Manifold = Product<UnitQuaternion, Euclidean<6>>;
  using Params = GroupParams<double, Manifold>;

  static std::string_view Requirement() {
    return "unit q, w0 + w1 < 0, w2 + w3 < 0, w4 + w5 < 0 (faces not inside out)";
  }

  static std::optional<Params> FromFile(const double* plain) {
    if (!AllFinite(plain, 10)) return std::nullopt;
    const std::optional<Eigen::Vector4d> q = QuaternionFromFile(plain);
    if (!q) return std::nullopt;
    Params g;
    g.head<4>() = *q;
    for (int i = 0; i < 6; ++i) g[4 + i] = plain[4 + i];
    for (int axis = 0; axis < 3; ++axis) {
      if (!(g[4 + 2 * axis] + g[5 + 2 * axis] < 0.0)) return std::nullopt;
    }
    return g;
  }

  template <typename T>
  static void ToFile(const T* g, T* plain) {
    QuaternionToFile(g, plain);
    std::copy(g + 4, g + 10, plain + 4);
  }

  // Centre, where the middle planes of opposite faces meet.
  static Eigen::Vector3d Centre(const double* g) {
    const double* w = g + 4;
    return RotationFromXyzw(g) *
           Eigen::Vector3d(0.5 * (w[1] - w[0]), 0.5 * (w[3] - w[2]), 0.5 * (w[5] - w[4]));
  }

  // Face with the smallest |n_i.x + w_i|, the first of equals; faces count as unbounded planes.
  static int NearestFace(const double* g, const Eigen::Vector3d& X) {
    const Eigen::Vector3d local = RotationFromXyzw(g).transpose() * X;
    int nearest = 0;
    double nearest_distance = std::numeric_limits<double>::infinity();
    for (int face = 0; face < 6; ++face) {
      const double along = face % 2 == 0 ? local[face / 2] : -local[face / 2];
      const double distance = std::abs(along + g[4 + face]);
      if (distance < nearest_distance) {
        nearest = face;
        nearest_distance = distance;
      }
    }
    return nearest;
  }

  // The face nearest to the point of the infinite line that is nearest to the centre.
  static int NearestFace(const double* g, const PlueckerLine& line) {
    return NearestFace(g, line.ClosestPoint(Centre(g)));
  }

  template <typename T>
  static std::optional<Vector3<T>> ProjectPoint(const T* g, const Vector3<T>& X) {
    const int face = NearestFace(Values(g).data(), ValueOfVector(X));
    return Plane::PointOnto(Normal(g, face), g[4 + face], X);
  }

  static std::optional<Eigen::Vector3d> ProjectPointWithJacobian(const double* g,
                                                                 const Eigen::Vector3d& X,
                                                                 double* d_point, double* d_group) {
    const int face = NearestFace(g, X);
    const Eigen::Vector3d n = Normal(g, face);
    const double distance = n.dot(X) + g[4 + face];
    Eigen::Map<RowMajor<3, 3>>{d_point} = Eigen::Matrix3d::Identity() - n * n.transpose();
    RowMajor<3, 3> by_normal = -n * X.transpose();
    for (int i = 0; i < 3; ++i) by_normal(i, i) -= distance;
    Eigen::Map<RowMajor<3, 10>> by_group(d_group);
    by_group.leftCols<4>() = ByQuaternion<3>(by_normal * -CrossMatrix(n), g);
    by_group.rightCols<6>().setZero();
    by_group.col(4 + face) = -n;
    return Eigen::Vector3d(X - distance * n);
  }

  // As Plane, on the face that NearestFace says. Fails for a line along that face's normal.
  template <typename T>
  static std::optional<std::pair<Vector3<T>, Vector3<T>>> ProjectLine(const T* g,
                                                                      const Vector3<T>& d,
                                                                      const Vector3<T>& m) {
    const int face =
        NearestFace(Values(g).data(), PlueckerLine{ValueOfVector(d), ValueOfVector(m)});
    return Plane::LineOnto(Normal(g, face), g[4 + face], d, m);
  }

  static std::optional<Vector6d> ProjectLineWithJacobian(const double* g, const Eigen::Vector3d& d,
                                                         const Eigen::Vector3d& m, double* d_line,
                                                         double* d_group) {
    const int face = NearestFace(g, PlueckerLine{d, m});
    const Eigen::Vector3d n = Normal(g, face);
    RowMajor<6, 3> by_normal;
    Vector6d by_offset;
    const std::optional<Vector6d> projected =
        Plane::LineOntoWithJacobian(n, g[4 + face], d, m, d_line, &by_normal, &by_offset);
    if (!projected) return std::nullopt;
    Eigen::Map<RowMajor<6, 10>> by_group(d_group);
    by_group.leftCols<4>() = ByQuaternion<6>(by_normal * -CrossMatrix(n), g);
    by_group.rightCols<6>().setZero();
    by_group.col(4 + face) = by_offset;
    return projected;
  }

  // See fit_box.h; faces without features end where the features end.
  static std::optional<Params> FitMinimal(std::span<const Eigen::Vector3d> points,
                                          std::span<const PlueckerLine> lines) {
    const std::optional<Box> box = FitBox(points, lines);
    if (!box) return std::nullopt;
    Params g;
    g << box->rotation.coeffs(), box->offsets;
    return g;
  }

  template <typename T>
  static GroupParams<T, Manifold> Transform(const Sim3d& new_from_old, const T* g) {
    GroupParams<T, Manifold> result;
    const Eigen::Quaternion<T> q(g[3], g[0], g[1], g[2]);
    result.template head<4>() = (new_from_old.rotation.cast<T>() * q).normalized().coeffs();
    for (int face = 0; face < 6; ++face) {
      result[4 + face] = new_from_old.scale * g[4 + face] -
                         Normal(result.data(), face).dot(new_from_old.translation.cast<T>());
    }
    return result;
  }

  static std::vector<Params> Examples() {
    const auto make = [](const Eigen::Vector3d& rotation, const Eigen::Vector3d& centre,
                         const Eigen::Vector3d& half_sizes) {
      Params g;
      const Eigen::Quaterniond q = ExpRotation(rotation).normalized();
      const Eigen::Vector3d local = q.conjugate() * centre;
      g.head<4>() = q.coeffs();
      for (int axis = 0; axis < 3; ++axis) {
        g[4 + 2 * axis] = -local[axis] - half_sizes[axis];
        g[5 + 2 * axis] = local[axis] - half_sizes[axis];
      }
      return g;
    };
    return {make({0, 0, 0}, {0, 0, 0}, {1, 1.5, 2}),
            make({0.3, -0.8, 1.9}, {2, -1, 4}, {3, 0.8, 1.4}),
            make({-1.2, 0.4, 0.1}, {2500, -800, 3100}, {0.05, 0.03, 0.04}),
            make({2.1, 1.3, -0.7}, {-5, 3, 1}, {3e4, 2e4, 5e4}),
            make({0.1, 0.2, 0.3}, {0.1, 0.2, 0.3}, {3e-6, 2e-6, 2.5e-6})};
  }

  static GroupMesh Mesh(const double* g, std::span<const Eigen::Vector3d> member_points) {
    GroupMesh mesh;
    const Eigen::Matrix3d R = RotationFromXyzw(g);
    for (int corner = 0; corner < 8; ++corner) {
      Eigen::Vector3d local;
      for (int axis = 0; axis < 3; ++axis) {
        local[axis] = (corner >> axis) & 1 ? -g[4 + 2 * axis] : g[5 + 2 * axis];
      }
      mesh.vertices.push_back(R * local);
    }
    // Bit k of a corner: on the positive face of axis k.
    mesh.triangles = {{1, 3, 7}, {1, 7, 5}, {0, 4, 6}, {0, 6, 2}, {2, 6, 7}, {2, 7, 3},
                      {0, 1, 5}, {0, 5, 4}, {4, 5, 7}, {4, 7, 6}, {0, 2, 3}, {0, 3, 1}};
    return mesh;
  }

 private:
  template <typename T>
  static std::array<double, Manifold::kAmbient> Values(const T* g) {
    std::array<double, Manifold::kAmbient> values;
    for (int i = 0; i < Manifold::kAmbient; ++i) values[i] = ValueOf(g[i]);
    return values;
  }
  template <typename T>
  static Eigen::Vector3d ValueOfVector(const Vector3<T>& v) {
    return {ValueOf(v[0]), ValueOf(v[1]), ValueOf(v[2])};
  }
  template <typename T>
  static Vector3<T> Normal(const T* g, int face) {
    const Vector3<T> column = RotationFromXyzw(g).col(face / 2);
    return face % 2 == 0 ? column : Vector3<T>(-column);
  }
};

}  // namespace holba
