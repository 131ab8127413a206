// SPDX-License-Identifier: BSD-3-Clause
// Linear least squares by the QR decomposition with column pivoting of Eigen, whose templates take
// seconds to compile: here they are compiled once.
#pragma once

#include <Eigen/Core>

namespace holba {

// X (n x k) of least |A X - B| for A (m x n, m >= n) and B (m x k); not finite, or any of several,
// where the columns of A depend on each other.
Eigen::MatrixXd LeastSquares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

}  // namespace holba
