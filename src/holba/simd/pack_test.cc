// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <string>

#include "holba/simd/pack_testing.h"

namespace holba {
namespace {

class SimdTargets : public testing::TestWithParam<SimdTarget> {
 protected:
  void SetUp() override {
    if (!IsSupported(GetParam())) GTEST_SKIP() << "this CPU has no " << NameOf(GetParam());
    SetSimdTarget(GetParam());
  }
  void TearDown() override { SetSimdTarget(before); }
  const SimdTarget before = CurrentSimdTarget();
};

TEST_P(SimdTargets, ComputeLaneByLaneWhatPlainDoublesGive) {
  const double a[] = {1.5, -2.25, 0.0, 1e300, -4.0, 9.0, 0.1, -1e-300};
  const double b[] = {1.25, 3.0, 0.0, 2e300, -5.0, 8.0, 0.2, 1.0};
  const double table[] = {10, 11, 12, 13, 14, 15, 16, 17};
  const int64_t idx[] = {3, 0, 7, 7, 1, 2, 6, 5};
  PackResults results;
  const int lanes = HOLBA_SIMD_CHOOSE(ComputePacks)(a, b, table, idx, &results);
  EXPECT_EQ(lanes, GetParam() == SimdTarget::kScalar   ? 1
                   : GetParam() == SimdTarget::kVec128 ? 2
                   : GetParam() == SimdTarget::kVec256 ? 4
                                                       : 8);
  double sum = 0.0;
  bool any = false, all = true;
  for (int i = 0; i < lanes; ++i) {
    EXPECT_DOUBLE_EQ(results.fma[i], a[i] * b[i] + 0.5);
    EXPECT_EQ(results.sqrt_abs[i], std::sqrt(std::abs(a[i])));
    EXPECT_EQ(results.larger[i], std::max(a[i], b[i]));
    EXPECT_EQ(results.gathered[i], table[idx[i]]);
    EXPECT_EQ(results.less[i], a[i] < b[i]);
    any |= a[i] < b[i];
    all &= a[i] < b[i];
    sum += a[i];
  }
  EXPECT_EQ(results.sum, sum);
  EXPECT_EQ(results.any_less, any);
  EXPECT_EQ(results.all_less, all);
}

TEST_P(SimdTargets, TellAnyFromAll) {
  const double zeros[kMaxSimdLanes] = {};
  const int64_t idx[kMaxSimdLanes] = {};
  for (int last = -1; last < kMaxSimdLanes; ++last) {
    double a[kMaxSimdLanes];
    for (int i = 0; i < kMaxSimdLanes; ++i) a[i] = i <= last ? -1.0 : 1.0;
    PackResults results;
    const int lanes = HOLBA_SIMD_CHOOSE(ComputePacks)(a, zeros, zeros, idx, &results);
    EXPECT_EQ(results.any_less, last >= 0);
    EXPECT_EQ(results.all_less, last >= lanes - 1);
  }
}

TEST_P(SimdTargets, LoadRowsOfEveryLengthAndNoByteBeyondThem) {
  // The last row ends where memory ends.
  const size_t page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  void* const memory =
      mmap(nullptr, 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  ASSERT_EQ(mprotect(static_cast<char*>(memory) + page, page, PROT_NONE), 0);
  double* const values = static_cast<double*>(memory);
  const int64_t size = static_cast<int64_t>(page / sizeof(double));
  for (int64_t i = 0; i < size; ++i) values[i] = static_cast<double>(i);
  for (int n = 1; n <= kMaxTestedRow; ++n) {
    const int64_t last = size - n;
    const int64_t idx[kMaxSimdLanes] = {last, 0, 3, last - 1, 100, 0, 7, last};
    double rows[kMaxTestedRow * kMaxSimdLanes] = {};
    const int lanes = HOLBA_SIMD_CHOOSE(LoadRowsInto)(n, values, idx, rows);
    for (int k = 0; k < n; ++k) {
      for (int l = 0; l < lanes; ++l)
        EXPECT_EQ(rows[k * kMaxSimdLanes + l], static_cast<double>(idx[l] + k)) << n;
    }
  }
  munmap(memory, 2 * page);
}

INSTANTIATE_TEST_SUITE_P(All, SimdTargets,
                         testing::Values(SimdTarget::kScalar, SimdTarget::kVec128,
                                         SimdTarget::kVec256, SimdTarget::kVec512),
                         [](const auto& info) { return std::string(NameOf(info.param)); });

}  // namespace
}  // namespace holba
