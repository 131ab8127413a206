// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/backend.h"

#if HOLBA_WITH_CERES
#include "holba/solver/ceres/ceres_backend.h"
#endif
#include "holba/solver/native/native_backend.h"
#if HOLBA_WITH_PETSC
#include "holba/solver/petsc/petsc_backend.h"
#endif

namespace holba {

std::span<const BackendEntry> AllBackends() {
  static constexpr BackendEntry kBackends[] = {
      {"native", Backend::kNative,
       [](const SolverOptions& options, Problem* problem, SolverWorkspace* workspace) {
         return SolveNatively(options, problem, &workspace->Native());
       }},
#if HOLBA_WITH_CERES
      {"ceres", Backend::kCeres,
       [](const SolverOptions& options, Problem* problem, SolverWorkspace*) {
         return SolveWithCeres(options, problem);
       }},
#endif
#if HOLBA_WITH_PETSC
      {"petsc", Backend::kPetsc,
       [](const SolverOptions& options, Problem* problem, SolverWorkspace* workspace) {
         return SolveWithPetsc(options, problem, &workspace->Petsc());
       }},
#endif
  };
  return kBackends;
}

}  // namespace holba
