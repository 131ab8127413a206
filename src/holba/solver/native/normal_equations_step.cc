// SPDX-License-Identifier: BSD-3-Clause
// NormalEquations: back-substitution, and the cost at the trial state.
#include <algorithm>
#include <cmath>

#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {

void Trial::SetNorms() {
  step_norm = std::sqrt(squares.step);
  state_norm = std::sqrt(squares.state);
}

// Moves the kept blocks, then slice by slice the features, and evaluates the residuals there.
void NormalEquations::Step(std::span<const double> kept_step, Trial* out) {
  trial_state_ = problem_->state();
  for (size_t n = 0; n < structure_.num_nodes(); ++n) {
    std::copy_n(kept_step.data() + pattern_.offset[n], structure_.node_width[n],
                padded_step_.data() + structure_.node_padded_offset[n]);
  }
  StepSquares& squares = out->squares = MoveKeptBlocks();
  ForEachSlice([&](SliceData* slice, Scratch* scratch) { StepSlice(slice, scratch); });
  out->model_change = 0.0;
  for (size_t s = 0; s < num_slices_; ++s) {
    out->model_change += slices_[s]->model_change;
    squares.step += slices_[s]->squares.step;
    squares.state += slices_[s]->squares.state;
  }
  out->SetNorms();
  CollectCost(true, &out->cost);
}

StepSquares NormalEquations::MoveKeptBlocks() {
  StepSquares squares, elsewhere;
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
    const bool counted = counted_elsewhere_.empty() || counted_elsewhere_[id] == 0;
    MoveBlock(*block.manifold, offset_of(id), delta, counted ? &squares : &elsewhere);
  }
  return squares;
}

void NormalEquations::MoveBlock(const ManifoldOps& manifold, size_t at, const double* delta,
                                StepSquares* squares) {
  const double* state = problem_->state().data() + at;
  double* moved = trial_state_.data() + at;
  manifold.plus(state, delta, moved);
  for (int i = 0; i < manifold.ambient; ++i) {
    const double d = moved[i] - state[i];
    squares->step += d * d;
    squares->state += state[i] * state[i];
  }
}

void NormalEquations::StepSlice(SliceData* slice, Scratch* scratch) {
  slice->trial_cost.assign(problem_->batches().size(), {});
  slice->appeared.assign(problem_->batches().size(), {});
  slice->model_change = 0.0;
  slice->squares = {};
  slice->vanishing.clear();
  for (uint32_t c = slice->chunk_begin; c < slice->chunk_end; ++c) {
    const Chunk& chunk = structure_.chunks[c];
    ChunkFeatures features;
    if (chunk.feature_tangent > 0) features = BeginStep(chunk, *slice, scratch);
    ApplyKeptStep(chunk, features, scratch);
    if (chunk.feature_tangent > 0) MoveFeatures(chunk, features, slice, scratch);
    EvaluateTrial(chunk, slice, scratch);
  }
}

// Clears the right hand sides of the features, and finds the places of their nodes in the step.
ChunkFeatures NormalEquations::BeginStep(const Chunk& chunk, const SliceData& slice,
                                         Scratch* scratch) {
  const ChunkFeatures features = FeaturesOf(chunk, slice, scratch);
  std::fill_n(scratch->step_of_features.data(), features.stride * kFeatureRow, 0.0);
  uint32_t position = 0;
  for (size_t f = 0; f < features.count; ++f) {
    features.first_position[f] = position;
    for (uint32_t node : structure_.cliques.Nodes(features.clique[f]))
      scratch->base_of_position[position++] = structure_.node_padded_offset[node];
  }
  return features;
}

// Evaluates the residuals of a chunk again: E k of all, and F^T (E k) summed up for each feature.
void NormalEquations::ApplyKeptStep(const Chunk& chunk, const ChunkFeatures& features,
                                    Scratch* scratch) const {
  const int F = chunk.feature_tangent;
  scratch->trial = false;
  scratch->panel_used = scratch->present_used = 0;
  double* jk = scratch->jk.data();
  for (uint32_t p = 0; p < chunk.parts_end - chunk.parts_begin; ++p) {
    const ChunkPart& chunk_part = structure_.chunk_parts[chunk.parts_begin + p];
    Evaluate(chunk_part, problem_->state().data(), true, scratch, &scratch->evaluated[p]);
    Panel& panel = scratch->panels[p];
    MakePanel(chunk_part, scratch->evaluated[p], &panel);
    const int64_t* bases[kMaxSegments] = {};
    FindStepBases(panel, features, scratch, bases);
    HOLBA_SIMD_CHOOSE_IN(::holba::native, ApplyStep)
    (panel, F, padded_step_.data(), bases, jk, scratch->pulled.data());
    for (int i = 0; i < F; ++i) {
      // The residuals of a feature stand side by side.
      const double* pulled = scratch->pulled.data() + i * panel.stride;
      for (size_t j = 0; j < panel.count;) {
        const uint16_t f = panel.local_feature[j];
        double sum = 0.0;
        for (; j < panel.count && panel.local_feature[j] == f; ++j) sum += pulled[j];
        scratch->step_of_features.data()[f * kFeatureRow + i] += sum;
      }
    }
    jk += panel.dim * panel.stride;
  }
}

