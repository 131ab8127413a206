// SPDX-License-Identifier: BSD-3-Clause
// Manifolds of the parameter blocks. A block holds kAmbient doubles and moves by kTangent: x' = x [+] d.
// PlusJacobian(x): d(x [+] d)/dd at d = 0, kAmbient x kTangent. MinusJacobian(x): d(y [-] x)/dy at y = x,
// kTangent x kAmbient, so that MinusJacobian * PlusJacobian = identity. All Jacobians row-major.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {

template <int N>
struct Euclidean {
  static constexpr int kAmbient = N;
  static constexpr int kTangent = N;
  static void Plus(const double* x, const double* delta, double* out) {
    for (int i = 0; i < N; ++i) out[i] = x[i] + delta[i];
  }
  static void Minus(const double* y, const double* x, double* delta) {
    for (int i = 0; i < N; ++i) delta[i] = y[i] - x[i];
  }
  static void PlusJacobian(const double*, double* jacobian) {
    Eigen::Map<RowMajor<N, N>>(jacobian).setIdentity();
  }
  static void MinusJacobian(const double*, double* jacobian) {
    Eigen::Map<RowMajor<N, N>>(jacobian).setIdentity();
  }
};

// Two orthonormal vectors perpendicular to unit v, as columns (Duff et al. 2017).
inline Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  const double sign = std::copysign(1.0, v.z());
  const double a = -1.0 / (sign + v.z());
  const double b = v.x() * v.y() * a;
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) << 1.0 + sign * v.x() * v.x() * a, sign * b, -sign * v.x();
  basis.col(1) << b, sign + v.y() * v.y() * a, -v.y();
  return basis;
}

// Unit vector in R^3 (2 dof): along the geodesic of tangent vector TangentBasis(v) * delta.
struct UnitVector3 {
  static constexpr int kAmbient = 3;
  static constexpr int kTangent = 2;
  static void Plus(const double* x, const double* delta, double* out) {
    const Eigen::Vector3d v(x[0], x[1], x[2]);
    const Eigen::Vector3d step = TangentBasis(v) * Eigen::Vector2d(delta[0], delta[1]);
    const double angle = step.norm();
    const double k = angle > 1e-8 ? std::sin(angle) / angle : 1.0 - angle * angle / 6.0;
    Eigen::Map<Eigen::Vector3d>{out} = (std::cos(angle) * v + k * step).normalized();
  }
  static void Minus(const double* y, const double* x, double* delta) {
    const Eigen::Vector3d v(x[0], x[1], x[2]), w(y[0], y[1], y[2]);
    const Eigen::Vector2d t = TangentBasis(v).transpose() * w;
    const double s = t.norm();
    const double angle = std::atan2(s, v.dot(w));
    Eigen::Map<Eigen::Vector2d>{delta} = (s > 1e-12 ? angle / s : 1.0) * t;
  }
  static void PlusJacobian(const double* x, double* jacobian) {
    Eigen::Map<RowMajor<3, 2>>{jacobian} = TangentBasis(Eigen::Vector3d(x[0], x[1], x[2]));
  }
  static void MinusJacobian(const double* x, double* jacobian) {
    Eigen::Map<RowMajor<2, 3>>{jacobian} =
        TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])).transpose();
  }
};

// Unit quaternion [x y z w] (3 dof): q' = exp(delta) q, delta a rotation vector in the rotated frame.
struct UnitQuaternion {
  static constexpr int kAmbient = 4;
  static constexpr int kTangent = 3;
  static void Plus(const double* x, const double* delta, double* out) {
    const Eigen::Quaterniond q(x[3], x[0], x[1], x[2]);
    const Eigen::Quaterniond moved =
        (ExpRotation(Eigen::Vector3d(delta[0], delta[1], delta[2])) * q).normalized();
    Eigen::Map<Eigen::Vector4d>{out} = moved.coeffs();
  }
  static void Minus(const double* y, const double* x, double* delta) {
    const Eigen::Quaterniond p(y[3], y[0], y[1], y[2]), q(x[3], x[0], x[1], x[2]);
    Eigen::Map<Eigen::Vector3d>{delta} = LogRotation(p * q.conjugate());
  }
  // d(exp(delta) q)/d delta = 1/2 [delta; 0] (x) q.
  static void PlusJacobian(const double* q, double* jacobian) {
    Eigen::Map<RowMajor<4, 3>> J(jacobian);
    J << q[3], q[2], -q[1], -q[2], q[3], q[0], q[1], -q[0], q[3], -q[0], -q[1], -q[2];
    J *= 0.5;
  }
  static void MinusJacobian(const double* q, double* jacobian) {
    RowMajor<4, 3> plus;
    PlusJacobian(q, plus.data());
    Eigen::Map<RowMajor<3, 4>>{jacobian} = 4.0 * plus.transpose();
  }
};

