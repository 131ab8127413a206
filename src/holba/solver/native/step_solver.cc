// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/step_solver.h"

#include <vector>

#include "holba/linear/conjugate_gradients.h"
#include "holba/linear/preconditioner.h"

namespace holba::native {
namespace {

constexpr int kPowerSeriesOrder = 3;
// A border of shared intrinsics, which all images see, is worth an exact treatment. For a border of
// a hundred planes the treatment costs more than the conjugate gradient steps that it saves.
constexpr size_t kMaxBorderUnknowns = 32;

class DirectStepSolver final : public StepSolver {
 public:
  explicit DirectStepSolver(std::unique_ptr<ReducedSolver> solver) : solver_(std::move(solver)) {}
  bool Solve(NormalEquations* equations, std::span<double> step) override {
    return solver_->Factorise(equations->matrix()) &&
           solver_->Solve(equations->rhs().data(), step.data());
  }
  ReducedSolver* Direct() override { return solver_.get(); }
  void Reset() override { solver_->Reset(); }
  std::string Name() const override { return solver_->Name(); }

 private:
  std::unique_ptr<ReducedSolver> solver_;
};

// y = S x = (U + D) x - T T^T x.
class ImplicitSchur final : public LinearOperator {
 public:
  ImplicitSchur(NormalEquations* equations, int num_threads)
      : equations_(*equations), num_threads_(num_threads) {}
  void Apply(const double* x, double* y) override {
    equations_.U().Multiply(x, y, num_threads_, &scratch_);
    product_.resize(equations_.pattern().num_unknowns);
    equations_.MultiplyEliminated(x, product_.data());
    for (size_t i = 0; i < product_.size(); ++i) y[i] -= product_[i];
  }

 private:
  NormalEquations& equations_;
  int num_threads_;
  std::vector<double> scratch_, product_;
};

// y = T T^T x.
class EliminatedPart final : public LinearOperator {
 public:
  explicit EliminatedPart(NormalEquations* equations) : equations_(*equations) {}
  void Apply(const double* x, double* y) override { equations_.MultiplyEliminated(x, y); }

 private:
  NormalEquations& equations_;
};

class IterativeStepSolver final : public StepSolver {
 public:
  IterativeStepSolver(const StepSolverChoice& choice, NormalEquations* equations)
      : schur_(equations, choice.num_threads), eliminated_(equations) {
    cg_options_.max_iterations = choice.max_linear_solver_iterations;
    cg_options_.eta = choice.eta;
    const BlockPattern& pattern = equations->pattern();
    const auto make_border = [&] {
      return std::make_unique<BorderPreconditioner>(
          pattern, static_cast<int>(choice.num_pose_nodes), BorderOptions(), choice.num_threads);
    };
    switch (choice.preconditioner) {
      case PreconditionerType::kAuto:
      case PreconditionerType::kBlockJacobi:
        jacobi_ = std::make_unique<BlockJacobiPreconditioner>(pattern, choice.num_threads);
        preconditioner_ = jacobi_.get();
        name_ = "block Jacobi";
        break;
      case PreconditionerType::kBorder:
        border_ = make_border();
        preconditioner_ = border_.get();
        name_ = "border";
        break;
      case PreconditionerType::kPowerSeries:
        border_ = make_border();
        of_u_ = true;
        series_ = std::make_unique<PowerSeriesPreconditioner>(
            border_.get(), &eliminated_, pattern.num_unknowns, kPowerSeriesOrder);
        preconditioner_ = series_.get();
        name_ = "power series";
        break;
    }
  }
  bool Solve(NormalEquations* equations, std::span<double> step) override {
    const BlockMatrix& matrix = of_u_ ? equations->U() : equations->matrix();
    if (jacobi_) jacobi_->Set(matrix);
    if (border_) border_->Set(matrix);
    const ConjugateGradientsResult result = cg_.Solve(
        &schur_, preconditioner_, step.size(), equations->rhs().data(), cg_options_, step.data());
    return result.iterations > 0 || result.end == ConjugateGradientsEnd::kConverged;
  }
  std::string Name() const override { return "conjugate gradients, implicit, " + name_; }

 private:
  ImplicitSchur schur_;
  EliminatedPart eliminated_;
  std::unique_ptr<BlockJacobiPreconditioner> jacobi_;
  std::unique_ptr<BorderPreconditioner> border_;
  std::unique_ptr<PowerSeriesPreconditioner> series_;
  Preconditioner* preconditioner_ = nullptr;
  bool of_u_ = false;  // the preconditioner takes U instead of the blocks of S
  std::string name_;
  ConjugateGradients cg_;
  ConjugateGradientsOptions cg_options_;
};

class EmptyStepSolver final : public StepSolver {
 public:
  bool Solve(NormalEquations*, std::span<double>) override { return true; }
  std::string Name() const override { return "none: features only"; }
};

}  // namespace

PreconditionerType ChoosePreconditioner(PreconditionerType wanted, const Structure& structure) {
  if (wanted != PreconditionerType::kAuto) return wanted;
  size_t border_unknowns = 0;
  for (size_t n = structure.num_pose_nodes; n < structure.num_nodes(); ++n)
    border_unknowns += structure.node_width[n];
  return border_unknowns > 0 && border_unknowns <= kMaxBorderUnknowns
             ? PreconditionerType::kBorder
             : PreconditionerType::kBlockJacobi;
}

std::unique_ptr<StepSolver> MakeStepSolver(const StepSolverChoice& choice,
                                           NormalEquations* equations) {
  if (choice.kind == LinearSolver::kIterative)
    return std::make_unique<IterativeStepSolver>(choice, equations);
  const Precision precision = choice.mixed ? Precision::kMixed : Precision::kDouble;
  return std::make_unique<DirectStepSolver>(
      choice.kind == LinearSolver::kDense
          ? MakeDenseSolver(equations->pattern(), precision, choice.num_threads)
          : MakeSparseSolver(equations->pattern(), precision, choice.num_threads));
}

std::unique_ptr<StepSolver> MakeEmptyStepSolver() { return std::make_unique<EmptyStepSolver>(); }

}  // namespace holba::native
