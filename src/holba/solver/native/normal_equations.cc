// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/normal_equations.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "holba/base/timer.h"
#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {

NormalEquations::NormalEquations() = default;
NormalEquations::~NormalEquations() = default;

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
  sums.diagonal_only = form_ == SchurForm::kImplicit;
  return sums;
}

ChunkFeatures NormalEquations::FeaturesOf(const Chunk& chunk, const SliceData& slice,
                                          Scratch* scratch) {
  ChunkFeatures out;
  out.tangent = chunk.feature_tangent;
  out.count = chunk.feature_end - chunk.feature_begin;
  out.stride = FeatureStride(out.count);
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

void NormalEquations::ClearSums(SliceData* slice) const {
  std::memset(slice->S, 0, slice->sums_size * sizeof(double));
  if (slice->U != slice->S) std::memset(slice->U, 0, slice->sums_size * sizeof(double));
  for (auto* vector : {&slice->gradient, &slice->diagonal, &slice->reduction})
    std::fill(vector->begin(), vector->end(), 0.0);
  slice->cost.assign(problem_->batches().size(), {});
  slice->max_gradient = slice->evaluation_seconds = 0.0;
}

// Evaluates the residuals of one part of a chunk at the current state, and leaves their rows in the
// scratch memory.
void NormalEquations::MakeRows(const ChunkPart& chunk_part, SliceData* slice, Scratch* scratch,
                               Panel* panel) const {
  const Part& part = structure_.parts[chunk_part.part];
  scratch->panel_used = scratch->present_used = 0;
  Evaluated evaluated;
  const Timer timer;
  Evaluate(chunk_part, problem_->state().data(), true, scratch, &evaluated);
  slice->evaluation_seconds += timer.Seconds();
  TermCost& cost = slice->cost[part.batch_idx];
  AddTo(&cost, evaluated.count, evaluated.cost);
  AddRemembered(chunk_part, evaluated, &cost);
  MakePanel(chunk_part, evaluated, panel);
  HOLBA_SIMD_CHOOSE_IN(::holba::native, RowsFromPanel)
  (*panel, part.feature_tangent, scratch->rows.data());
}

void NormalEquations::LineariseFeatures(uint32_t chunk_idx, double inverse_radius, const Sums& sums,
                                        SliceData* slice, Scratch* scratch) {
  const Chunk& chunk = structure_.chunks[chunk_idx];
  const ChunkFeatures features = FeaturesOf(chunk, *slice, scratch);
  HOLBA_SIMD_CHOOSE_IN(::holba::native, BeginChunk)(features, sums);
  const double* const rows = scratch->rows.data();
  Panel panel;
  for (uint32_t p = chunk.parts_begin; p < chunk.parts_end; ++p) {
    MakeRows(structure_.chunk_parts[p], slice, scratch, &panel);
    if (chunk.plain) {
      HOLBA_SIMD_CHOOSE_IN(::holba::native, AccumulatePlain)(panel, rows, features);
    } else {
      HOLBA_SIMD_CHOOSE_IN(::holba::native, Accumulate)(panel, rows, features, sums);
    }
  }
  const ChunkSums chunk_sums =
      HOLBA_SIMD_CHOOSE_IN(::holba::native, FactoriseFeatures)(features, inverse_radius);
  // The negation lets a NaN through.
  if (!(chunk_sums.max_gradient <= slice->max_gradient))
    slice->max_gradient = chunk_sums.max_gradient;
  float* const stored = IsImplicit() ? stored_.data() + stored_begin_[chunk_idx] : nullptr;
  if (chunk.plain) {
    HOLBA_SIMD_CHOOSE_IN(::holba::native, EliminatePlain)(panel, rows, features, sums, stored);
  } else {
    HOLBA_SIMD_CHOOSE_IN(::holba::native, Eliminate)(features, sums, stored);
  }
}

void NormalEquations::LineariseLoose(const Chunk& chunk, const Sums& sums, SliceData* slice,
                                     Scratch* scratch) const {
  const ChunkPart& chunk_part = structure_.chunk_parts[chunk.parts_begin];
  const size_t n = structure_.parts[chunk_part.part].num_segments;
  Panel panel;
  MakeRows(chunk_part, slice, scratch, &panel);
  HOLBA_SIMD_CHOOSE_IN(::holba::native, AccumulateLoose)
  (panel, scratch->rows.data(),
   cross_[chunk_part.part].data() + chunk_part.begin * (n * (n - 1) / 2), sums);
}

void NormalEquations::LineariseSlice(SliceData* slice, double inverse_radius, Scratch* scratch) {
  ClearSums(slice);
  const Timer timer;
  const Sums sums = SumsOf(slice);
  scratch->trial = false;
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    if (structure_.chunks[c].feature_tangent > 0) {
      LineariseFeatures(c, inverse_radius, sums, slice, scratch);
    } else {
      LineariseLoose(structure_.chunks[c], sums, slice, scratch);
    }
  }
  slice->seconds = timer.Seconds();
}

