// SPDX-License-Identifier: BSD-3-Clause
// x of A x = b for a small symmetric A, by the Cholesky decomposition with pivoting (L D L') of
// Eigen. Its templates take seconds for each size: the sizes below are compiled once, in
// symmetric_solve.cc, any other where it is used.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace holba {

template <int N>
Eigen::Matrix<double, N, 1> SolveSymmetric(const Eigen::Matrix<double, N, N>& A,
                                           const Eigen::Matrix<double, N, 1>& b) {
  return A.ldlt().solve(b);
}

extern template Eigen::Matrix<double, 3, 1> SolveSymmetric<3>(const Eigen::Matrix<double, 3, 3>&,
                                                              const Eigen::Matrix<double, 3, 1>&);
extern template Eigen::Matrix<double, 4, 1> SolveSymmetric<4>(const Eigen::Matrix<double, 4, 4>&,
                                                              const Eigen::Matrix<double, 4, 1>&);
extern template Eigen::Matrix<double, 5, 1> SolveSymmetric<5>(const Eigen::Matrix<double, 5, 5>&,
                                                              const Eigen::Matrix<double, 5, 1>&);
extern template Eigen::Matrix<double, 6, 1> SolveSymmetric<6>(const Eigen::Matrix<double, 6, 6>&,
                                                              const Eigen::Matrix<double, 6, 1>&);
extern template Eigen::Matrix<double, 9, 1> SolveSymmetric<9>(const Eigen::Matrix<double, 9, 9>&,
                                                              const Eigen::Matrix<double, 9, 1>&);

}  // namespace holba
