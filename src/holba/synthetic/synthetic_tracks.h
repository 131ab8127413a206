// SPDX-License-Identifier: BSD-3-Clause
// Which images see which features of a synthetic scene.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/base/random.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/synthetic_cameras.h"
#include "holba/synthetic/synthetic_structure.h"

namespace holba {

inline constexpr int kMinTrackLength = 4;
inline constexpr int kMaxTrackLength = 8;

// Image indices, ascending, 4 to 8 for each feature (uniformly distributed).
struct SyntheticTracks {
  std::vector<std::vector<uint32_t>> points, lines;
};

// The lines of a plane see about half of their images in common: `c` images are in the tracks of
// all of them, the others are drawn from the plane's pool of images, c such that the expected
// number of shared images is nearest to half the mean length.
// With near visibility points of wireframe edges are seen by neighbours of an image that sees their
// line.
SyntheticTracks MakeTracks(const SyntheticCameras& cameras, const SyntheticStructure& structure,
                           SceneLayout layout, Visibility visibility, Random* random);

}  // namespace holba
