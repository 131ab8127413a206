// SPDX-License-Identifier: BSD-3-Clause
// Junctions: points where 3D lines meet, as points of the model with observations of their own. In
// each image in which segments of two lines meet, the intersection of the segments is an
// observation. Such an observation derives from the segments: it is not independent of the lines'
// observations. What it adds is that the lines meet.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct JunctionOptions {
  // From the intersection of the segments' lines to the nearer end of each segment (0: inside).
  // Detectors stop a few pixels short of a corner, where the gradient turns.
  double max_overshoot_px = 5.0;
  // Between the two segments in each image, and between the two lines in space: below it the place
  // of an intersection is poorly known along the lines.
  double min_angle_deg = 30.0;
  // In which the two meet: more than 3, as the paper.
  int min_num_images = 4;
  // Distance between the lines, and of the point from each line, in pixels of the nearest view.
  double max_gap_gsd = 2.0;
  // So far from a line where the covariances of point and line allow it (99 %), if in enough images
  // both segments end at the junction. Where one runs on, it may as well cover the other.
  double max_uncertain_gap_gsd = 10.0;
  double sigma_px = 0.5;  // of the ends of segments, in those covariances
  // Of an observation, from the projection of its point.
  double max_error_px = 2.0;
  double min_triangulation_angle_deg = 1.5;

  void Describe(OptionTable* table) const;
};

struct Junction {
  point3D_t point3D_id = kNoId;
  std::vector<line3D_t> line3D_ids;  // ascending, two or more
  size_t num_images = 0;             // that observe it
  bool is_uncertain = false;         // farther than max_gap_gsd from a line
};

struct JunctionReport {
  std::vector<Junction> junctions;  // added to the model
  size_t num_observations = 0;
  size_t num_line_pairs = 0;  // that meet in at least one image
  // Pairs, junctions, lines of junctions and observations that were not taken, by reason.
  std::map<std::string, size_t> dropped;
};

// Adds the junctions of the model's lines to its points. Lines that meet at one corner become one
// junction. The colour is the mean of the lines'.
JunctionReport TriangulateJunctions(const JunctionOptions& options, int num_threads,
                                    Reconstruction* model);

}  // namespace holba
