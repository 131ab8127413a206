// SPDX-License-Identifier: BSD-3-Clause
// Whether none, one or several images see a feature. One image gives no depth.
#pragma once

#include "holba/scene/reconstruction.h"

namespace holba {

struct TrackImages {
  image_t first = kInvalidId32;  // none: kInvalidId32
  bool are_several = false;

  bool IsOne() const { return first != kInvalidId32 && !are_several; }
};

// `counts(observation)`: whether an observation of the track is taken into account.
template <typename Track, typename Counts>
TrackImages ImagesOfTrack(const Track& track, const Counts& counts) {
  TrackImages images;
  for (const auto& observation : track) {
    if (observation.image_id == images.first || !counts(observation)) continue;
    images.are_several = images.first != kInvalidId32;
    if (images.are_several) break;
    images.first = observation.image_id;
  }
  return images;
}

}  // namespace holba
