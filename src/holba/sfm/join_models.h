// SPDX-License-Identifier: BSD-3-Clause
// Two models of one scene that share images, as one.
#pragma once

#include <cstddef>
#include <optional>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"
#include "holba/sfm/mapper_state.h"

namespace holba {

struct ModelAlignment {
  Sim3d a_from_b;
  size_t num_shared = 0, num_agreeing = 0;  // images
};

// By the poses of the images that both have: the similarity that most of them agree with, within
// 2 degrees and a twentieth of the distance that the shared cameras spread over. Empty: fewer than
// three agree, or less than three quarters of them; such models do not show the same.
std::optional<ModelAlignment> AlignModels(const Reconstruction& a, const Reconstruction& b);

// Registers the images of `other` that the state's model lacks, where AlignModels puts them;
// nothing of them is triangulated yet. Returns how many: none where the model has them all. Empty:
// the models do not go together.
std::optional<size_t> JoinModel(const Reconstruction& other, MapperState* state);

}  // namespace holba
