// SPDX-License-Identifier: BSD-3-Clause
// Which 3D lines run along which vanishing point.
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct LineLabelOptions {
  // That of segments and vanishing points in one image, plus half a pixel: the vanishing point of
  // all images is not the best one of each.
  double max_error_px = 1.5;
  // Number of images in which a line must run to the vanishing point. A line seen in fewer images,
  // but at least three, must do so in all of them.
  int min_images = 4;
  double min_image_share = 0.8;
  // A line turned to the vanishing point's direction must fit its segments about as well as before:
  // the root mean square distance of their ends may grow by this factor and the allowance.
  double max_error_factor = 1.5;
  double error_allowance_px = 0.15;
  // A vanishing point of fewer lines says nothing about any of them.
  int min_lines = 3;

  void Describe(OptionTable* table) const;
};

struct LineLabelReport {
  size_t num_labelled_lines = 0;
  size_t num_removed_vps = 0;
  std::map<group3D_t, size_t> lines_of_vp;
  std::map<std::string, size_t> dropped;  // lines, by reason
};

// Sets the member lines of the VP groups: those whose segments run to the vanishing point's image
// in the images of their tracks and that stay on them if they are turned that way; a line belongs
// to at most one, of several to the one with the least errors. The lines are left as they are.
// Removes VP groups of fewer than min_lines, with their relations.
LineLabelReport LabelLines(const LineLabelOptions& options, Reconstruction* model);

}  // namespace holba
