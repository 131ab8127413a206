// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/distributed/cells.h"

#include <algorithm>
#include <bit>
#include <map>
#include <utility>

#include "holba/base/check.h"

namespace holba::distributed {
namespace {

// Blocks of one role and manifold have the same unknowns: the coordinates that are variable in some
// of them.
std::vector<uint32_t> ColumnsOfBlocks(const Problem& problem) {
  std::map<std::pair<BlockRole, const ManifoldOps*>, uint32_t> free;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (IsKept(block.role)) free[{block.role, block.manifold}] |= block.FreeMask();
  }
  std::vector<uint32_t> columns(problem.num_blocks(), 0);
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (IsKept(block.role)) columns[id] = free[{block.role, block.manifold}];
  }
  return columns;
}

constexpr BlockId kNoBlockId = ~BlockId{0}, kSeveralBlocks = kNoBlockId - 1;

// For each pose the intrinsics that share its cell. All kNoBlockId unless every variable intrinsics
// block belongs to one pose, and that pose to it.
std::vector<BlockId> OwnIntrinsics(const Problem& problem, std::vector<uint8_t>* used) {
  std::vector<BlockId> pose_of(problem.num_blocks(), kNoBlockId), intrinsics_of = pose_of;
  const auto note = [](BlockId partner, BlockId* noted) {
    if (*noted != partner) *noted = *noted == kNoBlockId ? partner : kSeveralBlocks;
  };
  for (const auto& batch : problem.batches()) {
    for (size_t i = 0; i < batch->size(); ++i) {
      BlockId pose = kNoBlockId, intrinsics = kNoBlockId;
      for (int s = 0; s < batch->num_slots(); ++s) {
        const BlockId id = batch->block(i, s);
        (*used)[id] = 1;
        if (problem.block(id).role == BlockRole::kPose) pose = id;
        if (problem.block(id).role == BlockRole::kIntrinsics) intrinsics = id;
      }
      if (intrinsics == kNoBlockId) continue;
      if (pose == kNoBlockId) {
        pose_of[intrinsics] = kSeveralBlocks;
      } else {
        note(pose, &pose_of[intrinsics]);
        note(intrinsics, &intrinsics_of[pose]);
      }
    }
  }
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (block.role != BlockRole::kIntrinsics || !block.IsVariable() || !(*used)[id]) continue;
    const BlockId pose = pose_of[id];
    if (pose >= kSeveralBlocks || intrinsics_of[pose] != id || !problem.block(pose).IsVariable())
      return std::vector<BlockId>(problem.num_blocks(), kNoBlockId);
  }
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const BlockId partner = intrinsics_of[id];
    if (partner < kSeveralBlocks && problem.block(partner).IsVariable()) continue;
    intrinsics_of[id] = kNoBlockId;
  }
  return intrinsics_of;
}

}  // namespace

