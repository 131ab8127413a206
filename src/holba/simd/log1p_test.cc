// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/simd/log1p_testing.h"

namespace holba {
namespace {

class Log1pOfPacks : public testing::TestWithParam<SimdTarget> {
 protected:
  void SetUp() override {
    if (!IsSupported(GetParam())) GTEST_SKIP() << "this CPU has no " << NameOf(GetParam());
    SetSimdTarget(GetParam());
  }
  void TearDown() override { SetSimdTarget(before_); }

  static std::vector<double> OfEach(std::vector<double> x) {
    const size_t n = x.size();
    x.resize((n + kMaxSimdLanes - 1) / kMaxSimdLanes * kMaxSimdLanes, 0.0);
    std::vector<double> y(x.size());
    HOLBA_SIMD_CHOOSE(Log1pOfEach)(x.data(), x.size(), y.data());
    y.resize(n);
    return y;
  }

 private:
  const SimdTarget before_ = CurrentSimdTarget();
};

TEST_P(Log1pOfPacks, HasFifteenDigitsOverTheWholeRange) {
  Random random(3);
  std::vector<double> x{0.0,
                        1.0,
                        0.5,
                        -0.5,
                        0x1p-53,
                        -0x1p-53,
                        0x1p53,
                        5e-324,
                        1e-310,
                        std::numeric_limits<double>::max(),
                        std::sqrt(2.0) - 1.0,
                        std::sqrt(0.5) - 1.0,
                        -1.0 + 0x1p-53,
                        -1.0 + 0x1p-20};
  for (int i = 0; i < 200000; ++i) {
    x.push_back(std::exp(random.Uniform(-700.0, 700.0)));
    x.push_back(std::exp(random.Uniform(-40.0, 40.0)));
    x.push_back(random.Uniform(0.0, 3.0));
    x.push_back(-random.Uniform());
    x.push_back(-std::exp(random.Uniform(-40.0, 0.0)));
  }
  const std::vector<double> y = OfEach(x);
  double worst = 0.0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double expected = std::log1p(x[i]);
    if (std::isinf(expected)) continue;  // x rounded to -1
    const double error = std::abs(y[i] - expected);
    ASSERT_LE(error, 1e-15 * std::abs(expected)) << "x = " << x[i];
    if (expected != 0.0) worst = std::max(worst, error / std::abs(expected));
  }
  RecordProperty("worst_relative_error", std::to_string(worst));
}

TEST_P(Log1pOfPacks, IsThatOfTheLibraryAtTheEnds) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<double> y =
      OfEach({infinity, -1.0, -1.5, -infinity, std::numeric_limits<double>::quiet_NaN()});
  EXPECT_EQ(y[0], infinity);
  EXPECT_EQ(y[1], -infinity);
  EXPECT_THAT(y[2], testing::IsNan());
  EXPECT_THAT(y[3], testing::IsNan());
  EXPECT_THAT(y[4], testing::IsNan());
}

INSTANTIATE_TEST_SUITE_P(All, Log1pOfPacks,
                         testing::Values(SimdTarget::kScalar, SimdTarget::kVec128,
                                         SimdTarget::kVec256, SimdTarget::kVec512),
                         [](const auto& info) { return std::string(NameOf(info.param)); });

}  // namespace
}  // namespace holba
