// SPDX-License-Identifier: BSD-3-Clause
// Poses from minimal samples of sightings, with known intrinsics and with an unknown focal length.
#pragma once

#include <span>
#include <vector>

#include "holba/estimation/pose/pose_refinement.h"

namespace holba {

// Mean focal length over the longer side of the image.
double FocalLengthRatio(const Camera& camera, std::span<const double> params);

struct FocalLengthRange {
  double min_ratio, max_ratio;  // of FocalLengthRatio
};

// Appends the poses that three sightings have for these intrinsics.
void SolveThree(const PoseEvidence& evidence, std::span<const double> params,
                const FewSightings& three, std::vector<Rigid3d>* poses);

// Appends poses with focal lengths from four sightings, 8 equations for 7 unknowns. Three of them
// give poses for each of a ladder of focal lengths; where the fourth is best met along it, least
// squares of all four find the pose and the focal length. So the camera may have any model.
void SolveWithFocalLength(const PoseEvidence& evidence, const FewSightings& four,
                          const FocalLengthRange& range, std::vector<PoseUnknowns>* hypotheses);

}  // namespace holba
