// SPDX-License-Identifier: BSD-3-Clause
// Where a model has its points and lines in its images.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "holba/scene/reconstruction.h"

namespace holba {

// Empty: the point has no image (behind the camera).
std::optional<Eigen::Vector2d> PixelOf(const Reconstruction& model, const Image& image,
                                       const Eigen::Vector3d& point_in_world);

// Perpendicular vectors from both observed ends to the projected line, ideal pixels. Empty: an end
// has no ideal pixel, or the projected line no direction.
std::optional<Eigen::Vector4d> EndOffsets(const Reconstruction& model, const Image& image,
                                          const PlueckerLine& line,
                                          const LineObservation& observation);

}  // namespace holba
