// SPDX-License-Identifier: BSD-3-Clause
// Labelled regions of an image: which features lie in them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Lengths in pixels of an image whose long side is this, the paper's: a threshold then means the
// same for every resolution.
inline constexpr double kReferenceLongSidePx = 800.0;

// For each pixel of the map, how far the rim of its region is: pixels of the map, from its centre
// to that of the nearest pixel with another label, less one; 0 at the rim. The image's border is
// no rim. Row by row.
std::vector<float> DistanceToRim(const LabelMap& map);

struct RegionGroupOptions {
  // Features this close to the rim stay out of a curved surface (sphere, cylinder, ...): outlines
  // of curved things are not on them at a fixed place, and what is behind shines in. Of 800 px.
  double curved_margin_px = 4.0;
  // The same for planes and cuboids, whose corners and edges are on their rim: only the mask's own
  // inaccuracy. Of 800 px.
  double flat_margin_px = 1.0;
  // Share of a segment that must be in the region.
  double min_segment_share = 0.9;
  void Describe(OptionTable* table) const;
};

struct RegionGroups {
  std::vector<Group2D> groups;            // by ascending label; without a 3D group
  std::vector<uint16_t> labels;           // of each
  std::map<std::string, size_t> dropped;  // labels of the map's types, by reason
};

// The points and segments of the image (its points2D and lines2D) in each region that has a type,
// of the kinds that the type takes. Regions without features give no group.
RegionGroups GroupsOfLabelMap(const LabelMap& map, const Image& image, uint64_t image_width,
                              uint64_t image_height, const RegionGroupOptions& options);

}  // namespace holba
