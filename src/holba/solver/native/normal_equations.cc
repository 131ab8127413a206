// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/normal_equations.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/base/timer.h"
#include "holba/problem/weigh.h"

namespace holba::native {
namespace {

// A slice is worth a thread from some 100 microseconds on (in units of Structure::Work, about
// cycles), and more than 16 would only cost memory.
constexpr double kMinSliceWork = 3e5;
constexpr size_t kMaxSlices = 16;
// Where every slice touches most of the matrix, clearing and adding up its sums costs about this
// work a byte; it may take this share of the whole.
constexpr double kMergeWorkPerByte = 0.25, kMaxMergeShare = 0.15;
// ... and this much memory beside the matrix, as multiples of it, or at least in bytes.
constexpr size_t kMaxCopies = 2, kFreeSliceBytes = size_t{1} << 20;

// A pattern with this share of its blocks is completed: finding blocks by their nodes alone is worth
// more than the zeros cost.
constexpr double kFullDensity = 0.75;

constexpr size_t RoundUp(size_t n, size_t unit) { return (n + unit - 1) / unit * unit; }

void Grow(AlignedDoubles* buffer, size_t size) {
  if (buffer->size() < size) *buffer = AlignedDoubles(size);
}

}  // namespace

// The residuals of a chunk part at one state.
struct NormalEquations::Evaluated {
  ResidualPanel panel;
  size_t count = 0, absent = 0;
  PanelCost cost;
};

struct NormalEquations::Scratch {
  AlignedDoubles panel, rows, W, V, jk, pulled, step_of_features, trial_panel;
  std::vector<uint32_t> first_position, w_offset;
  std::vector<int64_t> bases, base_of_position;
  std::vector<Panel> panels;  // by part of the chunk
  std::vector<Evaluated> evaluated;
  std::unique_ptr<bool[]> present, trial_present;
  size_t present_size = 0;
  std::atomic<bool> busy = false;
  // Used so far, by the chunk being worked on.
  size_t panel_used = 0, present_used = 0;
  bool trial = false;  // Evaluate uses the trial's buffers

  void Reserve(const Structure& s, size_t max_parts) {
    Grow(&panel, s.max_panel);
    Grow(&rows, s.max_rows);
    Grow(&W, s.max_w);
    Grow(&V, s.max_features * kMaxFeatureTangent * kFeatureRow);
    Grow(&jk, s.max_panel);
    Grow(&pulled, s.max_residuals * kMaxFeatureTangent);
    Grow(&step_of_features, s.max_features * kFeatureRow);
    Grow(&trial_panel, s.max_residuals * kMaxResidualDim);
    first_position.resize(std::max(first_position.size(), s.max_features + 1));
    w_offset.resize(std::max(w_offset.size(), s.max_positions + 1));
    bases.resize(std::max(bases.size(), s.max_residuals * kMaxSegments));
    base_of_position.resize(w_offset.size());
    panels.resize(std::max(panels.size(), max_parts));
    evaluated.resize(panels.size());
    const size_t needed = s.max_residuals * max_parts;
    if (present_size < needed) {
      present = std::make_unique<bool[]>(needed);
      trial_present = std::make_unique<bool[]>(needed);
      present_size = needed;
    }
  }
};

struct NormalEquations::SliceData {
  uint32_t chunk_begin = 0, chunk_end = 0;
  // Sums; U and S are the whole matrix's own if there is one slice only.
  AlignedDoubles own_U, own_S;
  double *U = nullptr, *S = nullptr;
  size_t sums_size = 0;
  std::vector<double> gradient, diagonal, reduction, product;
  // Blocks of the pattern that it adds to, ascending, and where they stand; empty with a full
  // pattern or a single slice: where they stand in the whole matrix.
  std::vector<uint32_t> blocks, block_offset, diagonal_offset;
  uint32_t first_clique = 0;
  std::vector<size_t> pairs_begin;
  std::vector<uint32_t> pairs;

