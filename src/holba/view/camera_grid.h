// SPDX-License-Identifier: BSD-3-Clause
// A lens as a grid of rays: what a page needs of a camera of any model to put its photograph, and
// what was seen in it, into the scene.
#pragma once

#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

// Rays of the nodes of a grid that is even over the pixels [0, width] x [0, height], row by row
// from the top left. Between the nodes they are interpolated bilinearly.
struct CameraGrid {
  int columns = 0, rows = 0;  // of nodes
  // Whether all rays are (x/z, y/z, 1), so that for a pinhole camera four nodes are exact; else
  // they have unit length.
  bool is_planar = true;
  std::vector<float> rays;  // 3 for each node; zeros where the camera has no ray
};

// The coarsest grid of 1, 2, 4, ... 64 cells along each side that is right to max_error_px amid all
// its cells, else the one of 64.
CameraGrid MakeCameraGrid(const Camera& camera, double max_error_px);

}  // namespace holba
