// SPDX-License-Identifier: BSD-3-Clause
// Parts of a model: the same cameras and images with some of the features and groups, and the way
// back.
#pragma once

#include <functional>

#include "holba/scene/reconstruction.h"

namespace holba {

// Which features and groups a part has. An empty function keeps all.
struct ModelSelection {
  std::function<bool(point3D_t, const Point3D&)> keep_point;
  std::function<bool(line3D_t, const Line3D&)> keep_line;
  std::function<bool(group3D_t, const Group3D&)> keep_group;
};

// `part`, the whole as it comes in, without all else: a consistent model of the chosen features and
// groups; what refers to others (members, edges, relations, references of 2D features) is gone, 2D
// features keep their indices.
Reconstruction Select(Reconstruction part, const ModelSelection& selection);

// Poses, intrinsics, points, lines and parameters of groups of a part (Select's, then adjusted)
// into the model that it was taken from. Tracks, members and edges of the model stay as they are.
void CopyValues(const Reconstruction& part, Reconstruction* model);

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
