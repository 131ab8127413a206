// SPDX-License-Identifier: BSD-3-Clause
// Two-view models from as few matches as determine them. Rays of any length; of pixels (x, y, 1) in
// a unit that makes them about 1. Every solver appends its solutions, of unit Frobenius norm, and
// appends none where the matches determine none.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace holba {

using Rays = std::span<const Eigen::Vector3d>;

// Up to 10 essential matrices, r2' E r1 = 0, from 5 matches (Nister, An efficient solution to the
// five-point relative pose problem, PAMI 2004). Not checked: on which side of the cameras the
// points are.
void SolveEssential(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions);

// Up to 3 fundamental matrices, r2' F r1 = 0, det F = 0, from 7 matches (Hartley and Zisserman,
// Multiple View Geometry, 2003, section 11.1.2).
void SolveFundamental(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions);

// The homography, r2 ~ H r1 with positive factors, from 4 matches. None if three rays of one side
// are in a plane or a factor would be negative: no camera sees the plane through these points from
// one side in both images.
void SolveHomography(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions);

}  // namespace holba
