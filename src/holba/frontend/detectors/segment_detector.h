// SPDX-License-Identifier: BSD-3-Clause
// Straight segments of an image in which straight lines of the world are straight. A detector is
// one file with a function and one line in the list of segment_detector.cc.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/options.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/geometry/line.h"

namespace holba {

struct SegmentOptions {
  std::string detector = "lsd";
  std::string model_path;  // JSON file of a user's model (segment_onnx.h)
  // LSD works on the image at this scale. 0.8 is its authors' choice; 1.5 finds fewer and takes 3
  // to 4 times as long.
  double lsd_scale = 0.8;
  // Most shorter ones are not found again in other images.
  double min_length_px = 12.0;
  int max_num_segments = 1500;  // the longest
  // Moves segments onto the maxima of the brightness gradient (segment_refinement.h).
  bool refine = true;

  void Describe(OptionTable* table) const;
};

struct SegmentDetector {
  std::string_view name;
  // Pixels of COLMAP's convention (centre of the first one at 0.5); in any order and direction.
  std::vector<LineSegment2d> (*detect)(const SegmentOptions& options, const GreyImage& image);
};

// Throws InputError that names the option and the known ones.
const SegmentDetector& FindSegmentDetector(std::string_view name);

}  // namespace holba
