// SPDX-License-Identifier: BSD-3-Clause
// A problem cut into parts for processes that each eliminate features of their own. The graph of
// the poses, with an edge for features that both see, is cut by METIS (Karypis and Kumar 1998), so
// that few poses have features in several parts; each feature goes to one of the parts of its
// poses. Parts are balanced by predicted work. The same problem and number of parts give the same
// partition.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/problem/problem.h"

namespace holba::distributed {

struct Partition {
  static constexpr int32_t kNone = -1;

  int num_parts = 1;
  // By block id. Of a variable feature: the part that eliminates it. Of a pose, and of every other
  // kept block that residuals hold: the part that owns its row of the reduced system. kNone: no
  // residual holds it, or it is a feature that is not variable.
  std::vector<int32_t> part_of_block;
  // By block id: a kept block that more than half of the parts touch, such as a lens of all images
  // or the plane of a whole street. The last part owns all of these.
  std::vector<uint8_t> is_border;
  std::vector<double> work;  // predicted, by part, in roughly CPU cycles of an iteration

  // The part that evaluates residual i of the batch.
  int PartOfResidual(const Problem& problem, const ResidualBatch& batch, size_t i) const;
  // The largest work of a part over the mean of all.
  double Imbalance() const;
};

Partition MakePartition(const Problem& problem, int num_parts);

}  // namespace holba::distributed
