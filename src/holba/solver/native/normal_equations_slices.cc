// SPDX-License-Identifier: BSD-3-Clause
// NormalEquations: cutting the chunks into slices, and the places of blocks in the sums of a slice.
#include <algorithm>
#include <utility>

#include "holba/base/check.h"
#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {
namespace {

// A slice is worth a thread from some 100 microseconds on (in units of Structure::Work, about
// cycles), and more than 16 slices would only cost memory.
constexpr double kMinSliceWork = 3e5;
constexpr size_t kMaxSlices = 16;
// Where every slice touches most of the matrix, clearing and adding up its sums costs about this
// work per byte. It may take kMaxMergeShare of the whole work and, beyond kMinCopies slices, no
// more than kFreeSliceBytes of memory.
constexpr double kMergeWorkPerByte = 0.25, kMaxMergeShare = 0.15;
constexpr size_t kFreeSliceBytes = size_t{1} << 20, kMinCopies = 2;

}  // namespace

void NormalEquations::MakeSlices() {
  double total = 0.0;
  for (const Chunk& chunk : structure_.chunks) total += structure_.Work(chunk);
  const double matrix_bytes = 8.0 * static_cast<double>(std::max<size_t>(
                                        1, pattern_.full ? row_offset_.back() : S_.values.size()));
  double count = std::clamp<double>(total / kMinSliceWork, 1.0, kMaxSlices);
  const double n = static_cast<double>(pattern_.num_nodes());
  if (static_cast<double>(pattern_.num_blocks()) > 0.2 * n * n) {
    const double by_work = kMaxMergeShare * total / (kMergeWorkPerByte * matrix_bytes);
    const double by_memory = kFreeSliceBytes / matrix_bytes;
    count = std::min(count, std::max(1.0 * kMinCopies, std::min(by_work, by_memory)));
  } else if (structure_.num_nodes() > 4000) {
    count = std::min(count, 8.0);  // each slice has vectors of all nodes
  }
  num_slices_ = std::min(static_cast<size_t>(count), std::max<size_t>(structure_.chunks.size(), 1));
  while (slices_.size() < num_slices_) slices_.push_back(std::make_unique<SliceData>());
  double done = 0.0;
  uint32_t c = 0;
  for (size_t i = 0; i < num_slices_; ++i) {
    SliceData& slice = *slices_[i];
    slice.chunk_begin = c;
    const double goal = total * static_cast<double>(i + 1) / static_cast<double>(num_slices_);
    while (c < structure_.chunks.size() && (i + 1 == num_slices_ || done < goal))
      done += structure_.Work(structure_.chunks[c++]);
    slice.chunk_end = c;
  }
}

void NormalEquations::MakeOffsets(SliceData* slice) {
  const size_t padded = structure_.padded_size() + kMaxTangent + kPanelLanes;
  slice->gradient.resize(padded);
  slice->diagonal.resize(padded);
  slice->reduction.resize(padded);
  // First the blocks that the slice touches, as indices into the pattern, then their offsets.
  FindPairsOfCliques(slice);
  FindLoosePairs(slice);
  if (pattern_.full) {
    PlaceInFullSums(slice);
  } else {
    PlaceInOwnSums(slice);
  }
  Scratch::Grow(&slice->own_S, slice->sums_size);
  slice->S = slice->own_S.data();
  slice->U = slice->S;
  if (IsImplicit()) {
    Scratch::Grow(&slice->own_U, slice->sums_size);
    slice->U = slice->own_U.data();
  }
}

