// SPDX-License-Identifier: BSD-3-Clause
// NormalEquations: evaluating residuals, and their costs. Residuals of constant blocks are
// evaluated once; absent ones keep their last value.
#include <algorithm>

#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {
namespace {

void AddValue(const ResidualBatch& batch, const double* r, double* sum_squares, double* cost) {
  double s = 0.0;
  for (int k = 0; k < batch.dim(); ++k) s += r[k] * r[k];
  *sum_squares += s;
  *cost += 0.5 * batch.weight * batch.loss.Cost(s);
}

}  // namespace

void StateCost::CountAppeared() {
  for (size_t b = 0; b < appeared.size(); ++b) {
    batches[b].sum_squares += appeared[b].sum_squares;
    batches[b].cost += appeared[b].cost;
    total += appeared[b].cost;
    appeared[b] = {};
  }
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
  // The current and the trial state have the same offsets.
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

// Adds the last value of residuals that are absent now.
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
        RememberedResidual& vanishing = slice->vanishing.emplace_back();
        vanishing.batch = static_cast<uint32_t>(part.batch_idx);
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
      // The cost of the panel has it already.
      cost.sum_squares -= squares;
      cost.cost -= value;
      slice->appeared[part.batch_idx].sum_squares += squares;
      slice->appeared[part.batch_idx].cost += value;
    }
  }
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

}  // namespace holba::native