CellLayout MakeCellLayout(const Problem& problem, const Partition& partition) {
  CellLayout layout;
  layout.place.resize(problem.num_blocks());
  layout.columns = ColumnsOfBlocks(problem);
  std::vector<uint8_t> used(problem.num_blocks(), 0);
  const std::vector<BlockId> own_intrinsics = OwnIntrinsics(problem, &used);

  std::vector<std::vector<BlockId>> blocks;  // of each cell
  const auto moves = [&](BlockId id) {
    return used[id] && IsKept(problem.block(id).role) && problem.block(id).IsVariable();
  };
  const auto begin_cell = [&](int32_t part) {
    blocks.emplace_back();
    layout.width.push_back(0);
    layout.part.push_back(part);
  };
  const auto add_block = [&](BlockId id) {
    layout.place[id] = {static_cast<uint32_t>(blocks.size() - 1), layout.width.back()};
    layout.width.back() += std::popcount(layout.columns[id]);
    blocks.back().push_back(id);
  };
  // Kept blocks by part, in the order of their cells: poses, other blocks, the border.
  std::vector<std::vector<BlockId>> of_part(static_cast<size_t>(partition.num_parts) * 3);
  std::vector<uint8_t> with_pose(problem.num_blocks(), 0);
  for (const BlockId own : own_intrinsics) {
    if (own != kNoBlockId) with_pose[own] = 1;
  }
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    if (!moves(id) || with_pose[id]) continue;
    const size_t rank = problem.block(id).role == BlockRole::kPose ? 0
                        : partition.is_border[id]                  ? 2
                                                                   : 1;
    of_part[static_cast<size_t>(partition.part_of_block[id]) * 3 + rank].push_back(id);
  }
  bool any = false;
  for (const auto& ids : of_part) any |= !ids.empty();
  for (int32_t part = 0; part < partition.num_parts; ++part) {
    layout.first_of_part.push_back(static_cast<uint32_t>(blocks.size()));
    for (size_t rank = 0; rank < 3; ++rank) {
      for (const BlockId id : of_part[static_cast<size_t>(part) * 3 + rank]) {
        begin_cell(part);
        add_block(id);
        if (own_intrinsics[id] != kNoBlockId) add_block(own_intrinsics[id]);
        if (rank == 0 && layout.block_size == 1) layout.block_size = layout.width.back();
        layout.num_border_cells += rank == 2;
      }
    }
    // A part without rows gets a cell of padding: solvers of other makers fail on empty parts.
    if (any && layout.first_of_part.back() == blocks.size()) begin_cell(part);
  }
  layout.first_of_part.push_back(static_cast<uint32_t>(blocks.size()));

  layout.begin.assign(1, 0);
  for (uint32_t c = 0; c < blocks.size(); ++c) {
    const int size = layout.block_size;
    if (blocks[c].empty()) layout.width[c] = size;
    layout.padded.push_back((layout.width[c] + size - 1) / size * size);
    layout.begin.push_back(layout.begin.back() + static_cast<size_t>(layout.padded[c]));
  }
  layout.free.assign(layout.num_unknowns(), 0);
  for (uint32_t c = 0; c < blocks.size(); ++c) {
    size_t at = layout.begin[c];
    for (BlockId id : blocks[c]) {
      for (int t = 0; t < problem.block(id).manifold->tangent; ++t) {
        if (layout.columns[id] >> t & 1)
          layout.free[at++] = static_cast<uint8_t>(problem.block(id).FreeMask() >> t & 1);
      }
    }
  }
  return layout;
}

Contribution::Contribution(const native::Structure& structure, const BlockPattern& pattern,
                           const std::vector<BlockId>& block_of_whole, const CellLayout& layout) {
  FindPieces(structure, block_of_whole, layout);
  for (size_t n = 0; n < structure.num_nodes(); ++n) {
    padded_begin_.push_back(structure.node_padded_offset[n]);
    plain_begin_.push_back(pattern.offset[n]);
  }
  FindCells(layout);
  FindPairs(pattern, layout);
}

void Contribution::FindPieces(const native::Structure& structure,
                              const std::vector<BlockId>& block_of_whole,
                              const CellLayout& layout) {
  for (size_t n = 0; n < structure.num_nodes(); ++n) {
    first_piece_.push_back(static_cast<uint32_t>(pieces_.size()));
    for (uint32_t b = structure.node_begin[n]; b < structure.node_begin[n + 1]; ++b) {
      const BlockId here = structure.node_blocks[b], whole = block_of_whole[here];
      const CellLayout::Place place = layout.place[whole];
      if (place.cell == CellLayout::kNoCell) continue;  // all of it is held
      Piece piece{place.cell, {}};
      const native::Columns& columns = structure.block_columns[here];
      for (int c = 0; c < columns.count; ++c) {
        const int t = columns.tangent[c];
        if (!(layout.columns[whole] >> t & 1)) continue;
        const int before = std::popcount(layout.columns[whole] & ((uint32_t{1} << t) - 1));
        piece.columns.emplace_back(structure.kept[here].first + c, place.first + before);
      }
      pieces_.push_back(std::move(piece));
    }
  }
  first_piece_.push_back(static_cast<uint32_t>(pieces_.size()));
}

void Contribution::FindCells(const CellLayout& layout) {
  for (const Piece& piece : pieces_) cells_.push_back(piece.cell);
  std::sort(cells_.begin(), cells_.end());
  cells_.erase(std::unique(cells_.begin(), cells_.end()), cells_.end());
  cell_offset_.assign(1, 0);
  for (uint32_t cell : cells_)
    cell_offset_.push_back(cell_offset_.back() + static_cast<size_t>(layout.padded[cell]));
  for (const Piece& piece : pieces_) {
    const size_t i = std::lower_bound(cells_.begin(), cells_.end(), piece.cell) - cells_.begin();
    offset_of_piece_.push_back(cell_offset_[i]);
  }
  for (uint32_t first : layout.first_of_part)
    cells_of_part.push_back(std::lower_bound(cells_.begin(), cells_.end(), first) - cells_.begin());
}

