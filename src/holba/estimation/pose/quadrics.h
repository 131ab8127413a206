// SPDX-License-Identifier: BSD-3-Clause
// Real points in which three quadrics of space meet: up to 8.
//
// With z hidden, x^2, y^2 and xy are linear in x, y and 1 over polynomials in z. That y x^2 = x
// (xy), x y^2 = y (xy) and x^2 y^2 = (xy)^2 gives three equations linear in (x, y, 1), whose
// determinant is a polynomial of degree 8 in z (Kukelova, Heller, Fitzgibbon, Efficient
// Intersection of Three Quadrics and Applications in Computer Vision, CVPR 2016). The points are
// improved by Newton's method.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

namespace holba {

// Coefficients of x^2, y^2, z^2, xy, xz, yz, x, y, z, 1.
using Quadric = std::array<double, 10>;

// Appends the points. Ones that many quadrics share (a curve) are not found.
void IntersectQuadrics(const std::array<Quadric, 3>& quadrics,
                       std::vector<Eigen::Vector3d>* points);

}  // namespace holba
