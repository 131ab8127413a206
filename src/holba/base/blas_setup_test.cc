// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/blas_setup.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

TEST(BetterBlasCore, AnOldCoreOnANewCpuGivesTheWidestKernelsThatTheCpuHas) {
  EXPECT_EQ(BetterBlasCore("Prescott", {.avx2 = true, .avx512 = true}), "SKYLAKEX");
  EXPECT_EQ(BetterBlasCore("Nehalem", {.avx2 = true, .avx512 = false}), "HASWELL");
}

TEST(BetterBlasCore, ACpuWithoutAvx2IsLeftAlone) { EXPECT_EQ(BetterBlasCore("Prescott", {}), ""); }

TEST(BetterBlasCore, ACoreWithAvxIsLeftAlone) {
  for (const char* core :
       {"Haswell", "SkylakeX", "Zen", "Sandybridge", "Cooperlake", "Excavator"}) {
    EXPECT_EQ(BetterBlasCore(core, {.avx2 = true, .avx512 = true}), "") << core;
  }
}

}  // namespace
}  // namespace holba
