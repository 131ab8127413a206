// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/normal_equations.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "holba/base/threads.h"
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
      float* const stored = IsImplicit() ? stored_.data() + stored_begin_[c] : nullptr;
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
      if (IsImplicit()) U_.values.data()[block + i * stride + i] += damping_[at + i];
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
