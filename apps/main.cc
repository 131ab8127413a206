// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_line.h"
#include "holba/base/blas_setup.h"
#include "holba/base/temporary_paths.h"

int main(int argc, char** argv) {
  holba::SetUpBlas();
  holba::RemoveTemporaryPathsOnSignal();
  return holba::RunProgram({argv + (argc > 0), argv + argc});
}
