// SPDX-License-Identifier: BSD-3-Clause
// All features of a photograph: segments with their descriptors and corners. (Vanishing points are
// found from the segments, labels are imported.)
#pragma once

#include <string>

#include "holba/frontend/detectors/corner_detector.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/detectors/segment_detector.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct ExtractionOptions {
  SegmentOptions segments;
  CornerOptions corners;

  void Describe(OptionTable* table) const;
};

// The image must have the camera's size. Segments are found where the camera makes straight lines
// straight and given in pixels of the photograph, the longest there first. Same image, options and
// camera: same features; may be called from several threads. `given`: segments that another
// detector found (pixels of the photograph), taken as they are but turned, in their order, instead
// of ours; null: ours. `mask`: of the image's size; no corner and no part of a segment of ours is
// where it is 0; null: they are anywhere.
ImageFeatures ExtractFeatures(const ExtractionOptions& options, const GreyImage& image,
                              const Camera& camera,
                              const std::vector<LineSegment2d>* given = nullptr,
                              const GreyImage* mask = nullptr);

// Everything but the image that the features depend on, in one line of text: features stored with
// another one are out of date.
std::string SettingsOf(const ExtractionOptions& options, const Camera& camera);

}  // namespace holba
