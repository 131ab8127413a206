// SPDX-License-Identifier: BSD-3-Clause
#include "holba/problem/weigh.h"

#include <cmath>

#include "holba/problem/weigh_vectorised.h"

namespace holba {

static_assert(kMaxWeighedSlots == kMaxSlots);

namespace {

// Panels that packs cannot read: ranges of one.
PanelCost OneByOne(const ResidualBatch& batch, size_t count, const ResidualPanel& panel,
                   bool multiply) {
  PanelCost sum;
  for (size_t j = 0; j < count; ++j) {
    double s = 0.0;
    for (int k = 0; k < batch.dim(); ++k) {
      const double r = panel.residuals[k * panel.stride + j];
      s += r * r;
    }
    double rho[3];
    batch.loss.Evaluate(s, rho);
    sum.cost += 0.5 * batch.weight * rho[0];
    sum.sum_squares += s;
    if (!multiply) continue;
    const double factor = std::sqrt(batch.weight * rho[1]);
    for (int k = 0; k < batch.dim(); ++k) panel.residuals[k * panel.stride + j] *= factor;
    for (int slot = 0; slot < batch.num_slots(); ++slot) {
      if (panel.jacobians[slot] == nullptr) continue;
      for (int k = 0; k < batch.dim() * batch.tangent(slot); ++k) {
        panel.jacobians[slot][k * panel.stride + j] *= factor;
      }
    }
  }
  return sum;
}

PanelCost Weigh(const ResidualBatch& batch, size_t count, const ResidualPanel& panel,
                bool multiply) {
  PanelCost sum;
  if (panel.stride % kPanelLanes != 0) {
    sum = OneByOne(batch, count, panel, multiply);
  } else {
    WeighWork work{batch.loss.type, batch.loss.scale, batch.weight, count, panel.stride,
                   panel.residuals, batch.dim(),      {},           {}};
    for (int slot = 0; slot < batch.num_slots(); ++slot) {
      work.jacobians[slot] = panel.jacobians[slot];
      work.entries[slot] = batch.dim() * batch.tangent(slot);
    }
    HOLBA_SIMD_CHOOSE(Weigh)(work, multiply, &sum.cost, &sum.sum_squares);
  }
  // Absent residuals are 0 and so have no cost.
  for (size_t j = 0; j < count; ++j) sum.absent += !panel.present[j];
  return sum;
}

}  // namespace

PanelCost CostOfPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel) {
  return Weigh(batch, count, panel, false);
}

PanelCost WeighPanel(const ResidualBatch& batch, size_t count, const ResidualPanel& panel) {
  return Weigh(batch, count, panel, true);
}

}  // namespace holba
