// SPDX-License-Identifier: BSD-3-Clause
#include <petscksp.h>

#include <algorithm>
#include <cmath>

#include "holba/solver/petsc/distributed_solver.h"
#include "holba/solver/petsc/petsc_check.h"

namespace holba::distributed {
namespace {

// Ends conjugate gradients as the native solver does (linear/conjugate_gradients.h): when the last
// step decreased Q = x^T A x / 2 - b^T x by less than eta times the mean step.
struct ModelDecrease {
  double eta = 0.1;
  double last = 0.0;
  Vec b = nullptr, x = nullptr, residual = nullptr, sum = nullptr;

  static PetscErrorCode Test(KSP ksp, PetscInt iteration, PetscReal norm,
                             KSPConvergedReason* reason, void* context) {
    auto& self = *static_cast<ModelDecrease*>(context);
    *reason = KSP_CONVERGED_ITERATING;
    if (PetscIsInfOrNanReal(norm)) {
      *reason = KSP_DIVERGED_NANORINF;
      return 0;
    }
    if (norm == 0.0) {
      *reason = KSP_CONVERGED_ATOL;
      return 0;
    }
    if (iteration == 0) {
      self.last = 0.0;
      return 0;
    }
    Vec x = nullptr, residual = nullptr;
    PetscCall(KSPBuildSolution(ksp, self.x, &x));
    PetscCall(KSPBuildResidual(ksp, nullptr, self.residual, &residual));
    // With r = b - A x, Q = -x^T (b + r) / 2.
    PetscCall(VecWAXPY(self.sum, 1.0, self.b, residual));
    PetscScalar product = 0.0;
    PetscCall(VecDot(x, self.sum, &product));
    const double model = -0.5 * product;
    if (static_cast<double>(iteration) * (model - self.last) / model < self.eta)
      *reason = KSP_CONVERGED_RTOL;
    self.last = model;
    return 0;
  }
};

class PetscSolver final : public DistributedSolver {
 public:
  PetscSolver(const DistributedSystem& system, const SolverOptions& options)
      : size_(system.layout().block_size) {
    MakeMatrix(system);
    HOLBA_CHECK_PETSC(MatCreateVecs(matrix_, &x_, &b_));
    test_.eta = options.eta;
    test_.b = b_;
    for (Vec* vector : {&test_.x, &test_.residual, &test_.sum})
      HOLBA_CHECK_PETSC(VecDuplicate(b_, vector));
    MakeSolver(system.communicator().comm(), options);
  }
  ~PetscSolver() override {
    KSPDestroy(&ksp_);
    MatDestroy(&matrix_);
    for (Vec* vector : {&x_, &b_, &test_.x, &test_.residual, &test_.sum}) VecDestroy(vector);
  }

  bool Solve(const DistributedSystem& system, std::vector<double>* solution) override {
    SetValues(system);
    PetscScalar* entries = nullptr;
    HOLBA_CHECK_PETSC(VecGetArray(b_, &entries));
    std::copy(system.rhs().begin(), system.rhs().end(), entries);
    HOLBA_CHECK_PETSC(VecRestoreArray(b_, &entries));
    HOLBA_CHECK_PETSC(KSPSetOperators(ksp_, matrix_, matrix_));
    HOLBA_CHECK_PETSC(KSPSolve(ksp_, b_, x_));
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    PetscInt iterations = 0;
    PetscReal norm = 0.0;
    HOLBA_CHECK_PETSC(KSPGetConvergedReason(ksp_, &reason));
    HOLBA_CHECK_PETSC(KSPGetIterationNumber(ksp_, &iterations));
    HOLBA_CHECK_PETSC(VecNorm(x_, NORM_2, &norm));
    const PetscScalar* found = nullptr;
    HOLBA_CHECK_PETSC(VecGetArrayRead(x_, &found));
    solution->assign(found, found + system.num_own_unknowns());
    HOLBA_CHECK_PETSC(VecRestoreArrayRead(x_, &found));
    // Every step of conjugate gradients is a descent direction, however they end.
    const bool went_on = reason > 0 || (iterations > 0 && reason != KSP_DIVERGED_NANORINF &&
                                        reason != KSP_DIVERGED_PC_FAILED);
    return went_on && std::isfinite(norm);
  }

