// SPDX-License-Identifier: BSD-3-Clause
// Links between 2D and 3D features that only one of the two ends knows. Cleaned point clouds,
// pruned lists of images and other programs' exporters leave them in files; inside the program
// there are none (Reconstruction::FindInconsistency).
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

struct OneSidedLinks {
  // Links that were taken out of the end that knew them, by what was wrong: "3D features that name
  // a missing image", ...
  std::map<std::string, size_t> dropped;
  // Elements of tracks with the index of another 2D feature, where a single 2D feature of that
  // image names the 3D feature: its index was taken.
  size_t num_corrected = 0;
  size_t num_sound = 0;  // links that both ends knew
  // Each of them in words, with its ids, if that was asked for.
  std::vector<std::string> list;

  size_t NumDropped() const;
  bool empty() const { return dropped.empty() && num_corrected == 0; }
};

// Of points, lines and groups. What is left satisfies both directions; features stay, also without
// a track.
OneSidedLinks DropOneSidedLinks(bool with_list, Reconstruction* model);

}  // namespace holba
