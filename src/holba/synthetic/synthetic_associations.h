// SPDX-License-Identifier: BSD-3-Clause
// Wrong associations: group members and wireframe edges that are replaced by wrong ones.
#pragma once

#include "holba/base/random.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/synthetic_structure.h"

namespace holba {

// Replaces that part of the member points, member lines and edges of `structure`. Its points and
// segments are the noisy ones, its groups the true ones; `nearest` is the distance between these.
// Every replacement is truly wrong, and no group or line gets a feature twice. The counts are
// round(fraction * all), spread evenly over groups and edges.
void ReplaceAssociations(double fraction, WrongAssociations kind, Random* random,
                         SyntheticStructure* structure);

}  // namespace holba
