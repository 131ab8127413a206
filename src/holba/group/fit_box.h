// SPDX-License-Identifier: BSD-3-Clause
// Cuboid through points and lines of its faces, without knowing which feature belongs to which
// face.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>

#include "holba/geometry/line.h"

namespace holba {

// Faces as in FORMAT.md: outward normals +R0 -R0 +R1 -R1 +R2 -R2, n_i.x + w_i = 0.
struct Box {
  Eigen::Quaterniond rotation;  // local -> world
  Eigen::Matrix<double, 6, 1> offsets;
};

// A cuboid has 9 unknowns; a point gives one equation, a line two.
inline constexpr int kMinBoxPoints = 9, kMinBoxLines = 5;

// Least squares of the distances to the nearest faces. Needs num_points + 2 num_lines >= 9. As few
// as that leave several boxes, of which one is returned; a box is certain where three orthogonal
// faces show, of which one has 4 points (or two lines), another 3, the third 2, among some 20
// features. Features bound the box: a face that has none ends where the points, and the lines
// parallel to an edge, end. Lines count as infinite, and within 2 degrees of an edge as parallel to
// it, unless the features contradict. Empty: no box.
std::optional<Box> FitBox(std::span<const Eigen::Vector3d> points,
                          std::span<const PlueckerLine> lines);

}  // namespace holba
