// SPDX-License-Identifier: BSD-3-Clause
// Images that several cameras took, as those of one.
#pragma once

#include <set>

#include "holba/scene/reconstruction.h"

namespace holba {

// Cameras that stand alone in a rig, which all their images are in, registered or not: the only
// ones that can be merged.
std::set<camera_t> CamerasOfTrivialRigs(const Reconstruction& model);

// All images of `others` are of `kept` from now on, with its parameters; the other cameras and
// their rigs go. Poses and features stay. All must be of trivial rigs.
void MergeCameras(camera_t kept, const std::set<camera_t>& others, Reconstruction* model);

}  // namespace holba
