// SPDX-License-Identifier: BSD-3-Clause
// Unit direction of a group (of a vanishing point or an axis; the normal of a plane) by the tangent
// of its manifold.
#pragma once

#include "holba/residual/group_tangent.h"

namespace holba {

// Unit direction of a group and its derivative by the group's tangent.
struct GroupDirection {
  Eigen::Vector3d value;
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxGroupParams> d_tangent;

  GroupDirection(const GroupType& type, const double* g) {
    double d_group[3 * kMaxGroupParams];
    type.direction(g, &value, d_group);
    d_tangent = ByGroupTangent<3>(type, g, d_group);
  }
};

namespace internal {
// Writes rows x tangent row-major.
template <typename Derived>
void WriteJacobian(const Eigen::MatrixBase<Derived>& from, double* to) {
  for (int r = 0; r < from.rows(); ++r) {
    for (int c = 0; c < from.cols(); ++c) *to++ = from(r, c);
  }
}
}  // namespace internal

}  // namespace holba
