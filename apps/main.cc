// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_line.h"
#include "holba/base/blas_setup.h"
#include "holba/base/temporary_paths.h"
#include "holba/solver/ranks.h"

int main(int argc, char** argv) {
  holba::SetUpBlas();
  // With the status of a fault that is not the input's.
  holba::ranks::GuardAgainstDeath(2);
  holba::RemoveTemporaryPathsOnSignal();
  return holba::RunProgram({argv + (argc > 0), argv + argc});
}
