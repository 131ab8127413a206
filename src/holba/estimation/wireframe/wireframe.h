// SPDX-License-Identifier: BSD-3-Clause
// Point-line incidences: pairs of a point and a line of the model that are seen to meet, the edges
// of its wireframe. Near is not enough: detectors of blobs put points beside edges, at the same
// signed distance in all images (SIFT: 1.5 px with a scatter of 0.15 px), and those do not lie on
// the lines. So an edge also needs offsets of mean zero.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct WireframeOptions {
  // Of the observed point from the line of the observed segment.
  double max_distance_px = 2.0;
  // Of the observed point beyond the nearer end of the segment, along it; as for junctions.
  double max_overshoot_px = 5.0;
  // In which the pair meets: more than 3, as the paper.
  int min_num_images = 4;
  // The mean signed offset must be smaller, or within 3 standard errors of zero.
  double max_mean_offset_px = 0.5;
  // Standard deviation of the offsets: where it is larger the point does not follow the line.
  double max_offset_scatter_px = 1.0;
  // Distance in space in pixels of the nearest view.
  double max_gap_gsd = 2.0;
  // So far apart where the covariances of point and line allow it (99 % for two degrees of
  // freedom): lines along the motion of the cameras are weak in depth. Beyond it being seen
  // together says little: such a line has no depth of its own.
  double max_uncertain_gap_gsd = 10.0;
  // Standard deviation of a coordinate of points and ends of segments in that test.
  double sigma_px = 0.5;

  void Describe(OptionTable* table) const;
};

struct WireframeReport {
  size_t num_edges = 0;
  size_t num_points = 0;  // with an edge
  size_t num_lines = 0;
  size_t num_joints = 0;  // points with edges to two lines or more
  // Edges beyond max_gap_gsd, taken because the covariances allow the distance.
  size_t num_uncertain = 0;
  // Pairs that meet in at least one image and are no edges, by reason.
  std::map<std::string, size_t> dropped;
};

// Replaces the model's wireframe by the incidences of its points and lines, ordered by point, then
// line, as the model holds them.
WireframeReport FormWireframe(const WireframeOptions& options, Reconstruction* model);

}  // namespace holba