// The cliques of the slice's features and, unless the pattern is full, the block of each of their
// pairs.
void NormalEquations::FindPairsOfCliques(SliceData* slice) const {
  const Structure& s = structure_;
  slice->pairs_begin.clear();
  slice->pairs.clear();
  uint32_t clique_end = 0;
  slice->first_clique = kNoClique;
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = s.chunks[c];
    if (chunk.feature_begin == chunk.feature_end) continue;
    if (slice->first_clique == kNoClique)
      slice->first_clique = s.feature_clique[chunk.feature_begin];
    clique_end = s.feature_clique[chunk.feature_end - 1] + 1;
  }
  if (slice->first_clique == kNoClique) slice->first_clique = clique_end = 0;
  if (pattern_.full) return;
  size_t num_pairs = 0;
  for (uint32_t c = slice->first_clique; c < clique_end; ++c) {
    const size_t size = s.cliques.Nodes(c).size();
    num_pairs += size * (size + 1) / 2;
  }
  slice->pairs.reserve(num_pairs);
  for (uint32_t c = slice->first_clique; c < clique_end; ++c) {
    const auto nodes = s.cliques.Nodes(c);
    slice->pairs_begin.push_back(slice->pairs.size());
    for (size_t p = 0; p < nodes.size(); ++p) {
      const uint32_t a = nodes[p];
      const bool form_has_row = !IsImplicit() || a >= s.num_pose_nodes;
      size_t k = pattern_.row_start[a];
      for (size_t q = 0; q < p; ++q) {
        if (!form_has_row) {
          slice->pairs.push_back(kNoBlock);
          continue;
        }
        // Columns and nodes both ascend.
        const int b = static_cast<int>(nodes[q]);
        if (pattern_.column[k] != b) {
          k = std::lower_bound(pattern_.column.begin() + k,
                               pattern_.column.begin() + pattern_.row_start[a + 1], b) -
              pattern_.column.begin();
        }
        slice->pairs.push_back(static_cast<uint32_t>(k));
      }
      slice->pairs.push_back(static_cast<uint32_t>(pattern_.row_start[a + 1] - 1));
    }
  }
}

// Calls visit(part, first, last, num_cross) for each chunk of residuals without features: its pairs
// of segments have the entries [first * num_cross, last * num_cross) of cross_[part].
template <typename Visitor>
void NormalEquations::ForEachLooseChunk(const SliceData& slice, const Visitor& visit) const {
  for (uint32_t c = slice.chunk_begin; c < slice.chunk_end; ++c) {
    const Chunk& chunk = structure_.chunks[c];
    if (chunk.feature_tangent != 0) continue;
    const ChunkPart& cp = structure_.chunk_parts[chunk.parts_begin];
    const size_t n = structure_.parts[cp.part].num_segments;
    visit(cp.part, cp.begin, cp.end, n * (n - 1) / 2);
  }
}

// The block of each pair of segments of residuals without a feature.
void NormalEquations::FindLoosePairs(SliceData* slice) {
  cross_.resize(structure_.parts.size());
  ForEachLooseChunk(*slice, [&](uint32_t part_idx, uint32_t begin, uint32_t end, size_t num_cross) {
    const Part& part = structure_.parts[part_idx];
    const int n = part.num_segments;
    std::vector<uint32_t>& cross = cross_[part_idx];
    cross.resize(part.residuals.size() * num_cross);
    for (uint32_t j = begin; j < end; ++j) {
      const uint32_t* nodes = &part.nodes[static_cast<size_t>(j) * n];
      uint32_t* out = cross.data() + static_cast<size_t>(j) * num_cross;
      for (int a = 0; a < n; ++a) {
        for (int b = 0; b < a; ++b, ++out) {
          *out = kNoBlock;
          if (nodes[a] == kNoNode || nodes[b] == kNoNode) continue;
          const size_t k = pattern_.Find(static_cast<int>(std::max(nodes[a], nodes[b])),
                                         static_cast<int>(std::min(nodes[a], nodes[b])));
          if (k != pattern_.num_blocks()) *out = static_cast<uint32_t>(k);
        }
      }
    }
  });
}

