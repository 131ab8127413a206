// SPDX-License-Identifier: BSD-3-Clause
// wireframe_3d: r = (I - d d^T)(X - p), from line to point, model units, R^3. Blocks: point, line:
// two features, so one of them must be kept. Always present. A 3D form that the paper argues
// against, for comparison only: it needs a weight and changes with the scale of the scene.
#pragma once

#include "holba/geometry/manifold.h"
#include "holba/geometry/types.h"

namespace holba {

struct Wireframe3dResidual {
  static constexpr int kDim = 3;
  struct Datum {};

  bool Evaluate(const Datum&, const double* const* values, double* residual,
                double* const* jacobians) const {
    const Eigen::Map<const Eigen::Vector3d> X(values[0]);
    const Eigen::Vector3d d(values[1][0], values[1][1], values[1][2]);
    const Eigen::Vector3d p(values[1][3], values[1][4], values[1][5]);
    const Eigen::Vector3d v = X - p;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    Eigen::Map<Eigen::Vector3d>{residual} = across * v;
    if (jacobians[0]) Eigen::Map<RowMajor<3, 3>>{jacobians[0]} = across;
    if (jacobians[1]) {
      const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
      Eigen::Map<RowMajor<3, 4>> J(jacobians[1]);
      J.leftCols<2>() = -(d.dot(v) * Eigen::Matrix3d::Identity() + d * v.transpose()) * basis;
      J.rightCols<2>() = -across * basis;
    }
    return true;
  }
};

}  // namespace holba
