// SPDX-License-Identifier: BSD-3-Clause
#include "apps/build_info.h"

#include <fmt/format.h>

#include "holba/simd/targets.h"
#include "holba_revision.h"  // HOLBA_REVISION, made anew by each build

namespace holba {
namespace {

std::string CompilerText() {
#if defined(__clang__)
  return fmt::format("Clang {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#elif defined(__GNUC__)
  return fmt::format("GCC {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#else
  return "an unknown compiler";
#endif
}

std::string InstructionSets() {
  std::string supported;
  for (const SimdTarget target :
       {SimdTarget::kScalar, SimdTarget::kVec128, SimdTarget::kVec256, SimdTarget::kVec512}) {
    if (IsSupported(target))
      supported += (supported.empty() ? "" : ", ") + std::string(NameOf(target));
  }
  return fmt::format("{} (of {})", NameOf(CurrentSimdTarget()), supported);
}

}  // namespace

std::string VersionText() {
  return fmt::format(
      "holba {}\n"
      "revision         {}\n"
      "built            {}, {}, {}\n"
      "with             {}\n"
      "instruction set  {}\n",
      HOLBA_VERSION, HOLBA_REVISION, CompilerText(), HOLBA_BUILD_TYPE, HOLBA_PROCESSOR,
      HOLBA_BUILT_WITH, InstructionSets());
}

}  // namespace holba