// Offsets in sums that have every block of a full pattern.
void NormalEquations::PlaceInFullSums(SliceData* slice) {
  slice->blocks.clear();
  slice->block_offset.clear();
  const size_t n = structure_.num_nodes();
  slice->diagonal_offset.resize(n);
  for (size_t a = 0; a < n; ++a) {
    const int width = pattern_.widths[a];
    slice->diagonal_offset[a] =
        static_cast<uint32_t>((row_offset_[a + 1] - SumBlockSize(width, width)) / kFeatureRow);
  }
  slice->sums_size = row_offset_.back();
  HOLBA_CHECK_MSG(slice->sums_size / kFeatureRow < kNoBlock, "reduced system too large");
  const auto to_offset = [&](uint32_t* k) {
    if (*k == kNoBlock) return;
    const int b = pattern_.column[*k];
    const uint32_t a = static_cast<uint32_t>(
        std::upper_bound(pattern_.row_start.begin(), pattern_.row_start.end(), size_t{*k}) -
        pattern_.row_start.begin() - 1);
    const int width = pattern_.widths[a];
    *k = static_cast<uint32_t>((row_offset_[a] + pattern_.offset[b] * GroupedRows(width) +
                                size_t{structure_.node_padded_offset[b]} * TailRows(width)) /
                               kFeatureRow);
  };
  ForEachLooseChunk(*slice, [&](uint32_t part, uint32_t begin, uint32_t end, size_t num_cross) {
    for (size_t i = begin * num_cross; i < end * num_cross; ++i) to_offset(&cross_[part][i]);
  });
}

// Offsets in sums that have the blocks which the slice touches, and no others.
void NormalEquations::PlaceInOwnSums(SliceData* slice) {
  std::vector<uint8_t> touched(pattern_.num_blocks());
  for (uint32_t k : slice->pairs) {
    if (k != kNoBlock) touched[k] = 1;
  }
  ForEachLooseChunk(*slice, [&](uint32_t part, uint32_t begin, uint32_t end, size_t num_cross) {
    const size_t n = structure_.parts[part].num_segments;
    for (size_t i = begin * n; i < end * n; ++i) {
      const uint32_t node = structure_.parts[part].nodes[i];
      if (node != kNoNode) touched[pattern_.row_start[node + 1] - 1] = 1;
    }
    for (size_t i = begin * num_cross; i < end * num_cross; ++i) {
      if (cross_[part][i] != kNoBlock) touched[cross_[part][i]] = 1;
    }
  });

  slice->blocks.clear();
  slice->block_offset.clear();
  slice->diagonal_offset.assign(structure_.num_nodes(), kNoBlock);
  std::vector<uint32_t> offset_of(pattern_.num_blocks(), kNoBlock);  // in units of kFeatureRow
  size_t offset = 0;
  for (uint32_t a = 0; a < structure_.num_nodes(); ++a) {
    for (size_t k = pattern_.row_start[a]; k < pattern_.row_start[a + 1]; ++k) {
      if (!touched[k]) continue;
      offset_of[k] = static_cast<uint32_t>(offset / kFeatureRow);
      slice->blocks.push_back(static_cast<uint32_t>(k));
      slice->block_offset.push_back(offset_of[k]);
      if (pattern_.column[k] == static_cast<int>(a)) slice->diagonal_offset[a] = offset_of[k];
      offset += SumBlockSize(pattern_.widths[a], pattern_.widths[pattern_.column[k]]);
    }
  }
  slice->sums_size = offset;
  HOLBA_CHECK_MSG(slice->sums_size / kFeatureRow < kNoBlock, "reduced system too large");

  const auto to_offset = [&](uint32_t* k) {
    if (*k != kNoBlock) *k = offset_of[*k];
  };
  for (uint32_t& k : slice->pairs) to_offset(&k);
  ForEachLooseChunk(*slice, [&](uint32_t part, uint32_t begin, uint32_t end, size_t num_cross) {
    for (size_t i = begin * num_cross; i < end * num_cross; ++i) to_offset(&cross_[part][i]);
  });
}

}  // namespace holba::native
