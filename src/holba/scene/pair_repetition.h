// SPDX-License-Identifier: BSD-3-Clause
// What the matching of two images knows of repeated patterns (windows, stairs), on whose two sides
// a geometry can hold that is not the scene's: for those who later judge which pairs to believe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace holba {

struct PairRepetition {
  // Keypoints of the first and of the second image with a near descriptor in the other image, and
  // those of them with a second one nearly as near, which the ratio test refuses.
  std::array<uint32_t, 2> num_near = {0, 0}, num_repeated = {0, 0};
  // Of some of the first image's refused keypoints, spread evenly: how many have a similar point in
  // the second image where the geometry allows it, and how many have several, at places of their
  // own along one epipolar line: the geometry cannot tell which is right.
  uint32_t num_sampled = 0, num_agreeing = 0, num_undecided = 0;
  // Median distance in pixels of the inliers from the epipolar line that they are nearest to, in
  // both images. Small: they lie along one line, and a shift along it changes little. Empty:
  // homographies, which have no such lines.
  std::optional<std::array<double, 2>> band_px;
  // For each inlier, in the order of the two-view geometry: its distance over that of the next best
  // match of either of its keypoints; at most kMaxMatchRatio.
  std::vector<float> ratios;
};

inline constexpr float kMaxMatchRatio = 10.0f;

}  // namespace holba
