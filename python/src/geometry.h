// SPDX-License-Identifier: BSD-3-Clause
// Rotations as Python has them.
#pragma once

#include "arrays.h"
#include "holba/geometry/rigid3d.h"

namespace holba::python {

// A quaternion [x y z w] of any length but 0, or a rotation matrix. Raises ValueError.
Eigen::Quaterniond RotationFrom(nb::handle rotation);

}  // namespace holba::python
