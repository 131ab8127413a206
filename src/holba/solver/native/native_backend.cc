// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/native_backend.h"

#include <vector>

#include "holba/solver/native/levenberg_marquardt.h"
#include "holba/solver/native/solve_log.h"

namespace holba {
namespace {

class NativeProblem final : public native::LinearisedProblem {
 public:
  NativeProblem(Problem* problem, NativeWorkspace* workspace)
      : problem_(problem),
        equations_(workspace->equations()),
        step_solver_(workspace->step_solver()),
        step_(equations_.pattern().num_unknowns) {}

  bool IsEmpty() const override {
    return equations_.structure().num_nodes() == 0 && equations_.structure().features.empty();
  }
  void Linearise(double radius, native::Linearisation* out) override {
    equations_.Linearise(radius, out);
  }
  bool SolveKept() override { return step_solver_.Solve(&equations_, step_); }
  void Step(native::Trial* out) override { equations_.Step(step_, out); }
  void Accept() override { equations_.Accept(problem_); }
  void Save(LoopState* loop) override {
    loop->state = problem_->state();
    loop->remembered = equations_.Remembered();
  }
  void Restore(const LoopState& loop) override {
    problem_->state() = loop.state;
    equations_.Remember(loop.remembered);
  }

 private:
  Problem* const problem_;
  native::NormalEquations& equations_;
  native::StepSolver& step_solver_;
  std::vector<double> step_;
};

}  // namespace

SolverSummary SolveNatively(const SolverOptions& options, Problem* problem,
                            NativeWorkspace* workspace) {
  native::SolveLog log("native", options, *problem);
  workspace->Begin(*problem, options, log.num_threads());
  log.EndBuild(workspace->step_solver().Name());
  NativeProblem system(problem, workspace);
  return native::Minimise(options, *problem, &system, &log);
}

}  // namespace holba
