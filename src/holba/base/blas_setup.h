// SPDX-License-Identifier: BSD-3-Clause
// Makes the BLAS that the distribution's Ceres and CHOLMOD load run as fast as this CPU can.
#pragma once

#include <string>
#include <string_view>

namespace holba {

// To be called first thing in main; may start the program anew, once. Two traps of OpenBLAS:
// - A release older than the CPU does not know it and falls back to kernels of the oldest x86-64
//   ("Prescott", SSE3), five times slower than the AVX ones. It chooses while it is loaded, so the
//   variable OPENBLAS_CORETYPE can only be set for a new start of this program.
// - It uses a thread per core inside each call, which competes with the solver's own threads: one
//   thread, unless the user sets OPENBLAS_NUM_THREADS (or OMP_NUM_THREADS).
// Does nothing where OpenBLAS is not loaded, where the user has chosen, or outside Linux on x86-64.
void SetUpBlas();

struct CpuFeatures {
  bool avx2 = false;    // with FMA
  bool avx512 = false;  // F, CD, DQ, BW and VL: what OpenBLAS calls SKYLAKEX
};

// Value for OPENBLAS_CORETYPE if `core_name` (as openblas_get_corename says) is one without AVX
// although the CPU has it; empty: leave it.
std::string BetterBlasCore(std::string_view core_name, const CpuFeatures& cpu);

}  // namespace holba