  std::string Name() const override {
    KSPType solver = nullptr;
    PCType preconditioner = nullptr;
    MatType matrix = nullptr;
    PC pc = nullptr;
    HOLBA_CHECK_PETSC(KSPGetType(ksp_, &solver));
    HOLBA_CHECK_PETSC(KSPGetPC(ksp_, &pc));
    HOLBA_CHECK_PETSC(PCGetType(pc, &preconditioner));
    HOLBA_CHECK_PETSC(MatGetType(matrix_, &matrix));
    return std::string("PETSc ") + solver + ", " + preconditioner + ", " + matrix;
  }

 private:
  // By blocks of size_: rows of the own cells, with the upper triangle or both.
  void MakeMatrix(const DistributedSystem& system) {
    const CellLayout& layout = system.layout();
    const auto comm = system.communicator().comm();
    const auto n = static_cast<PetscInt>(system.num_own_unknowns());
    HOLBA_CHECK_PETSC(MatCreate(comm, &matrix_));
    HOLBA_CHECK_PETSC(MatSetSizes(matrix_, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
    HOLBA_CHECK_PETSC(MatSetBlockSize(matrix_, size_));
    HOLBA_CHECK_PETSC(MatSetType(matrix_, MATSBAIJ));
    HOLBA_CHECK_PETSC(MatSetFromOptions(matrix_));
    PetscBool by_rows = PETSC_FALSE;
    HOLBA_CHECK_PETSC(PetscObjectBaseTypeCompareAny(reinterpret_cast<PetscObject>(matrix_),
                                                    &by_rows, MATSEQSBAIJ, MATMPISBAIJ, ""));
    upper_only_ = by_rows == PETSC_TRUE;

    const uint32_t first = system.first_cell(), end = system.end_cell();
    const size_t first_row = layout.begin[first] / size_;
    std::vector<PetscInt> diagonal(static_cast<size_t>(n / size_)),
        other = diagonal, upper = diagonal, upper_other = diagonal;
    const auto count = [&](uint32_t row, uint32_t column) {
      const bool here = column >= first && column < end;
      const PetscInt height = layout.padded[row] / size_, width = layout.padded[column] / size_;
      for (PetscInt i = 0; i < height; ++i) {
        const size_t r = layout.begin[row] / size_ - first_row + static_cast<size_t>(i);
        (here ? diagonal : other)[r] += width;
        // Of a diagonal cell of several blocks the upper triangle.
        if (row <= column) (here ? upper : upper_other)[r] += row == column ? width - i : width;
      }
    };
    for (const CellPair& pair : system.pairs()) {
      count(pair.row, pair.column);
      if (pair.row != pair.column && pair.column < end) count(pair.column, pair.row);
    }
    if (!upper_only_) {
      for (const CellPair& pair : PairsOfOthers(system)) count(pair.column, pair.row);
    }
    HOLBA_CHECK_PETSC(MatXAIJSetPreallocation(matrix_, size_, diagonal.data(), other.data(),
                                              upper.data(), upper_other.data()));
    if (upper_only_) {
      HOLBA_CHECK_PETSC(MatSetOption(matrix_, MAT_IGNORE_LOWER_TRIANGULAR, PETSC_TRUE));
    }
    HOLBA_CHECK_PETSC(MatSetOption(matrix_, MAT_SYMMETRIC, PETSC_TRUE));
    HOLBA_CHECK_PETSC(MatSetOption(matrix_, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  }

  // The pairs of other ranks' rows whose column this rank owns.
  static std::vector<CellPair> PairsOfOthers(const DistributedSystem& system) {
    std::vector<size_t> begin;
    std::vector<CellPair> across, mine;
    for (const CellPair& pair : system.pairs()) {
      if (pair.column >= system.end_cell()) across.push_back(pair);
    }
    for (const CellPair& pair : system.communicator().GatherLists<CellPair>(across, &begin)) {
      if (pair.column >= system.first_cell() && pair.column < system.end_cell())
        mine.push_back(pair);
    }
    return mine;
  }

  void SetValues(const DistributedSystem& system) {
    const CellLayout& layout = system.layout();
    std::vector<PetscInt> rows, columns;
    std::vector<double> turned;
    const auto blocks = [&](uint32_t cell, std::vector<PetscInt>* out) {
      out->clear();
      for (int i = 0; i < layout.padded[cell] / size_; ++i)
        out->push_back(static_cast<PetscInt>(layout.begin[cell] / size_) + i);
    };
    const auto insert = [&](const double* values) {
      HOLBA_CHECK_PETSC(MatSetValuesBlocked(matrix_, static_cast<PetscInt>(rows.size()),
                                            rows.data(), static_cast<PetscInt>(columns.size()),
                                            columns.data(), values, INSERT_VALUES));
    };
    for (size_t p = 0; p < system.pairs().size(); ++p) {
      const auto [row, column] = system.pairs()[p];
      const double* values = system.values().data() + system.pair_offset()[p];
      blocks(row, &rows);
      blocks(column, &columns);
      insert(values);
      if (upper_only_ || row == column) continue;
      const int height = layout.padded[row], width = layout.padded[column];
      turned.resize(static_cast<size_t>(height) * width);
      for (int i = 0; i < height; ++i) {
        for (int j = 0; j < width; ++j) turned[j * height + i] = values[i * width + j];
      }
      std::swap(rows, columns);
      insert(turned.data());
    }
    HOLBA_CHECK_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
    HOLBA_CHECK_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
  }

  void MakeSolver(MPI_Comm comm, const SolverOptions& options) {
    HOLBA_CHECK_PETSC(KSPCreate(comm, &ksp_));
    HOLBA_CHECK_PETSC(KSPSetType(ksp_, KSPCG));
    PC pc = nullptr;
    HOLBA_CHECK_PETSC(KSPGetPC(ksp_, &pc));
    if (options.preconditioner == PreconditionerType::kBlockJacobi) {
      HOLBA_CHECK_PETSC(PCSetType(pc, PCPBJACOBI));
    } else {
      HOLBA_CHECK_PETSC(PCSetType(pc, PCBJACOBI));
      SetDefault("-sub_pc_type", upper_only_ ? "icc" : "ilu");
    }
    HOLBA_CHECK_PETSC(KSPSetTolerances(ksp_, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT,
                                       options.max_linear_solver_iterations));
    PetscBool own_test = PETSC_FALSE;
    for (const char* name : {"-ksp_rtol", "-ksp_atol"}) {
      PetscBool given = PETSC_FALSE;
      HOLBA_CHECK_PETSC(PetscOptionsHasName(nullptr, nullptr, name, &given));
      own_test = given ? PETSC_TRUE : own_test;
    }
    HOLBA_CHECK_PETSC(KSPSetOperators(ksp_, matrix_, matrix_));
    HOLBA_CHECK_PETSC(KSPSetFromOptions(ksp_));
    // PETSc's own default, restricted Schwarz, is not symmetric, as conjugate gradients need it.
    PetscBool schwarz_given = PETSC_FALSE;
    HOLBA_CHECK_PETSC(PetscOptionsHasName(nullptr, nullptr, "-pc_asm_type", &schwarz_given));
    if (!schwarz_given) HOLBA_CHECK_PETSC(PCASMSetType(pc, PC_ASM_BASIC));
    PetscBool is_cg = PETSC_FALSE;
    HOLBA_CHECK_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(ksp_), KSPCG, &is_cg));
    if (is_cg && !own_test)
      HOLBA_CHECK_PETSC(KSPSetConvergenceTest(ksp_, ModelDecrease::Test, &test_, nullptr));
  }
  static void SetDefault(const char* name, const char* value) {
    PetscBool given = PETSC_FALSE;
    HOLBA_CHECK_PETSC(PetscOptionsHasName(nullptr, nullptr, name, &given));
    if (!given) HOLBA_CHECK_PETSC(PetscOptionsSetValue(nullptr, name, value));
  }

  PetscInt size_;
  bool upper_only_ = true;
  Mat matrix_ = nullptr;
  KSP ksp_ = nullptr;
  Vec x_ = nullptr, b_ = nullptr;
  ModelDecrease test_;
};

}  // namespace

std::unique_ptr<DistributedSolver> MakePetscSolver(const DistributedSystem& system,
                                                   const SolverOptions& options) {
  return std::make_unique<PetscSolver>(system, options);
}

}  // namespace holba::distributed
