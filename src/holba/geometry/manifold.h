// SPDX-License-Identifier: BSD-3-Clause
// Manifolds of the parameter blocks. A block holds kAmbient doubles and moves by kTangent: x' = x
// [+] d. PlusJacobian(x): d(x [+] d)/dd at d = 0, kAmbient x kTangent. MinusJacobian(x): d(y [-]
// x)/dy at y = x, kTangent x kAmbient, so that MinusJacobian * PlusJacobian = identity. All
// Jacobians row-major.
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
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v);

// The manifolds that are no templates are compiled once, in manifold.cc.

// Unit vector in R^3 (2 dof): along the geodesic of tangent vector TangentBasis(v) * delta.
struct UnitVector3 {
  static constexpr int kAmbient = 3;
  static constexpr int kTangent = 2;
  static void Plus(const double* x, const double* delta, double* out);
  static void Minus(const double* y, const double* x, double* delta);
  static void PlusJacobian(const double* x, double* jacobian);
  static void MinusJacobian(const double* x, double* jacobian);
};

// Unit quaternion [x y z w] (3 dof): q' = exp(delta) q, delta a rotation vector in the rotated
// frame.
struct UnitQuaternion {
  static constexpr int kAmbient = 4;
  static constexpr int kTangent = 3;
  static void Plus(const double* x, const double* delta, double* out);
  static void Minus(const double* y, const double* x, double* delta);
  // d(exp(delta) q)/d delta = 1/2 [delta; 0] (x) q.
  static void PlusJacobian(const double* q, double* jacobian);
  static void MinusJacobian(const double* q, double* jacobian);
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

// Pose [qx qy qz qw tx ty tz] of x' = R x + t (6 dof): R' = exp(delta[0..2]) R, t' = t +
// delta[3..5].
using PoseManifold = Product<UnitQuaternion, Euclidean<3>>;

// Line [d p], d unit, p a point on it (4 dof): d moves on the sphere, p perpendicular to d.
struct LineManifold {
  static constexpr int kAmbient = 6;
  static constexpr int kTangent = 4;
  static void Plus(const double* x, const double* delta, double* out);
  static void Minus(const double* y, const double* x, double* delta);
  static void PlusJacobian(const double* x, double* jacobian);
  static void MinusJacobian(const double* x, double* jacobian);
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