  std::vector<TermCost> cost, trial_cost;
  double evaluation_seconds = 0.0, seconds = 0.0;  // of the last linearisation
  std::vector<TermCost> appeared;                  // by batch, at the trial state
  double max_gradient = 0.0, model_change = 0.0, step_squares = 0.0, state_squares = 0.0;
  // Residuals that are present here and absent at the trial state.
  struct Vanishing {
    int batch;
    uint32_t residual;
    double values[kMaxResidualDim];
  };
  std::vector<Vanishing> vanishing;
};

void StateCost::CountAppeared() {
  for (size_t b = 0; b < appeared.size(); ++b) {
    batches[b].sum_squares += appeared[b].sum_squares;
    batches[b].cost += appeared[b].cost;
    total += appeared[b].cost;
    appeared[b] = {};
  }
}

NormalEquations::NormalEquations() = default;
NormalEquations::~NormalEquations() = default;

bool NormalEquations::Begin(const Problem& problem, int num_threads) {
  const Fingerprint fingerprint = FingerprintOf(problem);
  const bool known = problem_ != nullptr && fingerprint == fingerprint_ &&
                     num_threads_ == NumThreads(num_threads);
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

void NormalEquations::AddFixedCosts() {
  fixed_costs_.assign(problem_->batches().size(), {});
  for (const Part& part : structure_.parts) {
    if (part.feature_slot >= 0 || part.num_segments > 0) continue;
    TermCost& cost = fixed_costs_[part.batch_idx];
    double residual[kMaxResidualDim];
    bool present = false;
    ResidualPanel panel;
    panel.residuals = residual;
    panel.present = &present;
    const ParameterReader reader = problem_->Reader();
    for (uint32_t i : part.residuals) {
      part.batch->Evaluate(i, i + 1, reader, panel);
      ++cost.residuals;
      if (!present) {
        ++cost.absent;
        continue;
      }
      double s = 0.0;
      for (int k = 0; k < part.batch->dim(); ++k) s += residual[k] * residual[k];
      cost.sum_squares += s;
      cost.cost += 0.5 * part.batch->weight * part.batch->loss.Cost(s);
    }
  }
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
  U_ = form == SchurForm::kImplicit ? BlockMatrix(&pattern_) : BlockMatrix();

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
  if (form == SchurForm::kImplicit) {
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
  const double matrix_bytes =
      8.0 * static_cast<double>(std::max<size_t>(
                1, pattern_.full ? row_offset_.back() : S_.values.size()));
  double count = std::clamp<double>(total / kMinSliceWork, 1.0, kMaxSlices);
  const double n = static_cast<double>(pattern_.num_nodes());
  if (static_cast<double>(pattern_.num_blocks()) > 0.2 * n * n) {
    const double by_work = kMaxMergeShare * total / (kMergeWorkPerByte * matrix_bytes);
    const double by_memory = std::max(1.0 * kMaxCopies, kFreeSliceBytes / matrix_bytes);
    count = std::min(count, std::max(2.0, std::min(by_work, by_memory)));
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
  const bool own_blocks = !pattern_.full;
  const bool implicit = form_ == SchurForm::kImplicit;

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
  if (own_blocks) touched.resize(pattern_.num_blocks());
  if (!pattern_.full) {
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
    if (own_blocks) {
      for (uint32_t k : slice->pairs) {
        if (k != kNoBlock) touched[k] = 1;
      }
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

  Grow(&slice->own_S, slice->sums_size);
  slice->S = slice->own_S.data();
  slice->U = slice->S;
  if (implicit) {
    Grow(&slice->own_U, slice->sums_size);
    slice->U = slice->own_U.data();
  }
}

Sums NormalEquations::SumsOf(SliceData* slice) const {
  Sums sums;
  sums.U = slice->U;
  sums.S = slice->S;
  sums.gradient = slice->gradient.data();
  sums.diagonal = slice->diagonal.data();
  sums.reduction = slice->reduction.data();
  sums.padded_offset = structure_.node_padded_offset.data();
  sums.width = structure_.node_width.data();
  sums.diagonal_offset = slice->diagonal_offset.data();
  sums.row_offset = row_offset_.data();
  sums.unknown_offset = unknown_offset_.data();
  return sums;
}

ChunkFeatures NormalEquations::FeaturesOf(const Chunk& chunk, const SliceData& slice,
                                          Scratch* scratch) {
  ChunkFeatures out;
  out.tangent = chunk.feature_tangent;
  out.count = chunk.feature_end - chunk.feature_begin;
  out.stride = RoundUp(out.count, kPanelLanes);
  out.clique = structure_.feature_clique.data() + chunk.feature_begin;
  out.clique_begin = structure_.cliques.begin.data();
  out.clique_nodes = structure_.cliques.nodes.data();
  out.pairs_begin = pattern_.full ? nullptr : slice.pairs_begin.data();
  out.pairs = slice.pairs.data();
  out.first_clique = slice.first_clique;
  out.first_position = scratch->first_position.data();
  out.w_offset = scratch->w_offset.data();
  out.W = scratch->W.data();
  out.V = scratch->V.data();
  out.factors = factors_.data() + chunk.factor_begin;
  return out;
}

void NormalEquations::Evaluate(const ChunkPart& chunk_part, const double* state, bool jacobians,
                               Scratch* scratch, Evaluated* out) const {
  const Part& part = structure_.parts[chunk_part.part];
  const ResidualBatch& batch = *part.batch;
  const size_t count = chunk_part.end - chunk_part.begin, stride = PanelStride(count);
  out->count = count;
  out->panel.stride = stride;
  const auto take = [&](size_t entries) {
    if (scratch->trial) return scratch->trial_panel.data();
    double* memory = scratch->panel.data() + scratch->panel_used;
    scratch->panel_used += entries * stride;
    return memory;
  };
  out->panel.residuals = take(batch.dim());
  out->panel.jacobians = {};
  if (jacobians) {
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (part.wanted[s])
        out->panel.jacobians[s] = take(static_cast<size_t>(batch.dim()) * batch.tangent(s));
    }
  }
  if (scratch->trial) {
    out->panel.present = scratch->trial_present.get();
  } else {
    out->panel.present = scratch->present.get() + scratch->present_used;
    scratch->present_used += stride;
  }
  const uint32_t* list = part.residuals.data() + chunk_part.begin;
  ResidualRange range{list[0], count, nullptr};
  for (size_t j = 0; j < count; ++j) {
    if (list[j] != list[0] + j) {
      range.list = list;
      break;
    }
  }
  // The state may be the trial's: same offsets.
  const ParameterReader reader(state, problem_->Reader().offsets());
  batch.EvaluateRange(range, reader, out->panel);
  if (jacobians && !part.held.empty()) {
    auto held = std::lower_bound(
        part.held.begin(), part.held.end(), chunk_part.begin,
        [](const Part::Held& h, uint32_t residual) { return h.residual < residual; });
    for (; held != part.held.end() && held->residual < chunk_part.end; ++held) {
      const int tangent = batch.tangent(held->slot);
      double* J = out->panel.jacobians[held->slot] + (held->residual - chunk_part.begin);
      for (int c = 0; c < tangent; ++c) {
        if (!(held->coordinates >> c & 1)) continue;
        for (int k = 0; k < batch.dim(); ++k) J[(k * tangent + c) * stride] = 0.0;
      }
    }
  }
  out->cost =
      jacobians ? WeighPanel(batch, count, out->panel) : CostOfPanel(batch, count, out->panel);
  out->absent = out->cost.absent;
}

void NormalEquations::MakePanel(const ChunkPart& chunk_part, const Evaluated& evaluated,
                                Panel* panel) const {
  const Part& part = structure_.parts[chunk_part.part];
  panel->dim = part.batch->dim();
  panel->count = evaluated.count;
  panel->stride = evaluated.panel.stride;
  panel->residuals = evaluated.panel.residuals;
  panel->feature_jacobian =
      part.feature_slot >= 0 ? evaluated.panel.jacobians[part.feature_slot] : nullptr;
  panel->num_segments = part.num_segments;
  for (int s = 0; s < part.num_segments; ++s) {
    const Segment& from = part.segments[s];
    PanelSegment& to = panel->segments[s];
    to.width = from.width;
    to.padded = from.padded;
    to.num_parts = from.num_parts;
    for (int p = 0; p < from.num_parts; ++p) {
      const SegmentPart& piece = from.parts[p];
      to.parts[p] = {evaluated.panel.jacobians[piece.slot], piece.tangent, piece.first,
                     piece.columns.count, piece.columns.tangent.data()};
    }
  }
  const size_t first = static_cast<size_t>(chunk_part.begin) * part.num_segments;
  panel->local_feature =
      part.feature_slot >= 0 ? part.local_feature.data() + chunk_part.begin : nullptr;
  panel->positions = part.feature_slot >= 0 ? part.positions.data() + first : nullptr;
  panel->nodes = part.feature_slot >= 0 ? nullptr : part.nodes.data() + first;
  panel->row_stride = part.row_stride;
}

namespace {

void AddTo(TermCost* cost, size_t count, const PanelCost& panel) {
  cost->residuals += count;
  cost->absent += panel.absent;
  cost->sum_squares += panel.sum_squares;
  cost->cost += panel.cost;
}

void AddValue(const ResidualBatch& batch, const double* r, double* sum_squares, double* cost) {
  double s = 0.0;
  for (int k = 0; k < batch.dim(); ++k) s += r[k] * r[k];
  *sum_squares += s;
  *cost += 0.5 * batch.weight * batch.loss.Cost(s);
}

}  // namespace

// Absent residuals that were present before count what they were.
void NormalEquations::AddRemembered(const ChunkPart& chunk_part, const Evaluated& evaluated,
                                    TermCost* cost) const {
  const Part& part = structure_.parts[chunk_part.part];
  const Memory& memory = memory_[part.batch_idx];
  if (evaluated.absent == 0 || memory.known.empty()) return;
  const int dim = part.batch->dim();
  for (size_t j = 0; j < evaluated.count; ++j) {
    const uint32_t i = part.residuals[chunk_part.begin + j];
    if (evaluated.panel.present[j] || !memory.known[i]) continue;
    AddValue(*part.batch, &memory.values[static_cast<size_t>(i) * dim], &cost->sum_squares,
             &cost->cost);
  }
}

void NormalEquations::CompareWithTrial(const ChunkPart& chunk_part, const Evaluated& now,
                                       const Evaluated& trial, SliceData* slice) const {
  if (now.absent == 0 && trial.absent == 0) return;
  const Part& part = structure_.parts[chunk_part.part];
  const ResidualBatch& batch = *part.batch;
  const Memory& memory = memory_[part.batch_idx];
  TermCost& cost = slice->trial_cost[part.batch_idx];
  for (size_t j = 0; j < now.count; ++j) {
    const uint32_t i = part.residuals[chunk_part.begin + j];
    const bool known = !memory.known.empty() && memory.known[i];
    if (!trial.panel.present[j]) {
      if (now.panel.present[j]) {
        SliceData::Vanishing& vanishing = slice->vanishing.emplace_back();
        vanishing.batch = part.batch_idx;
        vanishing.residual = i;
        ResidualPanel one;
        bool present = false;
        one.residuals = vanishing.values;
        one.present = &present;
        batch.Evaluate(i, i + 1, problem_->Reader(), one);
        AddValue(batch, vanishing.values, &cost.sum_squares, &cost.cost);
      } else if (known) {
        AddValue(batch, &memory.values[static_cast<size_t>(i) * batch.dim()], &cost.sum_squares,
                 &cost.cost);
      }
    } else if (!now.panel.present[j] && !known) {
      double r[kMaxResidualDim];
      for (int k = 0; k < batch.dim(); ++k)
        r[k] = trial.panel.residuals[k * trial.panel.stride + j];
      double squares = 0.0, value = 0.0;
      AddValue(batch, r, &squares, &value);
      // It was counted with the others that are present.
      cost.sum_squares -= squares;
      cost.cost -= value;
      slice->appeared[part.batch_idx].sum_squares += squares;
      slice->appeared[part.batch_idx].cost += value;
    }
  }
}

template <typename Body>
void NormalEquations::ForEachSlice(const Body& body) {
  ParallelTasks(num_slices_ > 1 ? num_threads_ : 1, num_slices_, [&](size_t i) {
    // As many scratches as threads: one is free.
    for (size_t s = 0;; s = (s + 1) % scratches_.size()) {
      if (scratches_[s]->busy.exchange(true, std::memory_order_acquire)) continue;
      body(slices_[i].get(), scratches_[s].get());
      scratches_[s]->busy.store(false, std::memory_order_release);
      return;
    }
  });
}

void NormalEquations::LineariseSlice(
    SliceData* slice, double inverse_radius, Scratch* scratch,
    const FunctionRef<void(const Chunk&, const ChunkFeatures&, const Sums&)>* visit) {
  const Sums sums = SumsOf(slice);
  std::memset(slice->S, 0, slice->sums_size * sizeof(double));
  if (slice->U != slice->S) std::memset(slice->U, 0, slice->sums_size * sizeof(double));
  for (auto* vector : {&slice->gradient, &slice->diagonal, &slice->reduction})
    std::fill(vector->begin(), vector->end(), 0.0);
  slice->cost.assign(problem_->batches().size(), {});
  slice->max_gradient = slice->evaluation_seconds = 0.0;
  const Timer slice_timer;
  const auto rows_from_panel = HOLBA_SIMD_CHOOSE_IN(::holba::native, RowsFromPanel);
  const double* state = problem_->state().data();
  scratch->trial = false;
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = structure_.chunks[c];
    ChunkFeatures features;
    if (chunk.feature_tangent > 0) {
      features = FeaturesOf(chunk, *slice, scratch);
      HOLBA_SIMD_CHOOSE_IN(::holba::native, BeginChunk)(features, sums);
    }
    Panel panel;
    for (uint32_t p = chunk.parts_begin; p < chunk.parts_end; ++p) {
      const ChunkPart& chunk_part = structure_.chunk_parts[p];
      const Part& part = structure_.parts[chunk_part.part];
      scratch->panel_used = scratch->present_used = 0;
      Evaluated evaluated;
      const Timer evaluation_timer;
      Evaluate(chunk_part, state, true, scratch, &evaluated);
      slice->evaluation_seconds += evaluation_timer.Seconds();
      TermCost& cost = slice->cost[part.batch_idx];
      AddTo(&cost, evaluated.count, evaluated.cost);
      AddRemembered(chunk_part, evaluated, &cost);
      MakePanel(chunk_part, evaluated, &panel);
      rows_from_panel(panel, chunk.feature_tangent, scratch->rows.data());
      if (chunk.plain && visit == nullptr) {
        HOLBA_SIMD_CHOOSE_IN(::holba::native, AccumulatePlain)
        (panel, scratch->rows.data(), features);
      } else if (chunk.feature_tangent > 0) {
        HOLBA_SIMD_CHOOSE_IN(::holba::native, Accumulate)
        (panel, scratch->rows.data(), features, sums);
      } else {
        const size_t n = part.num_segments;
        HOLBA_SIMD_CHOOSE_IN(::holba::native, AccumulateLoose)
        (panel, scratch->rows.data(),
         cross_[chunk_part.part].data() + chunk_part.begin * (n * (n - 1) / 2), sums);
      }
    }
    if (chunk.feature_tangent > 0) {
      const ChunkSums figures =
          HOLBA_SIMD_CHOOSE_IN(::holba::native, FactoriseFeatures)(features, inverse_radius);
      if (!(figures.max_gradient <= slice->max_gradient))
        slice->max_gradient = figures.max_gradient;
      float* const stored =
          form_ == SchurForm::kImplicit ? stored_.data() + stored_begin_[c] : nullptr;
      if (visit != nullptr) {
        HOLBA_SIMD_CHOOSE_IN(::holba::native, FormT)(features, sums);
        (*visit)(chunk, features, sums);
      } else if (chunk.plain) {
        HOLBA_SIMD_CHOOSE_IN(::holba::native, EliminatePlain)
        (panel, scratch->rows.data(), features, sums, stored);
      } else {
        HOLBA_SIMD_CHOOSE_IN(::holba::native, Eliminate)(features, sums, stored);
      }
    }
  }
  slice->seconds = slice_timer.Seconds();
}

// Slices' blocks into S (and U), in the order of the slices.
void NormalEquations::MergeBlocks() {
  const bool implicit = form_ == SchurForm::kImplicit;
  const auto add_block = HOLBA_SIMD_CHOOSE_IN(::holba::native, AddSumBlock);
  constexpr uint32_t kRows = 8;
  const uint32_t n = static_cast<uint32_t>(structure_.num_nodes());
  ParallelTasks(num_slices_ > 1 ? num_threads_ : 1, (n + kRows - 1) / kRows, [&](size_t task) {
    const uint32_t row_begin = static_cast<uint32_t>(task) * kRows,
                   row_end = std::min(row_begin + kRows, n);
    const size_t first = pattern_.row_start[row_begin], last = pattern_.row_start[row_end];
    if (!pattern_.full) {
      const size_t begin = S_.block_offset[first];
      const size_t end = last < S_.block_offset.size() ? S_.block_offset[last] : S_.values.size();
      std::fill(S_.values.data() + begin, S_.values.data() + end, 0.0);
      if (implicit) std::fill(U_.values.data() + begin, U_.values.data() + end, 0.0);
    }
    for (size_t s = 0; s < num_slices_; ++s) {
      const SliceData& slice = *slices_[s];
      const bool clear = pattern_.full && s == 0;
      uint32_t a = row_begin;
      const auto add = [&](size_t k, size_t from) {
        while (k >= pattern_.row_start[a + 1]) ++a;
        const int width_a = pattern_.widths[a], width_b = pattern_.widths[pattern_.column[k]];
        add_block(slice.S + from, width_a, width_b, clear, S_.Block(k));
        if (!implicit) return;
        add_block(slice.U + from, width_a, width_b, false, S_.Block(k));
        add_block(slice.U + from, width_a, width_b, clear, U_.Block(k));
      };
      if (pattern_.full) {
        size_t from = row_offset_[row_begin];
        for (size_t k = first; k < last; ++k) {
          add(k, from);
          from += SumBlockSize(pattern_.widths[a], pattern_.widths[pattern_.column[k]]);
        }
        continue;
      }
      size_t i =
          std::lower_bound(slice.blocks.begin(), slice.blocks.end(), first) - slice.blocks.begin();
      for (; i < slice.blocks.size() && slice.blocks[i] < last; ++i)
        add(slice.blocks[i], size_t{slice.block_offset[i]} * kFeatureRow);
    }
  });
}

void NormalEquations::Linearise(double radius, Linearisation* out) {
  ForEachSlice([&](SliceData* slice, Scratch* scratch) {
    LineariseSlice(slice, 1.0 / radius, scratch, nullptr);
  });
  MergeBlocks();
  const size_t padded = structure_.padded_size();
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  std::fill(diagonal_.begin(), diagonal_.end(), 0.0);
  std::fill(reduction_.begin(), reduction_.end(), 0.0);
  out->max_gradient = 0.0;
  double evaluation_seconds = 0.0, seconds = 0.0;
  for (size_t s = 0; s < num_slices_; ++s) {
    const SliceData& slice = *slices_[s];
    evaluation_seconds += slice.evaluation_seconds;
    seconds += slice.seconds;
    for (size_t i = 0; i < padded; ++i) {
      gradient_[i] += slice.gradient[i];
      diagonal_[i] += slice.diagonal[i];
      reduction_[i] += slice.reduction[i];
    }
    if (!(slice.max_gradient <= out->max_gradient)) out->max_gradient = slice.max_gradient;
  }
  double not_finite = 0.0;
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    const uint32_t at = structure_.node_padded_offset[n];
    const int width = structure_.node_width[n], stride = PaddedWidth(width);
    const size_t block = S_.block_offset[pattern_.row_start[n + 1] - 1];
    for (int i = 0; i < width; ++i) {
      const double d = diagonal_[at + i], root = 1.0 + std::sqrt(d);
      // As FactoriseFeatures.
      damping_[at + i] =
          structure_.held_column[at + i] ? 1.0 : std::max(d, 1e-6 * root * root) / radius;
      S_.values.data()[block + i * stride + i] += damping_[at + i];
      if (form_ == SchurForm::kImplicit)
        U_.values.data()[block + i * stride + i] += damping_[at + i];
      rhs_[pattern_.offset[n] + i] = reduction_[at + i] - gradient_[at + i];
      out->max_gradient = std::max(out->max_gradient, std::abs(gradient_[at + i]));
      not_finite += gradient_[at + i] - gradient_[at + i];
    }
  }
  out->max_gradient += not_finite;  // NaN, if any entry is
  out->evaluation_share = seconds > 0.0 ? evaluation_seconds / seconds : 1.0;
  CollectCost(false, &out->cost);
}

void NormalEquations::FeatureCovariances(const BlockMatrix& Z, std::vector<size_t>* begin,
                                         std::vector<double>* covariances) {
  const Structure& s = structure_;
  begin->resize(s.features.size() + 1);
  (*begin)[0] = 0;
  for (const Chunk& chunk : s.chunks) {
    for (uint32_t f = chunk.feature_begin; f < chunk.feature_end; ++f)
      (*begin)[f + 1] = (*begin)[f] + chunk.feature_tangent * chunk.feature_tangent;
  }
  covariances->resize(begin->back());
  ForEachSlice([&](SliceData* slice, Scratch* scratch) {
    std::vector<size_t> z_offset, z_begin;
    const auto visit = [&](const Chunk& chunk, const ChunkFeatures& features, const Sums& sums) {
      z_offset.clear();
      z_begin.clear();
      uint32_t last = kNone;
      for (size_t f = 0; f < features.count; ++f) {
        if (features.clique[f] == last) {
          z_begin.push_back(z_begin.back());
          continue;
        }
        last = features.clique[f];
        z_begin.push_back(z_offset.size());
        const auto nodes = s.cliques.Nodes(last);
        for (size_t p = 0; p < nodes.size(); ++p) {
          // Ascending columns meet ascending nodes.
          size_t k = pattern_.row_start[nodes[p]];
          const size_t end = pattern_.row_start[nodes[p] + 1];
          for (size_t q = 0; q <= p; ++q) {
            const int b = static_cast<int>(nodes[q]);
            if (pattern_.column[k] != b) {
              k = std::lower_bound(pattern_.column.begin() + k, pattern_.column.begin() + end, b) -
                  pattern_.column.begin();
            }
            z_offset.push_back(Z.block_offset[k]);
          }
        }
      }
      double* const out = covariances->data() + (*begin)[chunk.feature_begin];
      HOLBA_SIMD_CHOOSE_IN(::holba::native, FeatureCovariances)
      (features, sums, Z.values.data(), z_offset.data(), z_begin.data(), out);
      // What no residual fixes is anywhere.
      const int F = chunk.feature_tangent;
      for (size_t f = 0; f < features.count; ++f) {
        for (int i = 0; i < F; ++i) {
          if (features.factors[(i * (i + 1) / 2 + i) * features.stride + f] != 0.0) continue;
          if (problem_->block(s.features[chunk.feature_begin + f]).held >> i & 1) continue;
          std::fill_n(out + f * F * F, F * F, std::numeric_limits<double>::infinity());
        }
      }
    };
    const FunctionRef<void(const Chunk&, const ChunkFeatures&, const Sums&)> reference(visit);
    LineariseSlice(slice, 0.0, scratch, &reference);
  });
}

void NormalEquations::CollectCost(bool trial, StateCost* out) const {
  const size_t n = problem_->batches().size();
  out->batches.resize(n);
  out->total = 0.0;
  out->appeared.assign(n, {});
  for (size_t b = 0; b < n; ++b) {
    TermCost& sum = out->batches[b];
    sum.residuals = fixed_costs_[b].residuals;
    sum.absent = fixed_costs_[b].absent;
    sum.sum_squares = fixed_costs_[b].sum_squares;
    sum.cost = fixed_costs_[b].cost;
    for (size_t s = 0; s < num_slices_; ++s) {
      const TermCost& part = trial ? slices_[s]->trial_cost[b] : slices_[s]->cost[b];
      sum.residuals += part.residuals;
      sum.absent += part.absent;
      sum.sum_squares += part.sum_squares;
      sum.cost += part.cost;
    }
    out->total += sum.cost;
  }
  if (trial) {
    for (size_t s = 0; s < num_slices_; ++s) {
      for (size_t b = 0; b < n; ++b) {
        out->appeared[b].sum_squares += slices_[s]->appeared[b].sum_squares;
        out->appeared[b].cost += slices_[s]->appeared[b].cost;
      }
    }
  }
}

void NormalEquations::MultiplyEliminated(const double* x, double* y) {
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    std::copy_n(x + pattern_.offset[n], structure_.node_width[n],
                padded_sum_.data() + structure_.node_padded_offset[n]);
  }
  const size_t padded = structure_.padded_size() + kPanelLanes;
  ForEachSlice([&](SliceData* slice, Scratch* scratch) {
    slice->product.assign(padded, 0.0);
    const Sums sums = SumsOf(slice);
    for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
      const Chunk& chunk = structure_.chunks[c];
      if (chunk.feature_tangent == 0) continue;
      HOLBA_SIMD_CHOOSE_IN(::holba::native, MultiplyStored)
      (FeaturesOf(chunk, *slice, scratch), sums, stored_.data() + stored_begin_[c],
       padded_sum_.data(), slice->product.data());
    }
  });
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    const uint32_t at = structure_.node_padded_offset[n];
    for (int i = 0; i < structure_.node_width[n]; ++i) {
      double sum = 0.0;
      for (size_t s = 0; s < num_slices_; ++s) sum += slices_[s]->product[at + i];
      y[pattern_.offset[n] + i] = sum;
    }
  }
}

