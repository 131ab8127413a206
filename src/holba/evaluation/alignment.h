// SPDX-License-Identifier: BSD-3-Clause
// Similarity between two reconstructions of one scene: least squares over what is not far off.
// Source: Umeyama, "Least-squares estimation of transformation parameters between two point
// patterns", PAMI 1991; Rousseeuw, "Least median of squares regression", JASA 1984, with the steps
// of concentration of Rousseeuw and Van Driessen, "Computing LTS regression for large data sets",
// 2006.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>

#include "holba/evaluation/image_pairing.h"
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

struct Alignment {
  Sim3d truth_from_model;
  size_t num_positions = 0;  // centres and points that both models have
  size_t num_left_out =
      0;  // of these, how many are too far off to say anything about the alignment
};

// The least-squares similarity of the images of the pairing (and, by ids, of points, where these
// mean the same in both models). Positions that are farther off than ten times the median error of
// a fit to the best half of them (least median of squares) are left out: a single far point would
// else decide over all. Where the positions leave the rotation open (fewer than 3, or all on one
// line), it is the mean of the images' relative rotations; where they leave the scale open (one
// image), the scale is 1. Empty: no image in common.
std::optional<Alignment> AlignReconstructions(const Reconstruction& model,
                                              const Reconstruction& truth,
                                              const ImagePairing& pairing, AlignmentBasis basis);
// With the pairing of the images by their names.
std::optional<Sim3d> AlignReconstructions(const Reconstruction& model, const Reconstruction& truth,
                                          AlignmentBasis basis = AlignmentBasis::kAuto);

}  // namespace holba
