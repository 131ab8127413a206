// SPDX-License-Identifier: BSD-3-Clause
// The first two images of a model.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "holba/geometry/rigid3d.h"
#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct InitialPair {
  image_t image_id1 = kInvalidId32, image_id2 = kInvalidId32;
  // Of one frame of a rig: the rig's. Else the baseline is 1.
  Rigid3d cam2_from_cam1;
  size_t num_inliers = 0;
  double median_angle_deg = 0.0;

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(image_id1, image_id2, cam2_from_cam1, num_inliers, median_angle_deg);
  }
};

struct InitialPairReport {
  size_t num_tried = 0;                   // pairs whose geometry was estimated
  std::map<std::string, size_t> dropped;  // why not

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(num_tried, dropped);
  }
};

// The first pair, in COLMAP's order (known focal length first, then the number of matches), whose
// geometry is good enough. What was tried before is not tried again. Of rigs with more than one
// sensor of known poses pairs of one frame come first: they have the scale.
std::optional<InitialPair> FindInitialPair(const InitialPairOptions& options, int random_seed,
                                           int num_threads, MapperState* state,
                                           InitialPairReport* report);

// Gives both images (the frame, or two frames) their poses, the first one's at the origin.
void RegisterInitialPair(const InitialPair& pair, MapperState* state);

}  // namespace holba
