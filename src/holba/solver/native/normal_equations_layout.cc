// SPDX-License-Identifier: BSD-3-Clause
// Before the first number: structure, pattern, slices, and where the sums of each slice stand.
#include <algorithm>
#include <cstring>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {
namespace {

// A slice is worth a thread from some 100 microseconds on (in units of Structure::Work, about
// cycles), and more than 16 would only cost memory.
constexpr double kMinSliceWork = 3e5;
constexpr size_t kMaxSlices = 16;
// Where every slice touches most of the matrix, clearing and adding up its sums costs about this
// work a byte; it may take this share of the whole.
constexpr double kMergeWorkPerByte = 0.25, kMaxMergeShare = 0.15;
// ... and this much memory; but two threads get sums of their own whatever they cost.
constexpr size_t kFreeSliceBytes = size_t{1} << 20, kMinCopies = 2;

// A pattern with this share of its blocks is completed: finding blocks by their nodes alone is
// worth more than the zeros cost.
constexpr double kFullDensity = 0.75;

}  // namespace

bool NormalEquations::Begin(const Problem& problem, int num_threads) {
  const Fingerprint fingerprint = FingerprintOf(problem);
  const bool known =
      problem_ != nullptr && fingerprint == fingerprint_ && num_threads_ == NumThreads(num_threads);
  if (known) {
    for (Part& part : structure_.parts) part.batch = problem.batches()[part.batch_idx].get();
  } else {
    problem_ = nullptr;  // nothing is known should the problem be refused
    pattern_found_ = formed_ = false;
    num_threads_ = NumThreads(num_threads);
    structure_.Build(problem);
    fingerprint_ = fingerprint;
  }
  problem_ = &problem;
  memory_.assign(problem.batches().size(), {});
  AddFixedCosts();
  return known;
}

const BlockPattern& NormalEquations::FindPattern() {
  if (!pattern_found_) MakePattern(SchurForm::kExplicit);
  pattern_found_ = true;
  return pattern_;
}

void NormalEquations::MakePattern(SchurForm form) {
  formed_ = false;
  const uint32_t n = static_cast<uint32_t>(structure_.num_nodes());
  const uint32_t first_row = form == SchurForm::kExplicit ? 0 : structure_.num_pose_nodes;
  // What couples a node with earlier ones: its cliques, and residuals without a feature.
  const Cliques& cliques = structure_.cliques;
  std::vector<uint32_t> begin(n + 1), cliques_of(cliques.nodes.size());
  for (uint32_t node : cliques.nodes) ++begin[node];
  uint32_t end = 0;
  for (uint32_t& of_node : begin) of_node = end += of_node;
  for (uint32_t c = 0; c < cliques.size(); ++c) {
    for (uint32_t node : cliques.Nodes(c)) cliques_of[--begin[node]] = c;
  }
  std::vector<std::pair<uint32_t, uint32_t>> loose;  // later, earlier
  for (const Part& part : structure_.parts) {
    if (part.feature_slot >= 0 || part.num_segments < 2) continue;
    for (size_t j = 0; j < part.residuals.size(); ++j) {
      const uint32_t* nodes = &part.nodes[j * part.num_segments];
      for (int s = 0; s < part.num_segments; ++s) {
        for (int t = 0; t < s; ++t) {
          if (nodes[s] == kNone || nodes[t] == kNone || nodes[s] == nodes[t]) continue;
          loose.emplace_back(std::max(nodes[s], nodes[t]), std::min(nodes[s], nodes[t]));
        }
      }
    }
  }
  std::sort(loose.begin(), loose.end());

  BlockPattern pattern;
  pattern.widths.assign(structure_.node_width.begin(), structure_.node_width.end());
  pattern.row_start.assign(1, 0);
  std::vector<uint32_t> row_of(n, kNone);  // the last row that a node is coupled with
  size_t next_loose = 0;
  for (uint32_t a = 0; a < n; ++a) {
    const size_t row_begin = pattern.column.size();
    const auto couple = [&](uint32_t b) {
      if (std::exchange(row_of[b], a) != a) pattern.column.push_back(static_cast<int>(b));
    };
    while (next_loose < loose.size() && loose[next_loose].first < a) ++next_loose;
    if (a >= first_row) {
      for (uint32_t i = begin[a]; i < begin[a + 1]; ++i) {
        for (uint32_t b : cliques.Nodes(cliques_of[i])) {
          if (b >= a) break;
          couple(b);
        }
      }
      for (; next_loose < loose.size() && loose[next_loose].first == a; ++next_loose)
        couple(loose[next_loose].second);
      std::sort(pattern.column.begin() + row_begin, pattern.column.end());
    }
    pattern.column.push_back(static_cast<int>(a));
    pattern.row_start.push_back(pattern.column.size());
  }
  const double num_pairs = 0.5 * n * (n + 1.0);
  if (form == SchurForm::kExplicit &&
      static_cast<double>(pattern.column.size()) >= kFullDensity * num_pairs) {
    pattern.column.clear();
    for (uint32_t a = 0; a < n; ++a) {
      for (uint32_t b = 0; b <= a; ++b) pattern.column.push_back(static_cast<int>(b));
      pattern.row_start[a + 1] = pattern.column.size();
    }
  }
  if (pattern_version_ > 0 && pattern.widths == pattern_.widths &&
      pattern.row_start == pattern_.row_start && pattern.column == pattern_.column)
    return;
  pattern_ = std::move(pattern);
  pattern_.Finish();
  ++pattern_version_;
}

