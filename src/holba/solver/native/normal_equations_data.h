// SPDX-License-Identifier: BSD-3-Clause
// Internals of NormalEquations, for its own files only.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "holba/problem/weigh.h"
#include "holba/solver/native/normal_equations.h"

namespace holba::native {

// The residuals of a chunk part at one state.
struct NormalEquations::Evaluated {
  ResidualPanel panel;
  size_t count = 0, absent = 0;
  PanelCost cost;
};

// The memory of one thread for one chunk.
struct NormalEquations::Scratch {
  AlignedDoubles panel, rows, W, V, jk, pulled, step_of_features, trial_panel;
  std::vector<uint32_t> first_position, w_offset;
  std::vector<int64_t> bases, base_of_position;
  std::vector<Panel> panels;  // by part of the chunk
  std::vector<Evaluated> evaluated;
  std::unique_ptr<bool[]> present, trial_present;
  size_t present_size = 0;
  std::atomic<bool> busy = false;
  // What the current chunk has used so far.
  size_t panel_used = 0, present_used = 0;
  bool trial = false;  // Evaluate uses the buffers of the trial state

  static void Grow(AlignedDoubles* buffer, size_t size) {
    if (buffer->size() < size) *buffer = AlignedDoubles(size);
  }
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

// A slice of the chunks, and its sums.
struct NormalEquations::SliceData {
  uint32_t chunk_begin = 0, chunk_end = 0;
  AlignedDoubles own_U, own_S;
  double *U = nullptr, *S = nullptr;
  size_t sums_size = 0;
  std::vector<double> gradient, diagonal, reduction, product;
  // Blocks of the pattern that the slice adds to, ascending, and their offsets in its sums. Empty
  // where the pattern is full: then the sums have every block.
  std::vector<uint32_t> blocks, block_offset, diagonal_offset;
  uint32_t first_clique = 0;
  std::vector<size_t> pairs_begin;
  std::vector<uint32_t> pairs;

  std::vector<TermCost> cost, trial_cost;
  double evaluation_seconds = 0.0, seconds = 0.0;  // of the last linearisation
  std::vector<TermCost> appeared;                  // by batch, at the trial state
  double max_gradient = 0.0, model_change = 0.0;
  StepSquares squares;  // of the features
  // Residuals that are present here and absent at the trial state.
  std::vector<RememberedResidual> vanishing;
};

template <typename Body>
void NormalEquations::ForEachSlice(const Body& body) {
  ParallelTasks(num_slices_ > 1 ? num_threads_ : 1, num_slices_, [&](size_t i) {
    // There are as many scratches as threads, so one is free.
    for (size_t s = 0;; s = (s + 1) % scratches_.size()) {
      if (scratches_[s]->busy.exchange(true, std::memory_order_acquire)) continue;
      body(slices_[i].get(), scratches_[s].get());
      scratches_[s]->busy.store(false, std::memory_order_release);
      return;
    }
  });
}

inline void AddTo(TermCost* cost, size_t count, const PanelCost& panel) {
  cost->residuals += count;
  cost->absent += panel.absent;
  cost->sum_squares += panel.sum_squares;
  cost->cost += panel.cost;
}

}  // namespace holba::native
