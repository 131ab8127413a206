// SPDX-License-Identifier: BSD-3-Clause
// Poses from three points: their distances d_i from the camera's centre along unit rays r_i have
//   d_i^2 + d_j^2 - 2 (r_i . r_j) d_i d_j = |X_i - X_j|^2,
// of which two combinations without a constant are conics in (d_1 : d_2 : d_3). A singular conic of
// their pencil (a root of a cubic) is two lines, and each meets the conics in up to two points
// (Ding, Yang, Larsson, Olsson, Astrom, Revisiting the P3P Problem, CVPR 2023). The distances are
// then improved by Newton's method on the three equations.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "holba/geometry/rigid3d.h"

namespace holba {

// Appends up to 4 poses cam_from_world that have the points (world) on the unit rays, in front of
// the camera. None: the points lie on a line, or no such pose exists.
void SolveP3P(const std::array<Eigen::Vector3d, 3>& rays,
              const std::array<Eigen::Vector3d, 3>& points, std::vector<Rigid3d>* poses);

}  // namespace holba