// A then B, side by side.
template <typename A, typename... Rest>
struct Product {
  using B = Product<Rest...>;
  static constexpr int kAmbient = A::kAmbient + B::kAmbient;
  static constexpr int kTangent = A::kTangent + B::kTangent;
  static void Plus(const double* x, const double* delta, double* out) {
    A::Plus(x, delta, out);
    B::Plus(x + A::kAmbient, delta + A::kTangent, out + A::kAmbient);
  }
  static void Minus(const double* y, const double* x, double* delta) {
    A::Minus(y, x, delta);
    B::Minus(y + A::kAmbient, x + A::kAmbient, delta + A::kTangent);
  }
  static void PlusJacobian(const double* x, double* jacobian) {
    RowMajor<A::kAmbient, A::kTangent> a;
    RowMajor<B::kAmbient, B::kTangent> b;
    A::PlusJacobian(x, a.data());
    B::PlusJacobian(x + A::kAmbient, b.data());
    Eigen::Map<RowMajor<kAmbient, kTangent>> J(jacobian);
    J.setZero();
    J.template topLeftCorner<A::kAmbient, A::kTangent>() = a;
    J.template bottomRightCorner<B::kAmbient, B::kTangent>() = b;
  }
  static void MinusJacobian(const double* x, double* jacobian) {
    RowMajor<A::kTangent, A::kAmbient> a;
    RowMajor<B::kTangent, B::kAmbient> b;
    A::MinusJacobian(x, a.data());
    B::MinusJacobian(x + A::kAmbient, b.data());
    Eigen::Map<RowMajor<kTangent, kAmbient>> J(jacobian);
    J.setZero();
    J.template topLeftCorner<A::kTangent, A::kAmbient>() = a;
    J.template bottomRightCorner<B::kTangent, B::kAmbient>() = b;
  }
};
template <typename A>
struct Product<A> : A {};

// Pose [qx qy qz qw tx ty tz] of x' = R x + t (6 dof): R' = exp(delta[0..2]) R, t' = t + delta[3..5].
using PoseManifold = Product<UnitQuaternion, Euclidean<3>>;

// Line [d p], d unit, p a point on it (4 dof): d moves on the sphere, p perpendicular to d.
struct LineManifold {
  static constexpr int kAmbient = 6;
  static constexpr int kTangent = 4;
  static void Plus(const double* x, const double* delta, double* out) {
    const Eigen::Vector3d p(x[3], x[4], x[5]);
    const Eigen::Vector3d step =
        TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])) * Eigen::Vector2d(delta[2], delta[3]);
    UnitVector3::Plus(x, delta, out);
    Eigen::Map<Eigen::Vector3d>{out + 3} = p + step;
  }
  static void Minus(const double* y, const double* x, double* delta) {
    UnitVector3::Minus(y, x, delta);
    const Eigen::Vector3d moved(y[3] - x[3], y[4] - x[4], y[5] - x[5]);
    Eigen::Map<Eigen::Vector2d>{delta + 2} =
        TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])).transpose() * moved;
  }
  static void PlusJacobian(const double* x, double* jacobian) {
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(Eigen::Vector3d(x[0], x[1], x[2]));
    Eigen::Map<RowMajor<6, 4>> J(jacobian);
    J.setZero();
    J.topLeftCorner<3, 2>() = basis;
    J.bottomRightCorner<3, 2>() = basis;
  }
  static void MinusJacobian(const double* x, double* jacobian) {
    RowMajor<6, 4> plus;
    PlusJacobian(x, plus.data());
    Eigen::Map<RowMajor<4, 6>>{jacobian} = plus.transpose();
  }
};

// A manifold as data, for those that handle blocks of any kind.
struct ManifoldOps {
  int ambient;
  int tangent;
  void (*plus)(const double* x, const double* delta, double* out);
  void (*minus)(const double* y, const double* x, double* delta);
  void (*plus_jacobian)(const double* x, double* jacobian);
  void (*minus_jacobian)(const double* x, double* jacobian);
};

template <typename M>
const ManifoldOps& OpsOf() {
  static constexpr ManifoldOps ops{M::kAmbient, M::kTangent,      &M::Plus,
                                   &M::Minus,   &M::PlusJacobian, &M::MinusJacobian};
  return ops;
}

// Euclidean<size>, size in [1, 16].
const ManifoldOps& EuclideanOps(int size);

}  // namespace holba