// Adds up the blocks of the slices into S (and U), in the order of the slices.
void NormalEquations::MergeBlocks() {
  const bool implicit = IsImplicit();
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

double KeptDamping(double diagonal, double radius) {
  const double root = 1.0 + std::sqrt(diagonal);
  return std::max(diagonal, 1e-6 * root * root) / radius;
}

void NormalEquations::Linearise(double radius, Linearisation* out) {
  LinearisePart(radius, out);
  AddDamping(radius, out);
}

void NormalEquations::LinearisePart(double radius, Linearisation* out) {
  ForEachSlice(
      [&](SliceData* slice, Scratch* scratch) { LineariseSlice(slice, 1.0 / radius, scratch); });
  MergeBlocks();
  MergeVectors(out);
  CollectCost(false, &out->cost);
}

void NormalEquations::MergeVectors(Linearisation* out) {
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  std::fill(diagonal_.begin(), diagonal_.end(), 0.0);
  std::fill(reduction_.begin(), reduction_.end(), 0.0);
  out->max_gradient = 0.0;
  double evaluation_seconds = 0.0, seconds = 0.0;
  const size_t padded = structure_.padded_size();
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
  out->evaluation_share = seconds > 0.0 ? evaluation_seconds / seconds : 1.0;
}

// Damps the diagonal of S (and U) as FactoriseFeatures damps V, and sets the right hand side.
void NormalEquations::AddDamping(double radius, Linearisation* out) {
  double not_finite = 0.0;
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    const uint32_t at = structure_.node_padded_offset[n];
    const int width = structure_.node_width[n], stride = PaddedWidth(width);
    const size_t block = S_.block_offset[pattern_.row_start[n + 1] - 1];
    for (int i = 0; i < width; ++i) {
      // The row and column of a held coordinate are zero: any pivot gives it a zero step.
      damping_[at + i] =
          structure_.held_column[at + i] ? 1.0 : KeptDamping(diagonal_[at + i], radius);
      S_.values.data()[block + i * stride + i] += damping_[at + i];
      if (IsImplicit()) U_.values.data()[block + i * stride + i] += damping_[at + i];
      rhs_[pattern_.offset[n] + i] = reduction_[at + i] - gradient_[at + i];
      out->max_gradient = std::max(out->max_gradient, std::abs(gradient_[at + i]));
      not_finite += gradient_[at + i] - gradient_[at + i];
    }
  }
  out->max_gradient += not_finite;  // NaN, if any entry is
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
    slice->cost.assign(problem_->batches().size(), {});
    Sums sums = SumsOf(slice);
    sums.U = sums.S = nullptr;  // only T is needed
    scratch->trial = false;
    std::vector<size_t> z_offset, z_begin;
    for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
      const Chunk& chunk = s.chunks[c];
      if (chunk.feature_tangent == 0) continue;
      const ChunkFeatures features = FeaturesOf(chunk, *slice, scratch);
      HOLBA_SIMD_CHOOSE_IN(::holba::native, BeginChunk)(features, sums);
      Panel panel;
      for (uint32_t p = chunk.parts_begin; p < chunk.parts_end; ++p) {
        MakeRows(s.chunk_parts[p], slice, scratch, &panel);
        HOLBA_SIMD_CHOOSE_IN(::holba::native, Accumulate)
        (panel, scratch->rows.data(), features, sums);
      }
      HOLBA_SIMD_CHOOSE_IN(::holba::native, FactoriseFeatures)(features, 0.0);
      HOLBA_SIMD_CHOOSE_IN(::holba::native, FormT)(features, sums);
      FindInverseBlocks(features, Z, &z_offset, &z_begin);
      double* const out = covariances->data() + (*begin)[chunk.feature_begin];
      HOLBA_SIMD_CHOOSE_IN(::holba::native, FeatureCovariances)
      (features, sums, Z.values.data(), z_offset.data(), z_begin.data(), out);
      SetUnconstrainedToInfinity(chunk, features, out);
    }
  });
}

// The blocks of Z that belong to the pairs of each feature's clique.
void NormalEquations::FindInverseBlocks(const ChunkFeatures& features, const BlockMatrix& Z,
                                        std::vector<size_t>* z_offset,
                                        std::vector<size_t>* z_begin) const {
  z_offset->clear();
  z_begin->clear();
  uint32_t last = kNoClique;
  for (size_t f = 0; f < features.count; ++f) {
    if (features.clique[f] == last) {
      z_begin->push_back(z_begin->back());
      continue;
    }
    last = features.clique[f];
    z_begin->push_back(z_offset->size());
    const auto nodes = structure_.cliques.Nodes(last);
    for (size_t p = 0; p < nodes.size(); ++p) {
      // Columns and nodes both ascend.
      size_t k = pattern_.row_start[nodes[p]];
      const size_t end = pattern_.row_start[nodes[p] + 1];
      for (size_t q = 0; q <= p; ++q) {
        const int b = static_cast<int>(nodes[q]);
        if (pattern_.column[k] != b) {
          k = std::lower_bound(pattern_.column.begin() + k, pattern_.column.begin() + end, b) -
              pattern_.column.begin();
        }
        z_offset->push_back(Z.block_offset[k]);
      }
    }
  }
}

void NormalEquations::SetUnconstrainedToInfinity(const Chunk& chunk, const ChunkFeatures& features,
                                                 double* covariances) const {
  const int F = chunk.feature_tangent;
  for (size_t f = 0; f < features.count; ++f) {
    for (int i = 0; i < F; ++i) {
      if (features.factors[(i * (i + 1) / 2 + i) * features.stride + f] != 0.0) continue;
      if (problem_->block(structure_.features[chunk.feature_begin + f]).held >> i & 1) continue;
      std::fill_n(covariances + f * F * F, F * F, std::numeric_limits<double>::infinity());
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

}  // namespace holba::native
