// SPDX-License-Identifier: BSD-3-Clause
// From the true structure of a synthetic scene to records of a Reconstruction.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/scene/reconstruction.h"
#include "holba/synthetic/synthetic_structure.h"

namespace holba {

// Id of the k-th point, line or group.
inline uint64_t SyntheticIdOf(size_t k) { return k + 1; }

// Without observations.
Line3D MakeSyntheticLine(const Segment3d& segment);

// Groups with their 2D observations, wireframe and relations of `structure`, whose features the
// model has.
void AddAssociations(const SyntheticStructure& structure, Reconstruction* model);

}  // namespace holba
