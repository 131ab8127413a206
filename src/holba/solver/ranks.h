// SPDX-License-Identifier: BSD-3-Clause
// The processes of a job that `mpirun` or `srun` starts together ("ranks"). A program that was
// started alone, or built without PETSc, is rank 0 of 1.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>

namespace holba::ranks {

// As the launcher says it in the environment: known before Begin and without PETSc.
int LaunchedSize();
int LaunchedRank();

// Starts MPI and PETSc, unless they have been. Ends with the program. `petsc_options` as on PETSc's
// command line; throws InputError where these are refused. InputError without PETSc in this build.
void Begin(const std::string& petsc_options = "");
bool HasBegun();

// 0 of 1 before Begin.
int Rank();
int Size();

// Thrown by Together on ranks whose action did not fail while another one's did, which reports it.
class StoppedElsewhere : public std::runtime_error {
 public:
  StoppedElsewhere() : std::runtime_error("stopped with another rank") {}
};
// For a refusal before Begin that every process of the job finds: all but the first stop quietly.
inline void StopAllButFirst() {
  if (LaunchedRank() > 0) throw StoppedElsewhere();
}
// Every rank calls this and does the action. If any of them throws, none of them goes on: the first
// of those that failed rethrows.
void Together(const std::function<void()>& action);
// The same for what only rank 0 does.
void OnFirst(const std::function<void()>& action);

// Ends all ranks at once, with this exit status, because this one cannot go on. Returns if it is
// alone, or if all of them know already: Together has thrown.
void EndAll(int exit_status);

// For programs, at their start: the process goes on as a child of its former self, which waits for
// it. Should the child be killed (for want of memory, say), its parent says so and ends with
// `exit_status`, at which the launcher ends the other ranks. Nothing if there are no others.
void GuardAgainstDeath(int exit_status);

// The names of PETSc's options that nothing has read, such as misspelt ones.
std::string UnusedPetscOptions();

}  // namespace holba::ranks
