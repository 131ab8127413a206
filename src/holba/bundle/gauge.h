// SPDX-License-Identifier: BSD-3-Clause
// What fixes position, orientation and scale of an adjustment.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/scene/types.h"

namespace holba {

class Reconstruction;
struct BundleOptions;
struct BundleSelection;

// Coordinates of poses that are held for no other reason than to fix the gauge. Bit i of a mask:
// tangent coordinate i of PoseManifold, three of rotation, then three of translation.
struct FixedGauge {
  static constexpr uint32_t kWholePose = 0x3f;

  frame_t origin_frame = kInvalidId32;  // kInvalidId32: none
  uint32_t origin_held = 0;
  // The frame or, where the baseline of a rig is longer than the way of its frames, the sensor.
  frame_t scale_frame = kInvalidId32;
  rig_t scale_rig = kInvalidId32;
  camera_t scale_camera = kInvalidId32;
  uint32_t scale_held = 0;
  // Held lines or groups fix a part of the gauge: in a problem of points alone this gauge leaves
  // that part free.
  bool needs_structure = false;
};

// The gauge of a selection. The part of the seven similarities that what is held already fixes is
// measured: each residual between something held and something variable resists a similarity of all
// that is variable in some directions, and the rank of these is what is fixed. This covers held
// frames, points, lines and groups (through their members), and the baseline between two sensors of
// a rig that are held and see something in one frame fixes the scale; sensors whose poses are
// adjusted fix nothing. Relations and measurements of groups do not count. Of what is left,
// - all seven: the first variable frame is held, and of the frame farthest from it the translation
//   coordinate that scaling about the first one moves most (COLMAP's two cameras); in the place of
//   that frame a sensor whose pose is adjusted, if it is farther from the reference of its rig;
// - fewer (a held plane leaves three): as many coordinates of the first variable frame, then of the
//   translation of the one farthest from it, which determine the rest;
// - none, or options.gauge is kFree, or no frame is variable: nothing is held.
// No order of records with equal distances matters between calls: choose once, use the result in
// all problems that are compared.
// `scale_is_known`: something outside of the selection fixes the scale.
FixedGauge ChooseGauge(const Reconstruction& model, const BundleOptions& options,
                       const BundleSelection& selection, bool scale_is_known = false);

// One gauge for each part of a selection: parts share no variable point, line or group, so that
// nothing says how they stand to each other, but for their scales where they share a rig whose
// baseline is adjusted. Frames that see nothing are in none. At least one.
std::vector<FixedGauge> ChooseGaugesOfParts(const Reconstruction& model,
                                            const BundleOptions& options,
                                            const BundleSelection& selection);

}  // namespace holba