void NormalEquations::StepSlice(SliceData* slice, Scratch* scratch) {
  slice->trial_cost.assign(problem_->batches().size(), {});
  slice->appeared.assign(problem_->batches().size(), {});
  slice->model_change = slice->step_squares = slice->state_squares = 0.0;
  slice->vanishing.clear();
  const double* state = problem_->state().data();
  const uint32_t* padded_offset = structure_.node_padded_offset.data();
  const int64_t nothing = static_cast<int64_t>(structure_.padded_size());  // zeros
  std::vector<Panel>& panels = scratch->panels;
  std::vector<Evaluated>& evaluated = scratch->evaluated;
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = structure_.chunks[c];
    const uint32_t num_parts = chunk.parts_end - chunk.parts_begin;
    const int F = chunk.feature_tangent;
    ChunkFeatures features;
    double* h = scratch->step_of_features.data();
    int64_t* base_of_position = scratch->base_of_position.data();
    if (F > 0) {
      features = FeaturesOf(chunk, *slice, scratch);
      std::fill_n(h, features.stride * kFeatureRow, 0.0);
      uint32_t position = 0;
      for (size_t f = 0; f < features.count; ++f) {
        features.first_position[f] = position;
        for (uint32_t node : structure_.cliques.Nodes(features.clique[f]))
          base_of_position[position++] = padded_offset[node];
      }
    }
    scratch->trial = false;
    scratch->panel_used = scratch->present_used = 0;
    double* jk = scratch->jk.data();
    for (uint32_t p = 0; p < num_parts; ++p) {
      const ChunkPart& chunk_part = structure_.chunk_parts[chunk.parts_begin + p];
      const Part& part = structure_.parts[chunk_part.part];
      Evaluate(chunk_part, state, true, scratch, &evaluated[p]);
      Panel& panel = panels[p];
      MakePanel(chunk_part, evaluated[p], &panel);
      const int64_t* bases[kMaxSegments] = {};
      for (int s = 0; s < part.num_segments; ++s) {
        int64_t* base = scratch->bases.data() + s * panel.stride;
        bases[s] = base;
        for (size_t j = 0; j < panel.count; ++j) {
          const size_t at = j * part.num_segments + s;
          if (F > 0) {
            const uint16_t position = panel.positions[at];
            base[j] = position == kNoPosition
                          ? nothing
                          : base_of_position[features.first_position[panel.local_feature[j]] +
                                             (position & kPositionMask)];
          } else {
            base[j] = panel.nodes[at] == kNone ? nothing : padded_offset[panel.nodes[at]];
          }
        }
        for (size_t j = panel.count; j < panel.stride; ++j) base[j] = nothing;
      }
      HOLBA_SIMD_CHOOSE_IN(::holba::native, ApplyStep)
      (panel, F, padded_step_.data(), bases, jk, scratch->pulled.data());
      for (int i = 0; i < F; ++i) {
        // A feature's residuals stand side by side.
        const double* pulled = scratch->pulled.data() + i * panel.stride;
        for (size_t j = 0; j < panel.count;) {
          const uint16_t f = panel.local_feature[j];
          double sum = 0.0;
          for (; j < panel.count && panel.local_feature[j] == f; ++j) sum += pulled[j];
          h[f * kFeatureRow + i] += sum;
        }
      }
      jk += panel.dim * panel.stride;
    }
    if (F > 0) {
      HOLBA_SIMD_CHOOSE_IN(::holba::native, SolveFeatures)(features, h);
      for (size_t f = 0; f < features.count; ++f) {
        const size_t feature = chunk.feature_begin + f;
        const ManifoldOps& ops = *structure_.manifolds[structure_.feature_manifold[feature]];
        const size_t at = structure_.feature_at[feature];
        double* moved = trial_state_.data() + at;
        ops.plus(state + at, h + f * kFeatureRow, moved);
        for (int i = 0; i < ops.ambient; ++i) {
          const double d = moved[i] - state[at + i];
          slice->step_squares += d * d;
          slice->state_squares += state[at + i] * state[at + i];
        }
      }
    }
    jk = scratch->jk.data();
    scratch->trial = true;
    for (uint32_t p = 0; p < num_parts; ++p) {
      const ChunkPart& chunk_part = structure_.chunk_parts[chunk.parts_begin + p];
      slice->model_change +=
          HOLBA_SIMD_CHOOSE_IN(::holba::native, ModelChange)(panels[p], F, jk, h);
      jk += panels[p].dim * panels[p].stride;
      Evaluated trial;
      Evaluate(chunk_part, trial_state_.data(), false, scratch, &trial);
      AddTo(&slice->trial_cost[structure_.parts[chunk_part.part].batch_idx], trial.count,
            trial.cost);
      CompareWithTrial(chunk_part, evaluated[p], trial, slice);
    }
  }
}

