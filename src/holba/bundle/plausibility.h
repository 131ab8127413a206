// SPDX-License-Identifier: BSD-3-Clause
// Whether a model can be what its points' observations show. A least squares solver ends with
// "converged" on anything, so this is asked before and after.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

// What to do about a model without points.
inline constexpr const char* kTriangulateFirst =
    "triangulate points first (colmap point_triangulator)";

// Points in their images.
struct ReprojectionCheck {
  size_t num_points = 0;
  size_t num_observations = 0;
  size_t num_absent = 0;  // the point has no image: it is behind the camera
  // Of the absent: a camera of a model with MaxAngle (camera_model.h) that would see the point at
  // 90 to 120 degrees from its axis, further than its parameters reach.
  size_t num_beyond_lens = 0;
  double median_px = 0.0;         // of the present residuals
  double median_angle_deg = 0.0;  // over points, at which the rays meet; of a sample of them
};
ReprojectionCheck CheckReprojections(const Reconstruction& model);

// Sentences on what the user should doubt, with the likely cause: many observations behind their
// cameras, a median residual of hundreds of pixels, cameras in one place, no points. Usually none.
std::vector<std::string> DoubtsOf(const ReprojectionCheck& check, const Reconstruction& model);

// Why there is nothing to adjust in a model of which no residual is defined.
std::string WhyNothingIsLeft(const Reconstruction& model);

}  // namespace holba
