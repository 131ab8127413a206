// SPDX-License-Identifier: BSD-3-Clause
// Planes that are two: fronts of houses side by side, a wall and the skirting along it, are nearer
// to each other than a search at some pixels tells apart, and one plane between them holds both
// wrongly. Their points lie off that plane together, which the points' noise does not explain.
#pragma once

#include <cstddef>
#include <vector>

#include "holba/estimation/groups/plane_detection.h"
#include "holba/estimation/groups/plane_points.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// The points of one plane as those of two, each a connected part of it; empty: they are one. Two
// planes are at least one standard deviation of their points apart, have the fewest points of a
// plane each, and explain the points better than their six parameters cost (Bayesian information
// criterion).
std::vector<FoundPlane> SplitInTwo(const PlaneOptions& options, const PlanePoints& points);

// Splits the planes of a model as long as one of them is two. The larger part keeps the id of the
// group, and its 2D groups; lines are members of neither (AddLinesToPlanes knows which). Returns
// the number of planes that were added.
size_t SplitPlanes(const PlaneOptions& options, Reconstruction* model);

}  // namespace holba
