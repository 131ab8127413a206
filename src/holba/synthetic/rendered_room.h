// SPDX-License-Identifier: BSD-3-Clause
// Photographs of a small room with known cameras, drawn by ray casting: a corner of two walls and a
// floor, two boxes, and painted panels on all of them. For demonstrations and tests of what begins
// with photographs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RoomOptions {
  int num_images = 14;
  int width = 640, height = 480;  // of a photograph, px
  double noise = 2.0;             // standard deviation of a grey value, of 255
  uint64_t seed = 1;              // of paint and noise

  void Describe(OptionTable* table) const;  // section "Room"; without the seed
};

struct RenderedPhotograph {
  std::string name;
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // row by row
};

struct RenderedRoom {
  Reconstruction truth;  // cameras and poses, metres; no points
  std::vector<RenderedPhotograph> photographs;
};

// The same on every platform for the same options, whatever the number of threads.
RenderedRoom RenderRoom(const RoomOptions& options, int num_threads);

}  // namespace holba
