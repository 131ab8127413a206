// SPDX-License-Identifier: BSD-3-Clause
// Solvers of a reduced system that is spread over ranks.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "holba/solver/petsc/distributed_system.h"
#include "holba/solver/solver.h"

namespace holba::distributed {

class DistributedSolver {
 public:
  virtual ~DistributedSolver() = default;
  // The entries of the own cells; false, on all ranks: there is no solution at this damping.
  virtual bool Solve(const DistributedSystem& system, std::vector<double>* solution) = 0;
  virtual std::string Name() const = 0;
};

// Collects the matrix on the first rank, whose own direct solver (linear/reduced_solver.h) does the
// rest. For systems that are small beside the elimination.
std::unique_ptr<DistributedSolver> MakeGatheredSolver(const DistributedSystem& system,
                                                      const SolverOptions& options,
                                                      int num_threads);
// PETSc's solvers on the distributed matrix. Its options say which; by default conjugate gradients
// with incomplete Cholesky of each rank's own rows, which end as those of the native solver do.
std::unique_ptr<DistributedSolver> MakePetscSolver(const DistributedSystem& system,
                                                   const SolverOptions& options);

// The one that the options ask for; kAuto: gathered, if its factorisation takes no longer than
// about a second, or than `elimination_cycles`, the predicted work of one rank.
std::unique_ptr<DistributedSolver> MakeDistributedSolver(const DistributedSystem& system,
                                                         const SolverOptions& options,
                                                         int num_threads,
                                                         double elimination_cycles);

}  // namespace holba::distributed
