// SPDX-License-Identifier: BSD-3-Clause
#include "holba/simd/targets.h"

#include <cstdlib>
#include <string>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr SimdTarget kAll[] = {SimdTarget::kVec512, SimdTarget::kVec256, SimdTarget::kVec128,
                               SimdTarget::kScalar};

SimdTarget Choose() {
  const char* wanted = std::getenv("HOLBA_SIMD");
  for (SimdTarget target : kAll) {
    if (!IsSupported(target)) continue;
    if (wanted == nullptr || NameOf(target) == wanted) return target;
  }
  for (SimdTarget target : kAll) {
    if (IsSupported(target)) return target;
  }
  return SimdTarget::kScalar;
}

SimdTarget& Current() {
  static SimdTarget target = Choose();
  return target;
}

}  // namespace

std::string_view NameOf(SimdTarget target) {
  switch (target) {
    case SimdTarget::kScalar:
      return "scalar";
    case SimdTarget::kVec128:
      return "vec128";
    case SimdTarget::kVec256:
      return "vec256";
    case SimdTarget::kVec512:
      return "vec512";
  }
  return "";
}

bool IsSupported(SimdTarget target) {
#if HOLBA_SIMD_HAS_WIDE
  if (target == SimdTarget::kVec256) {
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  }
  if (target == SimdTarget::kVec512) {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl") && IsSupported(SimdTarget::kVec256);
  }
  return true;
#else
  return target == SimdTarget::kScalar || target == SimdTarget::kVec128;
#endif
}

SimdTarget CurrentSimdTarget() { return Current(); }

void SetSimdTarget(SimdTarget target) {
  HOLBA_CHECK_MSG(IsSupported(target), std::string(NameOf(target)));
  Current() = target;
}

}  // namespace holba
