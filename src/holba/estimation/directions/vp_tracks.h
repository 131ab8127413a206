// SPDX-License-Identifier: BSD-3-Clause
// Vanishing points in space: directions that the vanishing points of several posed images agree
// on, refitted to the segments of all of them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct VpTrackOptions {
  // Largest angle between a direction and that of an image's vanishing point that belongs to it:
  // vanishing points of few short segments are that uncertain.
  double max_deviation_deg = 10.0;
  // Median deviations within one true direction are 0.15 to 0.7 degrees, those of coincidences
  // more than 2.
  double max_median_deviation_deg = 2.0;
  // Images that must show it: as many as chance does not bring together, and a part of all of them;
  // no more than max_min_images however many there are. Of fewer than nine images 60 %, but two.
  int min_images = 5;
  double min_image_share = 0.25;
  int max_min_images = 20;
  // Directions nearer than this are one direction that was split.
  double merge_deg = 5.0;
  // Directions up to max_deviation_deg apart are one too if two image points of theirs have more
  // than this many lines in common and one direction fits the segments of both.
  int min_shared_lines = 4;
  double min_kept_share = 0.8;  // of the segments of each that agree with the joint direction
  // See VanishingPointOptions.
  double max_error_px = 1.0;

  void Describe(OptionTable* table) const;
};

// A vanishing point of an image as an index into ImageFeatures::vanishing_points.
struct ImageVpId {
  image_t image_id = kInvalidId32;
  uint32_t vp_idx = 0;
  friend auto operator<=>(const ImageVpId&, const ImageVpId&) = default;
};

struct VpTrackReport {
  size_t num_images = 0;  // with a pose and vanishing points or segments
  size_t num_image_vps = 0;
  size_t num_vps = 0;  // groups, new or known before, with members in this report
  size_t num_new_vps = 0;
  size_t num_merged = 0;
  struct Track {
    std::vector<ImageVpId> members;  // ascending, one of an image
    double median_deviation_deg = 0.0;
    size_t num_segments = 0;  // of the members, that agree with the direction
  };
  std::map<group3D_t, Track> tracks;
  std::map<std::string, size_t> dropped;  // image vanishing points and tracks, by reason
};

// Adds VP groups without members and observations to the model, with ids after those that are
// there, by falling number of images. A VP group that is there already takes the tracks within
// merge_deg and stays as it is. Poses are used, lines3D only to see which segments have one in
// common; lines2D, if there, must be those of `features`.
VpTrackReport FormVanishingPoints(const VpTrackOptions& options, const ImageFeatureMap& features,
                                  Reconstruction* model);

}  // namespace holba
