// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/symmetric_solve.h"

namespace holba {

template Eigen::Matrix<double, 3, 1> SolveSymmetric<3>(const Eigen::Matrix<double, 3, 3>&,
                                                       const Eigen::Matrix<double, 3, 1>&);
template Eigen::Matrix<double, 4, 1> SolveSymmetric<4>(const Eigen::Matrix<double, 4, 4>&,
                                                       const Eigen::Matrix<double, 4, 1>&);
template Eigen::Matrix<double, 5, 1> SolveSymmetric<5>(const Eigen::Matrix<double, 5, 5>&,
                                                       const Eigen::Matrix<double, 5, 1>&);
template Eigen::Matrix<double, 6, 1> SolveSymmetric<6>(const Eigen::Matrix<double, 6, 6>&,
                                                       const Eigen::Matrix<double, 6, 1>&);
template Eigen::Matrix<double, 9, 1> SolveSymmetric<9>(const Eigen::Matrix<double, 9, 9>&,
                                                       const Eigen::Matrix<double, 9, 1>&);

}  // namespace holba
