// SPDX-License-Identifier: BSD-3-Clause
// What sees the points and lines of a model, with which error, and how well each is known.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/scene/reconstruction.h"
#include "holba/scene/views.h"

namespace holba {

// Of points: `length` observations of each after another. Of lines alike.
struct ViewObservations {
  std::vector<uint32_t> length;     // of each feature
  std::vector<uint32_t> image;      // index in the model's images
  std::vector<uint16_t> positions;  // points: x, y; lines: x1, y1, x2, y2 (PositionOfView)
  std::vector<float> error_px;      // -1: the feature has no image there
  std::vector<float> sigma;         // of each feature, model units; 0: unknown
};

// The distance of the observation from the feature's image, for a line the greater of its segment's
// two ends from the line's image in ideal pixels. Sigma is that of the worst direction (of a line:
// of the worse end, across it) with the cameras held and noise of sigma_px. `covariances`: of each
// point 6 numbers, the upper triangle of its covariance over sigma^2, times 32767; zeros where
// sigma is unknown.
ViewObservations ObservationsOfPoints(const Reconstruction& model, const ViewMap& views,
                                      double sigma_px, int num_threads,
                                      std::vector<int16_t>* covariances);
ViewObservations ObservationsOfLines(const Reconstruction& model, const ViewMap& views,
                                     double sigma_px, int num_threads);

// Positions in 65536 steps: from an eighth of the longer side of the camera's image outside of it
// to an eighth beyond; what is farther out is put there. Finer than 0.05 px up to 2600 px.
uint16_t PositionOfView(double pixels, const Camera& camera);

}  // namespace holba
