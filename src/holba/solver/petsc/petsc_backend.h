// SPDX-License-Identifier: BSD-3-Clause
// The backend `petsc`: the loop of the native solver over features that are spread over ranks, with
// the reduced system solved by PETSc (docs/mpi.md). Every rank calls it with the same problem, and
// all get the same result.
#pragma once

#include <memory>

#include "holba/solver/solver.h"

namespace holba {

// What one solve leaves for the next: the partition and the layout of problems of one structure.
class PetscWorkspace {
 public:
  PetscWorkspace();
  ~PetscWorkspace();

 private:
  friend SolverSummary SolveWithPetsc(const SolverOptions& options, Problem* problem,
                                      PetscWorkspace* workspace);
  class Impl;
  std::unique_ptr<Impl> impl_;
};

SolverSummary SolveWithPetsc(const SolverOptions& options, Problem* problem,
                             PetscWorkspace* workspace);

}  // namespace holba
