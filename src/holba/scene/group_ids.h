// SPDX-License-Identifier: BSD-3-Clause
// Ids of new groups.
#pragma once

#include <algorithm>

#include "holba/scene/reconstruction.h"

namespace holba {

// One more than the greatest id of a group; of the first, 1.
inline group3D_t NextGroup3DId(const Reconstruction& model) {
  group3D_t next = 1;
  for (const auto& [id, group] : model.groups3D) next = std::max(next, id + 1);
  return next;
}

}  // namespace holba
