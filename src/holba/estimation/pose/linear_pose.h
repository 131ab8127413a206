// SPDX-License-Identifier: BSD-3-Clause
// Poses from few points and lines. What is seen of a feature lies in planes through the camera's
// centre, n . (R Y + t) = 0: a point in two planes that meet in its ray, a line in the plane of its
// segment, in which its direction lies as well, n . R d = 0. Without t there are three equations
// linear in R for three features, quadrics in its Cayley parameters s,
//   (1 + s's) R = (1 - s's) I + 2 [s]x + 2 s s',
// whatever the kinds are: P2P1L, P1P2L, P3L (Zhou, Ye, Kaess, A Stable Algebraic Camera Pose
// Estimation for Minimal Configurations of 2D/3D Point and Line Correspondences, ACCV 2018). With a
// rotation from two directions, t is linear.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/geometry/rigid3d.h"

namespace holba {

struct SeenPoint {
  Eigen::Vector3d ray;  // camera, unit
  Eigen::Vector3d X;    // world
};
struct SeenLine {
  Eigen::Vector3d normal;  // camera, unit: of the plane through the centre and the segment
  PlueckerLine line;       // world
};

// Appends up to 8 poses cam_from_world of three features, of which at least one is a line. Nothing
// says on which side of the camera they are. `turn`: any rotation; poses whose rotation differs by
// half a turn from it are not found, so that trials should differ in it.
void SolvePointsAndLines(std::span<const SeenPoint> points, std::span<const SeenLine> lines,
                         const Eigen::Quaterniond& turn, std::vector<Rigid3d>* poses);

// The translation for a rotation, by least squares: two points, a point and a line, or three lines
// determine it. Empty: these do not.
std::optional<Eigen::Vector3d> SolveTranslation(const Eigen::Quaterniond& rotation,
                                                std::span<const SeenPoint> points,
                                                std::span<const SeenLine> lines);

// Appends the rotations cam_from_world that take two directions of the world to two of the camera,
// none of them with a sign: 4 where both pairs are at right angles, else 2. None: a pair is nearly
// parallel, or the angles differ by more than `max_angle_error` (rad), which is shared by both.
void SolveRotation(const Eigen::Vector3d& a_in_cam, const Eigen::Vector3d& b_in_cam,
                   const Eigen::Vector3d& a_in_world, const Eigen::Vector3d& b_in_world,
                   double max_angle_error, std::vector<Eigen::Quaterniond>* rotations);

}  // namespace holba
