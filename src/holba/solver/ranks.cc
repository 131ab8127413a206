// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/ranks.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <initializer_list>

#include "holba/base/error.h"
#include "holba/base/log.h"

#if HOLBA_WITH_PETSC
#include <petscsys.h>

#include "holba/solver/petsc/petsc_check.h"
#endif

namespace holba::ranks {
namespace {

// Of Open MPI; of MPICH and its relatives (also under srun --mpi=pmi2); of srun.
int FromEnvironment(std::initializer_list<const char*> names, int otherwise) {
  for (const char* name : names) {
    if (const char* text = std::getenv(name)) return std::atoi(text);
  }
  return otherwise;
}

#if HOLBA_WITH_PETSC
bool begun = false, all_stopped = false;

void End() {
  PetscBool finalised = PETSC_FALSE;
  if (PetscFinalized(&finalised) == 0 && !finalised) PetscFinalize();
}
#endif

pid_t guarded = -1;

void PassOnToGuarded(int number) {
  if (guarded > 0) kill(guarded, number);
}

}  // namespace

void GuardAgainstDeath(int exit_status) {
  if (LaunchedSize() < 2) return;
  const pid_t parent = getpid();
  guarded = fork();
  if (guarded < 0) return;  // goes on unguarded
  if (guarded == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(exit_status);
    return;
  }
  for (int number : {SIGINT, SIGTERM, SIGHUP}) signal(number, PassOnToGuarded);
  int status = 0;
  while (waitpid(guarded, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) _exit(WEXITSTATUS(status));
  const int number = WTERMSIG(status);
  // What this process was told itself needs no words.
  if (number != SIGINT && number != SIGTERM && number != SIGHUP) {
    LogMessage(LogLevel::kError,
               fmt::format("rank {} of {} was killed by signal {} ({}), which ends the job; the "
                           "output is as it was before",
                           LaunchedRank(), LaunchedSize(), number, strsignal(number)));
  }
  _exit(exit_status);
}

int LaunchedSize() { return FromEnvironment({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}, 1); }
int LaunchedRank() { return FromEnvironment({"OMPI_COMM_WORLD_RANK", "PMI_RANK"}, 0); }

#if HOLBA_WITH_PETSC

void Begin(const std::string& petsc_options) {
  if (!begun) {
    // What is found in files and the environment must not change results.
    static char name[] = "holba", skip[] = "-skip_petscrc", quiet[] = "-no_signal_handler";
    static char* arguments[] = {name, skip, quiet, nullptr};
    int count = 3;
    char** values = arguments;
    HOLBA_CHECK_PETSC(PetscInitialize(&count, &values, nullptr, nullptr));
    begun = true;
    std::atexit(End);
    HOLBA_CHECK_PETSC(PetscPushErrorHandler(PetscReturnErrorHandler, nullptr));
  }
  if (petsc_options.empty()) return;
  if (PetscOptionsInsertString(nullptr, petsc_options.c_str()) != 0) {
    throw InputError("--petsc: PETSc cannot read '" + petsc_options +
                     "'; expected names that begin with '-', each with its value behind it");
  }
}

bool HasBegun() { return begun; }

int Rank() {
  int rank = 0;
  if (begun) MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  return rank;
}
int Size() {
  int size = 1;
  if (begun) MPI_Comm_size(PETSC_COMM_WORLD, &size);
  return size;
}

void Together(const std::function<void()>& action) {
  std::exception_ptr failure;
  try {
    action();
  } catch (...) {
    failure = std::current_exception();
  }
  const int mine = failure ? Rank() : Size();
  int first = mine;
  if (begun) MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, PETSC_COMM_WORLD);
  if (first == Size()) return;
  all_stopped = Size() > 1;
  if (first == Rank()) std::rethrow_exception(failure);
  throw StoppedElsewhere();
}

void EndAll(int exit_status) {
  if (Size() > 1 && !all_stopped) MPI_Abort(PETSC_COMM_WORLD, exit_status);
}

std::string UnusedPetscOptions() {
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  std::string text;
  if (!begun || PetscOptionsLeftGet(nullptr, &count, &names, &values) != 0) return text;
  for (PetscInt i = 0; i < count; ++i) {
    const std::string name = names[i];
    if (name == "skip_petscrc" || name == "no_signal_handler") continue;
    text += (text.empty() ? "-" : ", -") + name;
  }
  PetscOptionsLeftRestore(nullptr, &count, &names, &values);
  return text;
}

#else

void Begin(const std::string&) {
  throw InputError("this holba was built without PETSc; make one with -DHOLBA_WITH_PETSC=ON");
}
bool HasBegun() { return false; }
int Rank() { return 0; }
int Size() { return 1; }
void Together(const std::function<void()>& action) { action(); }
void EndAll(int) {}
std::string UnusedPetscOptions() { return ""; }

#endif

void OnFirst(const std::function<void()>& action) {
  Together([&] {
    if (Rank() == 0) action();
  });
}

}  // namespace holba::ranks
