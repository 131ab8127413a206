// SPDX-License-Identifier: BSD-3-Clause
// Structure as a whole: taken out of a model, or seen anew in its images.
#pragma once

#include "holba/scene/reconstruction.h"

namespace holba {

// Removes all lines, groups, edges and relations, in 2D and 3D, and the points made from them.
void RemoveStructure(Reconstruction* model);

// Removes the points that were made from structure (IsOfStructure), with their observations: 2D points
// that no photograph's detector has found, so that the images have their keypoints again.
void RemovePointsOfStructure(Reconstruction* model);

// Sets groups2D of all images from the members of the 3D groups: in each image that observes
// members of a group, one 2D group with those of its features. 2D groups without a 3D group are
// kept; those of 3D groups are made anew.
void ObserveGroups(Reconstruction* model);

}  // namespace holba
