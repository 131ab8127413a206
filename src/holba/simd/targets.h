// SPDX-License-Identifier: BSD-3-Clause
// Instruction sets that vectorised code is built for, and the choice among them at run time.
//
// A file X_simd.cc is compiled once for each target, with that target's compiler flags and
// HOLBA_SIMD_TARGET defined as its name, which is also the namespace its code stands in. Such files
// include pack.h and formulas that are templates on the pack, never Eigen or the containers of the
// standard library: their inline functions, compiled with wider flags, would replace the ones of
// the rest of the program at link time. Callers declare the functions with HOLBA_SIMD_DECLARE and
// choose with HOLBA_SIMD_CHOOSE.
#pragma once

#include <string_view>

namespace holba {

// Lanes of doubles: 1, 2 (SSE2 on x86-64, Neon on ARM: the baseline), 4 (AVX2 with FMA), 8 (AVX-512
// F, DQ and VL).
enum class SimdTarget { kScalar, kVec128, kVec256, kVec512 };

std::string_view NameOf(SimdTarget target);  // scalar, vec128, vec256, vec512

// The widest that this CPU and this build have, or what the environment variable HOLBA_SIMD says
// (one of the names; a wider one than the CPU has is ignored).
SimdTarget CurrentSimdTarget();
bool IsSupported(SimdTarget target);
// For tests; CHECKs that it is supported. Not while another thread computes.
void SetSimdTarget(SimdTarget target);

inline constexpr int kMaxSimdLanes = 8;

}  // namespace holba

#if defined(__x86_64__)
#define HOLBA_SIMD_HAS_WIDE 1
#else
#define HOLBA_SIMD_HAS_WIDE 0
#endif

#if HOLBA_SIMD_HAS_WIDE
#define HOLBA_SIMD_DECLARE(declaration) \
  namespace scalar {                    \
  declaration;                          \
  }                                     \
  namespace vec128 {                    \
  declaration;                          \
  }                                     \
  namespace vec256 {                    \
  declaration;                          \
  }                                     \
  namespace vec512 {                    \
  declaration;                          \
  }
#define HOLBA_SIMD_CHOOSE_IN(space, function)                                                \
  (::holba::CurrentSimdTarget() == ::holba::SimdTarget::kVec512   ? &space::vec512::function \
   : ::holba::CurrentSimdTarget() == ::holba::SimdTarget::kVec256 ? &space::vec256::function \
   : ::holba::CurrentSimdTarget() == ::holba::SimdTarget::kVec128 ? &space::vec128::function \
                                                                  : &space::scalar::function)
#else
#define HOLBA_SIMD_DECLARE(declaration) \
  namespace scalar {                    \
  declaration;                          \
  }                                     \
  namespace vec128 {                    \
  declaration;                          \
  }
#define HOLBA_SIMD_CHOOSE_IN(space, function)                                              \
  (::holba::CurrentSimdTarget() == ::holba::SimdTarget::kVec128 ? &space::vec128::function \
                                                                : &space::scalar::function)
#endif
// Of functions declared in namespace holba itself; CHOOSE_IN: in another one.
#define HOLBA_SIMD_CHOOSE(function) HOLBA_SIMD_CHOOSE_IN(::holba, function)
