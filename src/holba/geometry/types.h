// SPDX-License-Identifier: BSD-3-Clause
// Fixed-size Eigen types, templated on the scalar (double, Dual<N>).
#pragma once

#include <Eigen/Core>

namespace holba {

template <typename T>
using Vector2 = Eigen::Matrix<T, 2, 1>;
template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
template <int Rows, int Cols>
using RowMajor = Eigen::Matrix<double, Rows, Cols, (Cols == 1) ? Eigen::ColMajor : Eigen::RowMajor>;

// [v]_x with [v]_x w = v x w.
template <typename T>
Matrix3<T> CrossMatrix(const Vector3<T>& v) {
  Matrix3<T> m;
  m << T(0), -v.z(), v.y(), v.z(), T(0), -v.x(), -v.y(), v.x(), T(0);
  return m;
}

}  // namespace holba
