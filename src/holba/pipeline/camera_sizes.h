// SPDX-License-Identifier: BSD-3-Clause
// What models of programs lack that count pixels from the middle of the photograph, whose size they
// do not say (Bundler, BAL): it is in the photographs.
#pragma once

#include <cstddef>

#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Cameras of size 0 get that of the first photograph of theirs that can be read; where their
// principal point is (0, 0), it and the points of their images move to the middle. Returns how many
// cameras got theirs. Photographs that cannot be read are left to their readers.
size_t TakeSizesFromPhotographs(const PhotographFolder& photographs, Reconstruction* model);

}  // namespace holba
