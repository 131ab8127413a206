// SPDX-License-Identifier: BSD-3-Clause
// A model as what a page shows: positions in single precision about an origin amid the scene,
// colours, errors and uncertainty of each point and line, what sees it where, groups with the
// meshes of their extent, cameras as grids of rays. viewer/src/model.ts reads it.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct ViewModelOptions {
  std::string title;   // any bytes
  std::string report;  // text of the run that made the model; may be empty
  int num_threads = -1;
  // Where keypoints and segments were seen is left out above this many bytes of all arrays
  // together; errors of the observations stay.
  size_t max_num_bytes = 45'000'000;
};

struct ViewModel {
  std::string bytes;  // an ArrayBundle
  bool has_observed_positions = true;
};

// The numbers of the page are about `origin` (model units); two models that are shown together
// have the same. Empty: amid this model.
ViewModel MakeViewModel(const Reconstruction& model, const ViewModelOptions& options,
                        const std::optional<Eigen::Vector3d>& origin = std::nullopt);

// Amid the points, line ends and camera centres: their medians. Finite also where they are not.
Eigen::Vector3d OriginOfView(const Reconstruction& model);

}  // namespace holba
