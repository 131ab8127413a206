// SPDX-License-Identifier: BSD-3-Clause
// Least-squares similarity between two reconstructions of one scene.
// Source: Umeyama, "Least-squares estimation of transformation parameters between two point
// patterns", PAMI 1991.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// The similarity that minimises sum |to_i - (s R from_i + t)|^2. Empty: fewer than 3 points, points
// of either set on one line (or in one place), or sets of different sizes.
std::optional<Sim3d> EstimateSimilarity(std::span<const Eigen::Vector3d> from,
                                        std::span<const Eigen::Vector3d> to);

enum class AlignmentBasis {
  kCentres,           // camera centres only
  kCentresAndPoints,  // each centre and each 3D point counts once
  // kCentresAndPoints if the models share at least 3 points, else kCentres. Centres alone leave the
  // rotation about a straight trajectory open, so shared points are the safer choice.
  kAuto,
};

// truth_from_model from the images (and points) whose ids both models have. Where their positions
// leave the rotation open (fewer than 3, or all on one line), it is the mean of the images'
// relative rotations; where they leave the scale open (one image), the scale is 1. Empty: no image
// in common.
std::optional<Sim3d> AlignReconstructions(const Reconstruction& model, const Reconstruction& truth,
                                          AlignmentBasis basis = AlignmentBasis::kAuto);

}  // namespace holba
