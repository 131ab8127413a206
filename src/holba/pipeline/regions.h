// SPDX-License-Identifier: BSD-3-Clause
// Labelled regions of the images as 2D groups of a model's features, and which of them are one
// surface.
#pragma once

#include <map>
#include <string>

#include "holba/estimation/groups/group_forming.h"
#include "holba/frontend/matching/label_maps.h"
#include "holba/frontend/matching/region_matching.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// How regions of two images are matched: by the features that they share, or by warping masks
// through dense correspondences (imported, or interpolated between the points that the images
// share).
enum class RegionMatching { kVotes, kWarp };

struct RegionOptions {
  RegionMatching matching = RegionMatching::kVotes;
  RegionGroupOptions groups;
  GroupVotingOptions votes;
  RegionWarpOptions warp;
  FieldInterpolationOptions interpolation;

  void Describe(OptionTable* table) const;
};

struct RegionReport {
  size_t num_groups2D = 0;
  size_t num_matches = 0;
  std::map<std::string, size_t> dropped;
};

// Adds the typed regions of the label maps to groups2D of the images. `field_path`: folder of dense
// correspondences for kWarp; empty: interpolated. `matches`: of segments, for kVotes.
RegionObservations ObserveRegions(const RegionOptions& options, const std::string& field_path,
                                  const ImageFeatureMap& features, const LineMatchMap& matches,
                                  Reconstruction* model, RegionReport* report);

}  // namespace holba
