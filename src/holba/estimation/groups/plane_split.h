// SPDX-License-Identifier: BSD-3-Clause
// Planes that are two: fronts of houses side by side, a wall and the skirting along it, are nearer
// to each other than a search at some pixels tells apart, and one plane between them holds both
// wrongly. Their points lie off that plane together, which the points' noise does not explain.
#pragma once

#include <cstddef>

#include "holba/estimation/groups/plane_detection.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Splits the planes of a model as long as one of them is two. The larger part keeps the id of the
// group, and its 2D groups; lines are members of neither (AddLinesToPlanes knows which). Returns
// the number of planes that were added. `sigma_px`: noise of an observed coordinate of a point.
size_t SplitPlanes(const PlaneOptions& options, double sigma_px, Reconstruction* model);

}  // namespace holba
