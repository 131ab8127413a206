// SPDX-License-Identifier: BSD-3-Clause
// The other half of the chain rule: derivatives by the tangent of a group's manifold, whatever the
// type.
#pragma once

#include "holba/group/group_type.h"

namespace holba {

// d(...)/d(tangent) = d(...)/d(g) * PlusJacobian(g). rows x tangent, column-major storage of at
// most 6 x 16.
template <int Rows>
Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, Rows, kMaxGroupParams> ByGroupTangent(
    const GroupType& type, const double* g, const double* d_group) {
  using Dynamic = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor,
                                kMaxGroupParams, kMaxGroupParams>;
  Dynamic plus(type.manifold->ambient, type.manifold->tangent);
  type.manifold->plus_jacobian(g, plus.data());
  const Eigen::Map<const Eigen::Matrix<double, Rows, Eigen::Dynamic, Eigen::RowMajor>> d(
      d_group, Rows, type.manifold->ambient);
  return d.lazyProduct(plus);
}

}  // namespace holba
