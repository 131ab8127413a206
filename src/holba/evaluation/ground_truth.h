// SPDX-License-Identifier: BSD-3-Clause
// Errors of a model against a true model of the same scene, after a similarity alignment of the
// model to the truth. Images are paired by name, features by their ids where these mean the same in
// both (image_pairing.h). Lengths are in the truth's units.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "holba/evaluation/alignment.h"
#include "holba/evaluation/image_pairing.h"
#include "holba/evaluation/statistics.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Each is empty if the two models have nothing of that kind in common.
struct GroundTruthErrors {
  std::optional<ErrorStats> rotation_deg;        // of the cameras
  std::optional<ErrorStats> position;            // of the camera centres
  std::optional<ErrorStats> point;               // of the 3D points
  std::optional<ErrorStats> line_direction_deg;  // unsigned
  std::optional<ErrorStats> line_distance;     // of the line from the midpoint of the true segment
  std::optional<ErrorStats> plane_normal_deg;  // unsigned
  // Of the plane from the centroid of the true plane's member points and segment ends (of a plane
  // without members: from the foot of the true plane).
  std::optional<ErrorStats> plane_offset;
  // Other groups, by "TYPE quantity": those of group_comparison.h, and "surface", the distance of
  // true member points from the model's surface.
  std::map<std::string, ErrorStats> groups;
  Alignment alignment;

  // Flat names and values of all that is present: "rotation_rms_deg", "rotation_median_deg",
  // "position_rms", "point_median", "SPHERE centre_rms", ...
  std::vector<std::pair<std::string, double>> Named() const;
};

// The default aligns camera centres and points together if both models share at least 3 points:
// centres alone leave the rotation about a straight trajectory open. Empty: no image in common.
std::optional<GroundTruthErrors> CompareToTruth(const Reconstruction& model,
                                                const Reconstruction& truth,
                                                AlignmentBasis basis = AlignmentBasis::kAuto);
std::optional<GroundTruthErrors> CompareToTruth(const Reconstruction& model,
                                                const Reconstruction& truth,
                                                const ImagePairing& pairing, AlignmentBasis basis);

// The same without an alignment of its own.
GroundTruthErrors CompareToTruth(const Reconstruction& model, const Reconstruction& truth,
                                 const Sim3d& truth_from_model);

}  // namespace holba