// Where the node of each residual's segment begins in padded_step_; at its zeros if there is none.
void NormalEquations::FindStepBases(const Panel& panel, const ChunkFeatures& features,
                                    Scratch* scratch, const int64_t** bases) const {
  const int64_t zeros = static_cast<int64_t>(structure_.padded_size());
  const int64_t* base_of_position = scratch->base_of_position.data();
  const uint32_t* padded_offset = structure_.node_padded_offset.data();
  for (int s = 0; s < panel.num_segments; ++s) {
    int64_t* base = scratch->bases.data() + s * panel.stride;
    bases[s] = base;
    for (size_t j = 0; j < panel.count; ++j) {
      const size_t at = j * panel.num_segments + s;
      if (panel.positions != nullptr) {
        const uint16_t position = panel.positions[at];
        base[j] = position == kNoPosition
                      ? zeros
                      : base_of_position[features.first_position[panel.local_feature[j]] +
                                         (position & kPositionMask)];
      } else {
        base[j] = panel.nodes[at] == kNoNode ? zeros : padded_offset[panel.nodes[at]];
      }
    }
    for (size_t j = panel.count; j < panel.stride; ++j) base[j] = zeros;
  }
}

void NormalEquations::MoveFeatures(const Chunk& chunk, const ChunkFeatures& features,
                                   SliceData* slice, Scratch* scratch) {
  double* const step = scratch->step_of_features.data();
  HOLBA_SIMD_CHOOSE_IN(::holba::native, SolveFeatures)(features, step);
  for (size_t f = 0; f < features.count; ++f) {
    const size_t feature = chunk.feature_begin + f;
    MoveBlock(*structure_.manifolds[structure_.feature_manifold[feature]],
              structure_.feature_at[feature], step + f * kFeatureRow, &slice->squares);
  }
}

// The cost at the trial state, and what the linear model predicts for it.
void NormalEquations::EvaluateTrial(const Chunk& chunk, SliceData* slice, Scratch* scratch) const {
  const double* jk = scratch->jk.data();
  scratch->trial = true;
  for (uint32_t p = 0; p < chunk.parts_end - chunk.parts_begin; ++p) {
    const ChunkPart& chunk_part = structure_.chunk_parts[chunk.parts_begin + p];
    const Panel& panel = scratch->panels[p];
    slice->model_change += HOLBA_SIMD_CHOOSE_IN(::holba::native, ModelChange)(
        panel, chunk.feature_tangent, jk, scratch->step_of_features.data());
    jk += panel.dim * panel.stride;
    Evaluated trial;
    Evaluate(chunk_part, trial_state_.data(), false, scratch, &trial);
    AddTo(&slice->trial_cost[structure_.parts[chunk_part.part].batch_idx], trial.count, trial.cost);
    CompareWithTrial(chunk_part, scratch->evaluated[p], trial, slice);
  }
}

void NormalEquations::Accept(Problem* problem) {
  for (size_t s = 0; s < num_slices_; ++s) Remember(slices_[s]->vanishing);
  problem->state() = trial_state_;
}

void NormalEquations::Remember(std::span<const RememberedResidual> remembered) {
  for (const RememberedResidual& r : remembered) {
    const ResidualBatch& batch = *problem_->batches()[r.batch];
    Memory& memory = memory_[r.batch];
    memory.known.resize(batch.size());
    memory.values.resize(batch.size() * batch.dim());
    memory.known[r.residual] = 1;
    std::copy_n(r.values, batch.dim(),
                &memory.values[static_cast<size_t>(r.residual) * batch.dim()]);
  }
}

std::vector<RememberedResidual> NormalEquations::Remembered() const {
  std::vector<RememberedResidual> out;
  for (uint32_t b = 0; b < memory_.size(); ++b) {
    const int dim = problem_->batches()[b]->dim();
    for (uint32_t i = 0; i < memory_[b].known.size(); ++i) {
      if (!memory_[b].known[i]) continue;
      RememberedResidual& r = out.emplace_back();
      r.batch = b;
      r.residual = i;
      std::copy_n(&memory_[b].values[static_cast<size_t>(i) * dim], dim, r.values);
    }
  }
  return out;
}

}  // namespace holba::native
