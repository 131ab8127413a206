// SPDX-License-Identifier: BSD-3-Clause
// Cameras of a growing model: which are one, and what lens they have.
#pragma once

#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"
#include "holba/solver/solver.h"

namespace holba {

// As points that are left out say (bundle/camera_sharing.h, bundle/camera_model_choice.h), if the
// options want it and no image came with a pose. Where cameras become one, so do those of images
// without a pose that were given the same: they are registered with a lens that is known. Points
// and poses are adjusted then; lines and groups are not. True: something changed.
bool ChooseCameras(const MapperOptions& options, const SolverOptions& solver, MapperState* state);

}  // namespace holba
