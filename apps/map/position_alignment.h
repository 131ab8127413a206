// SPDX-License-Identifier: BSD-3-Clause
// A model in the frame and the unit of the positions that its images were taken at, by GPS or as
// the database gives them.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <optional>
#include <string>

#include "holba/io/database.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PositionAlignment {
  std::string why_not;  // a phrase; empty: the model was moved
  size_t num_positions = 0, num_left_out = 0;
  double median_error = 0.0;  // metres, or the unit of the positions
  double scale = 1.0;         // that the model was multiplied by
  // WGS84 positions become east, north, up in metres about this place: latitude, longitude
  // (degrees) and altitude (metres).
  std::optional<Eigen::Vector3d> origin;
};

// By a robust similarity (evaluation/alignment.h); a single wrong position moves nothing. The model
// stays as it is where the positions, as exact as they prove to be, do not determine its rotation
// to 3 degrees and its scale to 5 %: GPS says nothing about a table top. Null: fewer than 3 images
// have positions.
std::optional<PositionAlignment> AlignToPositions(const std::map<image_t, PosePrior>& priors,
                                                  Reconstruction* model);

}  // namespace holba