void NormalEquations::Step(std::span<const double> kept_step, Trial* out) {
  const std::vector<double>& state = problem_->state();
  trial_state_ = state;
  double step_squares = 0.0, state_squares = 0.0;
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    std::copy_n(kept_step.data() + pattern_.offset[n], structure_.node_width[n],
                padded_step_.data() + structure_.node_padded_offset[n]);
  }
  for (BlockId id : structure_.node_blocks) {
    const KeptBlock& place = structure_.kept[id];
    const Columns& columns = structure_.block_columns[id];
    const ParameterBlock& block = problem_->block(id);
    if (block.constant) continue;
    double delta[kMaxTangent] = {};
    const double* step =
        padded_step_.data() + structure_.node_padded_offset[place.node] + place.first;
    for (int c = 0; c < columns.count; ++c) {
      if (!(block.held >> columns.tangent[c] & 1)) delta[columns.tangent[c]] = step[c];
    }
    const size_t at = offset_of(id);
    block.manifold->plus(state.data() + at, delta, trial_state_.data() + at);
    for (int i = 0; i < block.manifold->ambient; ++i) {
      const double d = trial_state_[at + i] - state[at + i];
      step_squares += d * d;
      state_squares += state[at + i] * state[at + i];
    }
  }
  ForEachSlice([&](SliceData* slice, Scratch* scratch) { StepSlice(slice, scratch); });
  out->model_change = 0.0;
  for (size_t s = 0; s < num_slices_; ++s) {
    out->model_change += slices_[s]->model_change;
    step_squares += slices_[s]->step_squares;
    state_squares += slices_[s]->state_squares;
  }
  out->step_norm = std::sqrt(step_squares);
  out->state_norm = std::sqrt(state_squares);
  CollectCost(true, &out->cost);
}

void NormalEquations::Accept(Problem* problem) {
  for (size_t s = 0; s < num_slices_; ++s) {
    for (const SliceData::Vanishing& v : slices_[s]->vanishing) {
      const ResidualBatch& batch = *problem_->batches()[v.batch];
      Memory& memory = memory_[v.batch];
      memory.known.resize(batch.size());
      memory.values.resize(batch.size() * batch.dim());
      memory.known[v.residual] = 1;
      std::copy_n(v.values, batch.dim(),
                  &memory.values[static_cast<size_t>(v.residual) * batch.dim()]);
    }
  }
  problem->state() = trial_state_;
}

}  // namespace holba::native
