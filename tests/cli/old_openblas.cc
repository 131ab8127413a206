// SPDX-License-Identifier: BSD-3-Clause
// Stands in (LD_PRELOAD) for an OpenBLAS that is older than the CPU: it names the oldest kernels
// unless told otherwise by OPENBLAS_CORETYPE, and counts the program's starts in the file
// OLD_OPENBLAS_STARTS.
#include <cstdio>
#include <cstdlib>

extern "C" char* openblas_get_corename() {
  static char old_core[] = "Prescott";
  if (const char* path = std::getenv("OLD_OPENBLAS_STARTS")) {
    if (FILE* file = std::fopen(path, "a")) {
      std::fputs("start\n", file);
      std::fclose(file);
    }
  }
  char* const chosen = std::getenv("OPENBLAS_CORETYPE");
  return chosen != nullptr ? chosen : old_core;
}
