// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(Table, IsMarkdownWithColumnsOfEqualWidth) {
  const Table table = {"Times", {"name", "ms"}, {{"a", "1"}, {"longer", "1234"}}};
  EXPECT_EQ(table.Markdown(),
            "Times\n"
            "\n"
            "| name   |   ms |\n"
            "| ------ | ---: |\n"
            "| a      |    1 |\n"
            "| longer | 1234 |\n");
}

TEST(Table, WithoutTitleBeginsWithItsHeader) {
  EXPECT_EQ((Table{"", {"a"}, {{"b"}}}).Markdown(), "| a   |\n| --- |\n| b   |\n");
}

TEST(Table, RefusesARowThatDoesNotFit) {
  EXPECT_THROW((Table{"", {"a", "b"}, {{"1"}}}).Markdown(), CheckError);
}

TEST(CompareInPairs, GivesGeometricMeanWorstAndWins) {
  const std::vector<double> values = {1.0, 6.0, 2.0}, baseline = {2.0, 3.0, 2.0};
  const auto ratio = CompareInPairs(values, baseline);
  ASSERT_TRUE(ratio);
  EXPECT_NEAR(ratio->geometric_mean, 1.0, 1e-15);  // 1/2 * 2 * 1
  EXPECT_EQ(ratio->worst, 2.0);
  EXPECT_EQ(ratio->wins, 1);  // a tie is none
  EXPECT_EQ(ratio->count, 3);
}

TEST(CompareInPairs, DoesNotDependOnTheUnitOfACase) {
  const std::vector<double> values = {1.0, 6.0}, baseline = {2.0, 3.5};
  const std::vector<double> scaled = {1e6, 6.0}, scaled_baseline = {2e6, 3.5};
  EXPECT_NEAR(CompareInPairs(values, baseline)->geometric_mean,
              CompareInPairs(scaled, scaled_baseline)->geometric_mean, 1e-15);
}

TEST(CompareInPairs, IsEmptyWithoutPositivePairs) {
  const std::vector<double> one = {1.0}, two = {1.0, 2.0}, zero = {0.0}, nan = {std::nan("")};
  EXPECT_FALSE(CompareInPairs({}, {}));
  EXPECT_FALSE(CompareInPairs(one, two));
  EXPECT_FALSE(CompareInPairs(one, zero));
  EXPECT_FALSE(CompareInPairs(zero, one));
  EXPECT_FALSE(CompareInPairs(nan, one));
}

TEST(GrowthExponent, IsTheExponentOfAPowerLaw) {
  const std::vector<double> sizes = {100, 200, 500, 1000};
  std::vector<double> values;
  for (const double n : sizes) values.push_back(3e-7 * std::pow(n, 2.7));
  EXPECT_NEAR(GrowthExponent(sizes, values).value(), 2.7, 1e-12);
}

TEST(GrowthExponent, IsEmptyForASingleSize) {
  const std::vector<double> same = {100, 100}, values = {1, 2}, one = {100};
  EXPECT_FALSE(GrowthExponent(same, values));
  EXPECT_FALSE(GrowthExponent(one, one));
  EXPECT_FALSE(GrowthExponent({}, {}));
}

TEST(WholeNumbers, NamesTheOptionOfAFractionOrTooSmallANumber) {
  const std::vector<double> good = {10, 200}, fraction = {10.5}, small = {9}, huge = {1e12};
  EXPECT_THAT(WholeNumbers("num_images", good, 10), ElementsAre(10, 200));
  for (const auto& bad : {fraction, small, huge}) {
    EXPECT_THAT([&] { WholeNumbers("num_images", bad, 10); },
                ThrowsMessage<InputError>(HasSubstr("--num_images")));
  }
}

TEST(ThreeDigits, KeepsThreeSignificantDigitsWithoutExponent) {
  EXPECT_EQ(ThreeDigits(0.012345), "0.0123");
  EXPECT_EQ(ThreeDigits(4.5678), "4.57");
  EXPECT_EQ(ThreeDigits(99.96), "100");
  EXPECT_EQ(ThreeDigits(0.9996), "1.00");
  EXPECT_EQ(ThreeDigits(123456), "123456");
  EXPECT_EQ(ThreeDigits(0.0), "0");
  EXPECT_EQ(ThreeDigits(-0.5), "-0.500");
}

}  // namespace
}  // namespace holba
