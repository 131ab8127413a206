// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/least_squares.h"

#include <Eigen/QR>

namespace holba {

Eigen::MatrixXd LeastSquares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return A.colPivHouseholderQr().solve(B);
}

}  // namespace holba
