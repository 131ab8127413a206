// SPDX-License-Identifier: BSD-3-Clause
// Adjustment of a part of a model: what a mapper does after each image.
#pragma once

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/solver/solver.h"

namespace holba {

struct LocalSummary {
  SolverSummary solver;
  double build_seconds = 0.0;  // of the problem
  double write_back_seconds = 0.0;
};

// Builds the problem of the selection, solves it and writes its values back; nothing else. What
// the selection does not name stays as it is and is not looked at: the cost is that of the
// selection, however large the model is. There are no rounds: losses are
// those of BuildProblem (`auto` is Cauchy at its settings' scale, one that is not chosen trivial),
// and associations are not tested. Errors of features stay as they are
// (UpdateErrors(selection, model) brings them up to date). The workspace (null: none) carries
// memory from call to call.
LocalSummary AdjustLocal(const BundleOptions& options, const SolverOptions& solver_options,
                         const BundleSelection& selection, SolverWorkspace* workspace,
                         Reconstruction* model);

}  // namespace holba
