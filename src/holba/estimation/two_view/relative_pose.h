// SPDX-License-Identifier: BSD-3-Clause
// Relative poses in essential matrices and homographies of rays, and the points that rays meet in.
// Translations have unit length.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "holba/estimation/two_view/matched_rays.h"
#include "holba/geometry/rigid3d.h"

namespace holba {

// K of a camera's ideal pixels.
Eigen::Matrix3d CalibrationMatrix(const Camera& camera);

// [t]x R of unit Frobenius norm, r2' E r1 = 0. Zero without a translation.
Eigen::Matrix3d EssentialMatrix(const Rigid3d& cam2_from_cam1);

// The four poses of an essential matrix.
std::vector<Rigid3d> PosesOfEssential(const Eigen::Matrix3d& E);

// The poses of a homography of rays of two calibrated cameras, H ~ R + t n'/d: up to 4 (Ma, Soatto,
// Kosecka, Sastry, An Invitation to 3-D Vision, 2004, section 5.3). One without translation if H is
// a rotation within `rotation_tolerance` (of its singular values, the middle one being 1).
std::vector<Rigid3d> PosesOfHomography(const Eigen::Matrix3d& H, double rotation_tolerance = 1e-3);

struct RayMeeting {
  double depth1 = 0.0, depth2 = 0.0;  // along the unit rays, in units of the translation
  double angle_deg = 0.0;             // between the rays, at the point
};
// Where two rays come closest. Empty: they are parallel.
std::optional<RayMeeting> MeetRays(const Rigid3d& cam2_from_cam1, const Eigen::Vector3d& ray1,
                                   const Eigen::Vector3d& ray2);

// Whether a pose can explain each match: the rays meet in front of both cameras, or are parallel
// within `max_error_px`, so that on which side they meet means nothing. Says nothing of their
// distance.
std::vector<uint8_t> AreInFront(const Rigid3d& cam2_from_cam1, const MatchedRays& matches,
                                double max_error_px);

struct ChosenPose {
  Rigid3d cam2_from_cam1;
  size_t num_in_front = 0;        // matches that meet in front of both cameras
  double median_angle_deg = 0.0;  // between their rays
};
// The pose for which most of the matches `subset` meet in front of both cameras. Empty: none does
// for any. Of a pose without translation all rays count whose directions agree within 90 degrees.
std::optional<ChosenPose> ChoosePose(const std::vector<Rigid3d>& poses, const MatchedRays& matches,
                                     std::span<const uint32_t> subset);

}  // namespace holba
