// SPDX-License-Identifier: BSD-3-Clause
// 3D groups from labelled regions of images (Image::groups2D), after the paper's appendix
// "Incremental Mapping": regions that share triangulated features are one group; its parameters
// come from those features.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "holba/base/options.h"
#include "holba/estimation/groups/group_filter.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct GroupFormingOptions {
  // The relaxed 3D threshold is members.fit.max_error_px; fine-grained refinement is the
  // adjustment's.
  MemberOptions members;
  // Number of shared triangulated features at which a region joins a group or another region.
  int min_shared_with_group = 2;
  int min_shared = 3;
  // Largest angle between a plane and the normal that a network predicted for its region.
  double max_normal_angle_deg = 30.0;
  // Two groups become one if, for the members of both, the median distance from the common
  // parameters is at most so many times that from their own (or 0.25 px more).
  double max_merge_growth = 1.3;

  void Describe(OptionTable* table) const;
};

using GroupObservationPair = std::pair<GroupObservation, GroupObservation>;
using GroupNormals = std::map<std::pair<image_t, group2D_t>, RegionNormal>;

// Labelled regions of the images, as 2D groups that were added to the model: which are known to be
// one surface, and what a network says about their normals.
struct RegionObservations {
  std::vector<GroupObservationPair> matches;
  GroupNormals normals;
};

struct GroupFormingReport {
  size_t observations = 0;  // regions without a group before
  size_t joined = 0;        // regions that joined a group
  size_t formed = 0;        // new groups
  size_t merged = 0;        // groups that became part of another
  std::map<std::string, size_t> formed_by_type;
  std::map<std::string, size_t> dropped;
};

// Gives regions without a group one, new or known. `matches`: regions known to be one surface (from
// warped masks, say), whether or not they share features. `normals`: by region.
GroupFormingReport FormGroups(const GroupFormingOptions& options,
                              std::span<const GroupObservationPair> matches, const GroupNormals& normals,
                              Reconstruction* model);

}  // namespace holba
