// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/adjust_local.h"

#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"

namespace holba {

LocalSummary AdjustLocal(const BundleOptions& options, const SolverOptions& solver_options,
                         const BundleSelection& selection, SolverWorkspace* workspace,
                         Reconstruction* model) {
  LocalSummary summary;
  const Timer build_timer;
  BundleProblem bundle = BuildProblem(*model, options, selection);
  summary.build_seconds = build_timer.Seconds();
  summary.solver = Solve(solver_options, &bundle.problem, workspace);
  const Timer write_back_timer;
  WriteBack(bundle, model);
  summary.write_back_seconds = write_back_timer.Seconds();
  return summary;
}

}  // namespace holba
