// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/distributed/rank_counts.h"

#include <algorithm>
#include <set>

#include "holba/solver/distributed/cells.h"
#include "holba/solver/distributed/part_problem.h"

namespace holba::distributed {
namespace {

// Gradient, diagonal and reduction (DistributedSystem::Assemble).
constexpr size_t kVectorsSent = 3;

size_t Between(const std::vector<size_t>& offset, const std::vector<size_t>& of_part, int part) {
  return offset[of_part[part + 1]] - offset[of_part[part]];
}

}  // namespace

std::vector<RankCounts> CountRanks(const Problem& problem, int num_ranks) {
  const Partition partition = MakePartition(problem, num_ranks);
  const CellLayout layout = MakeCellLayout(problem, partition);
  std::vector<RankCounts> counts(num_ranks);
  std::vector<std::set<int>> neighbours(num_ranks);
  std::vector<std::set<CellPair>> rows(num_ranks);
  std::vector<std::set<uint32_t>> columns(num_ranks);  // of other ranks, in the own rows
  for (int rank = 0; rank < num_ranks; ++rank) {
    RankCounts& c = counts[rank];
    const PartProblem part(problem, partition, rank);
    native::NormalEquations equations;
    equations.Begin(part.problem(), 1);
    const native::Structure& structure = equations.structure();
    const Contribution contribution(structure, equations.FindPattern(), part.block_of_whole(),
                                    layout);
    c.features = structure.features.size();
    c.residuals = part.problem().num_residuals();
    for (BlockId here = 0; here < part.problem().num_blocks(); ++here) {
      const ParameterBlock& block = part.problem().block(here);
      if (block.role != BlockRole::kPose || !block.IsVariable()) continue;
      ++c.poses;
      c.shared_poses += partition.part_of_block[part.block_of_whole()[here]] != rank;
    }
    c.own_unknowns =
        layout.begin[layout.first_of_part[rank + 1]] - layout.begin[layout.first_of_part[rank]];
    for (const native::Chunk& chunk : structure.chunks) {
      for (uint32_t f = chunk.feature_begin; f < chunk.feature_end; ++f) {
        double width = 0.0;
        for (uint32_t node : structure.cliques.Nodes(structure.feature_clique[f]))
          width += structure.node_width[node];
        c.flops += chunk.feature_tangent * width * (width + 1.0);
      }
    }
    c.part_bytes = 8.0 * static_cast<double>(contribution.pair_offset().back());
    for (int to = 0; to < num_ranks; ++to) {
      for (size_t p = contribution.pairs_of_part[to]; p < contribution.pairs_of_part[to + 1]; ++p) {
        const CellPair pair = contribution.pairs()[p];
        rows[to].insert(pair);
        if (layout.part[pair.column] != to) columns[to].insert(pair.column);
      }
      if (to == rank) continue;
      const size_t blocks = Between(contribution.pair_offset(), contribution.pairs_of_part, to);
      const size_t entries = Between(contribution.cell_offset(), contribution.cells_of_part, to);
      if (entries == 0) continue;
      neighbours[rank].insert(to);
      neighbours[to].insert(rank);
      c.shared_unknowns += entries;
      c.messages += blocks > 0 ? 2 : 1;
      c.bytes += sizeof(double) * (blocks + kVectorsSent * entries);
      // The step comes back from its owner.
      ++counts[to].messages;
      counts[to].bytes += sizeof(double) * entries;
    }
  }
  for (int rank = 0; rank < num_ranks; ++rank) {
    RankCounts& c = counts[rank];
    c.neighbours = neighbours[rank].size();
    for (const CellPair& pair : rows[rank])
      c.matrix_bytes += 8.0 * layout.padded[pair.row] * layout.padded[pair.column];
    // Entries of x come, and those of y go back: the other triangle is not stored.
    for (uint32_t column : columns[rank]) {
      const size_t bytes = sizeof(double) * static_cast<size_t>(layout.padded[column]);
      c.product_bytes += bytes;
      counts[layout.part[column]].product_bytes += bytes;
    }
  }
  return counts;
}

}  // namespace holba::distributed
