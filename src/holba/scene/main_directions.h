// SPDX-License-Identifier: BSD-3-Clause
// Which way a scene is turned: what is down in it, and which level direction most of its lines run
// along. For pictures, plans and viewers, and the length of the bars beside these.
#pragma once

#include <Eigen/Core>

#include "holba/scene/reconstruction.h"

namespace holba {

// Unit vector, world frame: the direction of the vanishing point that is most along the mean down
// axis of the cameras (within 30 degrees), else that mean. Points down. Without cameras: +y.
Eigen::Vector3d EstimateDown(const Reconstruction& model);

// Unit vectors, world frame, for one who looks down: right and below on the paper. The level
// vanishing point of most lines runs to the right.
struct PlanAxes {
  Eigen::Vector3d right, below;
  Eigen::Vector2d operator()(const Eigen::Vector3d& X) const {
    return {right.dot(X), below.dot(X)};
  }
};
// `down`: a unit vector.
PlanAxes EstimatePlanAxes(const Reconstruction& model, const Eigen::Vector3d& down);

// Length of a scale bar beside a picture of something `extent` wide: 1, 2 or 5 times a power of
// ten, a tenth to a quarter of the extent (greater than 0).
double BarLength(double extent);

}  // namespace holba