void NormalEquations::SetForm(SchurForm form) {
  if (formed_ && form == form_) return;
  form_ = form;
  if (form == SchurForm::kExplicit) {
    FindPattern();
  } else {
    MakePattern(form);
    pattern_found_ = false;
  }
  formed_ = true;
  S_ = BlockMatrix(&pattern_);
  U_ = IsImplicit() ? BlockMatrix(&pattern_) : BlockMatrix();

  const size_t n = structure_.num_nodes();
  row_offset_.resize(n + 1);
  unknown_offset_.resize(n);
  row_offset_[0] = 0;
  for (size_t a = 0; a < n; ++a) {
    size_t size = 0;
    if (pattern_.full) {
      const int width = structure_.node_width[a];
      size = pattern_.offset[a] * GroupedRows(width) +
             size_t{structure_.node_padded_offset[a]} * TailRows(width) +
             SumBlockSize(width, width);
    }
    row_offset_[a + 1] = row_offset_[a] + size;
    unknown_offset_[a] = static_cast<uint32_t>(pattern_.offset[a]);
  }
  MakeSlices();
  for (size_t i = 0; i < num_slices_; ++i) MakeOffsets(slices_[i].get());

  factors_.resize(structure_.factors_size + kPanelLanes);
  if (IsImplicit()) {
    stored_begin_.resize(structure_.chunks.size() + 1);
    stored_begin_[0] = 0;
    for (size_t c = 0; c < structure_.chunks.size(); ++c)
      stored_begin_[c + 1] = stored_begin_[c] + structure_.chunks[c].w_size;
    stored_.resize(stored_begin_.back() + kPanelLanes);
  } else {
    stored_.clear();
  }
  size_t max_parts = 1;
  for (const Chunk& chunk : structure_.chunks)
    max_parts = std::max<size_t>(max_parts, chunk.parts_end - chunk.parts_begin);
  const size_t num_scratches = std::min<size_t>(num_threads_, std::max<size_t>(num_slices_, 1));
  while (scratches_.size() < num_scratches) scratches_.push_back(std::make_unique<Scratch>());
  for (const auto& scratch : scratches_) scratch->Reserve(structure_, max_parts);
  const size_t padded = structure_.padded_size() + kMaxTangent + kPanelLanes;
  for (auto* vector : {&gradient_, &diagonal_, &reduction_, &damping_, &padded_step_, &padded_sum_})
    vector->assign(padded, 0.0);
  rhs_.assign(pattern_.num_unknowns, 0.0);
}

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
    count = std::min(count, 8.0);  // each has vectors of all nodes
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
  const Structure& s = structure_;
  const size_t padded = s.padded_size() + kMaxTangent + kPanelLanes;
  slice->gradient.resize(padded);
  slice->diagonal.resize(padded);
  slice->reduction.resize(padded);
  const bool own_blocks = !pattern_.full;  // else every block has the place it has in the matrix
  const bool implicit = IsImplicit();

  // Pairs of the cliques, as blocks of the whole pattern.
  slice->pairs_begin.clear();
  slice->pairs.clear();
  slice->blocks.clear();
  slice->block_offset.clear();
  uint32_t clique_end = 0;
  slice->first_clique = kNone;
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = s.chunks[c];
    if (chunk.feature_begin == chunk.feature_end) continue;
    if (slice->first_clique == kNone) slice->first_clique = s.feature_clique[chunk.feature_begin];
    clique_end = s.feature_clique[chunk.feature_end - 1] + 1;
  }
  if (slice->first_clique == kNone) slice->first_clique = clique_end = 0;
  std::vector<uint8_t> touched;
  if (own_blocks) {
    touched.resize(pattern_.num_blocks());
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
        const bool kept_row = !implicit || a >= s.num_pose_nodes;
        size_t k = pattern_.row_start[a];
        for (size_t q = 0; q < p; ++q) {
          if (!kept_row) {
            slice->pairs.push_back(kNoBlock);
            continue;
          }
          // Ascending columns meet ascending nodes.
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
    for (uint32_t k : slice->pairs) {
      if (k != kNoBlock) touched[k] = 1;
    }
  }
  // Residuals without a feature.
  cross_.resize(s.parts.size());
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = s.chunks[c];
    if (chunk.feature_tangent != 0) continue;
    const ChunkPart& cp = s.chunk_parts[chunk.parts_begin];
    const Part& part = s.parts[cp.part];
    const int n = part.num_segments, num_cross = n * (n - 1) / 2;
    std::vector<uint32_t>& cross = cross_[cp.part];
    cross.resize(part.residuals.size() * num_cross);
    for (uint32_t j = cp.begin; j < cp.end; ++j) {
      const uint32_t* nodes = &part.nodes[static_cast<size_t>(j) * n];
      uint32_t* out = cross.data() + static_cast<size_t>(j) * num_cross;
      for (int a = 0; a < n; ++a) {
        if (own_blocks && nodes[a] != kNone) touched[pattern_.row_start[nodes[a] + 1] - 1] = 1;
        for (int b = 0; b < a; ++b, ++out) {
          *out = kNoBlock;
          if (nodes[a] == kNone || nodes[b] == kNone) continue;
          const size_t k = pattern_.Find(static_cast<int>(std::max(nodes[a], nodes[b])),
                                         static_cast<int>(std::min(nodes[a], nodes[b])));
          if (k == pattern_.num_blocks()) continue;
          *out = static_cast<uint32_t>(k);
          if (own_blocks) touched[k] = 1;
        }
      }
    }
  }

  // Blocks become offsets.
  std::vector<uint32_t> offset_of;  // of blocks, in this slice, in units of kFeatureRow doubles
  slice->diagonal_offset.assign(s.num_nodes(), kNoBlock);
  if (own_blocks) {
    offset_of.assign(pattern_.num_blocks(), kNoBlock);
    size_t offset = 0;
    for (uint32_t a = 0; a < s.num_nodes(); ++a) {
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
  } else {
    for (uint32_t a = 0; a < s.num_nodes(); ++a) {
      slice->diagonal_offset[a] = static_cast<uint32_t>(
          (row_offset_[a + 1] - SumBlockSize(pattern_.widths[a], pattern_.widths[a])) /
          kFeatureRow);
    }
    slice->sums_size = row_offset_.back();
  }
  HOLBA_CHECK_MSG(slice->sums_size / kFeatureRow < kNoBlock, "reduced system too large");
  const auto to_offset = [&](uint32_t* k) {
    if (*k == kNoBlock) return;
    if (own_blocks) {
      *k = offset_of[*k];
      return;
    }
    const int b = pattern_.column[*k];
    const uint32_t a = static_cast<uint32_t>(
        std::upper_bound(pattern_.row_start.begin(), pattern_.row_start.end(), size_t{*k}) -
        pattern_.row_start.begin() - 1);
    const int width = pattern_.widths[a];
    *k = static_cast<uint32_t>((row_offset_[a] + pattern_.offset[b] * GroupedRows(width) +
                                size_t{s.node_padded_offset[b]} * TailRows(width)) /
                               kFeatureRow);
  };
  for (uint32_t& k : slice->pairs) to_offset(&k);
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = s.chunks[c];
    if (chunk.feature_tangent != 0) continue;
    const ChunkPart& cp = s.chunk_parts[chunk.parts_begin];
    const int n = s.parts[cp.part].num_segments;
    const size_t num_cross = n * (n - 1) / 2;
    for (size_t j = cp.begin * num_cross; j < cp.end * num_cross; ++j)
      to_offset(&cross_[cp.part][j]);
  }

  Scratch::Grow(&slice->own_S, slice->sums_size);
  slice->S = slice->own_S.data();
  slice->U = slice->S;
  if (implicit) {
    Scratch::Grow(&slice->own_U, slice->sums_size);
    slice->U = slice->own_U.data();
  }
}

}  // namespace holba::native
