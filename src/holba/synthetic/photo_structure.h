// SPDX-License-Identifier: BSD-3-Clause
// Structure of single images of a synthetic set: vanishing points of its noisy segments, and
// labelled regions of the planes that it shows.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "holba/scene/image_features.h"
#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

// axis_of_segment: the world axis that each segment of the image is parallel to, -1: none. A
// vanishing point for each axis with three segments or more: the direction that fits these best.
// Sets the image's vanishing points and labels of segments.
void FindVanishingPoints(const Camera& camera, std::span<const int> axis_of_segment,
                         PhotoSetImage* image);

// Of each keypoint and segment of an image the plane (a group of the scene) it lies in; -1: none.
struct PlanesOfFeatures {
  std::vector<int> of_keypoints, of_segments;
};

// The planes with three keypoints or more are labelled from 1 on, in the order of groups: where the
// view's rays meet their panels; in scenes without panels, whose planes are transparent, around
// their features.
LabelMap LabelPlanes(const PhotoScene& scene, uint32_t view, const PlanesOfFeatures& planes,
                     const PhotoSetImage& image);

}  // namespace holba
