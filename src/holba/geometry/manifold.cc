// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/manifold.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "holba/base/check.h"

namespace holba {

Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  const double sign = std::copysign(1.0, v.z());
  const double a = -1.0 / (sign + v.z());
  const double b = v.x() * v.y() * a;
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) << 1.0 + sign * v.x() * v.x() * a, sign * b, -sign * v.x();
  basis.col(1) << b, sign + v.y() * v.y() * a, -v.y();
  return basis;
}

void UnitVector3::Plus(const double* x, const double* delta, double* out) {
  const Eigen::Vector3d v(x[0], x[1], x[2]);
  const Eigen::Vector3d step = TangentBasis(v) * Eigen::Vector2d(delta[0], delta[1]);
  const double angle = step.norm();
  const double k = angle > 1e-8 ? std::sin(angle) / angle : 1.0 - angle * angle / 6.0;
  Eigen::Map<Eigen::Vector3d>{out} = (std::cos(angle) * v + k * step).normalized();
}

void UnitVector3::Minus(const double* y, const double* x, double* delta) {
  const Eigen::Vector3d v(x[0], x[1], x[2]), w(y[0], y[1], y[2]);
  const Eigen::Vector2d t = TangentBasis(v).transpose() * w;
  const double s = t.norm();
  const double angle = std::atan2(s, v.dot(w));
  Eigen::Map<Eigen::Vector2d>{delta} = (s > 1e-12 ? angle / s : 1.0) * t;
}

void UnitVector3::PlusJacobian(const double* x, double* jacobian) {
  Eigen::Map<RowMajor<3, 2>>{jacobian} = TangentBasis(Eigen::Vector3d(x[0], x[1], x[2]));
}

void UnitVector3::MinusJacobian(const double* x, double* jacobian) {
  Eigen::Map<RowMajor<2, 3>>{jacobian} =
      TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])).transpose();
}

void UnitQuaternion::Plus(const double* x, const double* delta, double* out) {
  const Eigen::Quaterniond q(x[3], x[0], x[1], x[2]);
  const Eigen::Quaterniond moved =
      (ExpRotation(Eigen::Vector3d(delta[0], delta[1], delta[2])) * q).normalized();
  Eigen::Map<Eigen::Vector4d>{out} = moved.coeffs();
}

void UnitQuaternion::Minus(const double* y, const double* x, double* delta) {
  const Eigen::Quaterniond p(y[3], y[0], y[1], y[2]), q(x[3], x[0], x[1], x[2]);
  Eigen::Map<Eigen::Vector3d>{delta} = LogRotation(p * q.conjugate());
}

void UnitQuaternion::PlusJacobian(const double* q, double* jacobian) {
  Eigen::Map<RowMajor<4, 3>> J(jacobian);
  J << q[3], q[2], -q[1], -q[2], q[3], q[0], q[1], -q[0], q[3], -q[0], -q[1], -q[2];
  J *= 0.5;
}

void UnitQuaternion::MinusJacobian(const double* q, double* jacobian) {
  RowMajor<4, 3> plus;
  PlusJacobian(q, plus.data());
  Eigen::Map<RowMajor<3, 4>>{jacobian} = 4.0 * plus.transpose();
}

void LineManifold::Plus(const double* x, const double* delta, double* out) {
  const Eigen::Vector3d p(x[3], x[4], x[5]);
  const Eigen::Vector3d step =
      TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])) * Eigen::Vector2d(delta[2], delta[3]);
  UnitVector3::Plus(x, delta, out);
  Eigen::Map<Eigen::Vector3d>{out + 3} = p + step;
}

void LineManifold::Minus(const double* y, const double* x, double* delta) {
  UnitVector3::Minus(y, x, delta);
  const Eigen::Vector3d moved(y[3] - x[3], y[4] - x[4], y[5] - x[5]);
  Eigen::Map<Eigen::Vector2d>{delta + 2} =
      TangentBasis(Eigen::Vector3d(x[0], x[1], x[2])).transpose() * moved;
}

void LineManifold::PlusJacobian(const double* x, double* jacobian) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(Eigen::Vector3d(x[0], x[1], x[2]));
  Eigen::Map<RowMajor<6, 4>> J(jacobian);
  J.setZero();
  J.topLeftCorner<3, 2>() = basis;
  J.bottomRightCorner<3, 2>() = basis;
}

void LineManifold::MinusJacobian(const double* x, double* jacobian) {
  RowMajor<6, 4> plus;
  PlusJacobian(x, plus.data());
  Eigen::Map<RowMajor<4, 6>>{jacobian} = plus.transpose();
}

const ManifoldOps& EuclideanOps(int size) {
  constexpr int kLargest = 16;
  static const auto table = []<int... I>(std::integer_sequence<int, I...>) {
    return std::array<const ManifoldOps*, sizeof...(I)>{&OpsOf<Euclidean<I + 1>>()...};
  }(std::make_integer_sequence<int, kLargest>());
  HOLBA_CHECK_MSG(size >= 1 && size <= kLargest, std::to_string(size));
  return *table[size - 1];
}

}  // namespace holba
