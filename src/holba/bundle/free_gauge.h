// SPDX-License-Identifier: BSD-3-Clause
// A gauge that is held costs iterations: damping then resists every motion of the rest against the
// held camera. Where nothing but the gauge ties the problem to its frame, the solver may move freely,
// and the result is carried back by the similarity that puts the held camera and coordinate where
// they were: the same optimum, in the same frame.
#pragma once

#include <array>
#include <optional>

#include "holba/bundle/bundle_problem.h"

namespace holba {

struct FreedGauge {
  BlockId first;
  std::array<double, 7> first_values;
  std::optional<BlockId> second;  // none: sensors with a baseline hold the scale
  int coordinate = 0;             // of its translation
  double coordinate_value = 0.0;
};

// Frees what BuildProblem holds for Gauge::kTwoCams. Empty, and nothing changed: it holds nothing, or
// something else depends on the frame (held points, lines or groups, residuals in model units).
std::optional<FreedGauge> FreeGauge(BundleProblem* bundle);

// Carries the state back and holds the gauge again; the held values get their bits back. `moved`:
// whether the state is another one than that of FreeGauge.
void RestoreGauge(const FreedGauge& freed, bool moved, BundleProblem* bundle);

}  // namespace holba