void Contribution::FindPairs(const BlockPattern& pattern, const CellLayout& layout) {
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      const int b = pattern.column[k];
      for (uint32_t p = first_piece_[a]; p < first_piece_[a + 1]; ++p) {
        for (uint32_t q = first_piece_[b]; q < first_piece_[b + 1]; ++q) {
          const uint32_t cp = pieces_[p].cell, cq = pieces_[q].cell;
          // Both orders of two pieces of one node are visited: the diagonal block of the node has
          // both triangles. Of two cells only the upper triangle is wanted.
          if (a == b && cp > cq) continue;
          Copy copy;
          copy.block = static_cast<uint32_t>(k);
          copy.transposed = cp > cq;
          copy.row_piece = copy.transposed ? q : p;
          copy.column_piece = copy.transposed ? p : q;
          copy.mirrored = a != b && cp == cq;
          copies_.push_back(copy);
          pairs_.push_back({std::min(cp, cq), std::max(cp, cq)});
        }
      }
    }
  }
  std::vector<CellPair> of_copy = pairs_;
  // Rows ascend from part to part.
  std::sort(pairs_.begin(), pairs_.end());
  pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
  pair_offset_.assign(1, 0);
  for (const CellPair& pair : pairs_) {
    column_width_.push_back(layout.padded[pair.column]);
    pair_offset_.push_back(pair_offset_.back() +
                           static_cast<size_t>(layout.padded[pair.row]) * column_width_.back());
  }
  for (size_t i = 0; i < copies_.size(); ++i) {
    const size_t at = std::lower_bound(pairs_.begin(), pairs_.end(), of_copy[i]) - pairs_.begin();
    copies_[i].offset = pair_offset_[at];
    stride_of_copy_.push_back(column_width_[at]);
  }
  for (uint32_t first : layout.first_of_part) {
    pairs_of_part.push_back(std::lower_bound(pairs_.begin(), pairs_.end(), CellPair{first, 0}) -
                            pairs_.begin());
  }
}

void Contribution::PackBlocks(const BlockMatrix& S, std::vector<double>* out) const {
  out->assign(pair_offset_.back(), 0.0);
  size_t c = 0;
  for (int a = 0; a < S.pattern->num_nodes() && c < copies_.size(); ++a) {
    const int stride = PaddedWidth(S.pattern->widths[a]);
    for (; c < copies_.size() && copies_[c].block < S.pattern->row_start[a + 1]; ++c) {
      const Copy& copy = copies_[c];
      const double* block = S.Block(copy.block);
      double* const to = out->data() + copy.offset;
      const int width = stride_of_copy_[c];
      for (const auto& [from_row, row] : pieces_[copy.row_piece].columns) {
        for (const auto& [from_column, column] : pieces_[copy.column_piece].columns) {
          const double value = copy.transposed ? block[from_row * stride + from_column]
                                               : block[from_column * stride + from_row];
          to[row * width + column] += value;
          if (copy.mirrored) to[column * width + row] += value;
        }
      }
    }
  }
}

void Contribution::PackVector(const double* padded, double* out) const {
  std::fill_n(out, cell_offset_.back(), 0.0);
  for (size_t n = 0; n + 1 < first_piece_.size(); ++n) {
    for (uint32_t p = first_piece_[n]; p < first_piece_[n + 1]; ++p) {
      for (const auto& [from, to] : pieces_[p].columns)
        out[offset_of_piece_[p] + to] = padded[padded_begin_[n] + from];
    }
  }
}

void Contribution::UnpackVector(const double* packed, double* plain) const {
  for (size_t n = 0; n + 1 < first_piece_.size(); ++n) {
    for (uint32_t p = first_piece_[n]; p < first_piece_[n + 1]; ++p) {
      for (const auto& [to, from] : pieces_[p].columns)
        plain[plain_begin_[n] + to] = packed[offset_of_piece_[p] + from];
    }
  }
}

}  // namespace holba::distributed
