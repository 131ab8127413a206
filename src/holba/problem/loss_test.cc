// SPDX-License-Identifier: BSD-3-Clause
// Losses: their laws, and agreement with the independent implementation in Ceres.
#include "holba/problem/loss.h"

#include <ceres/loss_function.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace holba {
namespace {

constexpr LossType kTypes[] = {LossType::kTrivial, LossType::kHuber, LossType::kSoftL1,
                               LossType::kCauchy};

std::unique_ptr<ceres::LossFunction> CeresLossOf(const Loss& loss) {
  switch (loss.type) {
    case LossType::kTrivial:
      return std::make_unique<ceres::TrivialLoss>();
    case LossType::kHuber:
      return std::make_unique<ceres::HuberLoss>(loss.scale);
    case LossType::kSoftL1:
      return std::make_unique<ceres::SoftLOneLoss>(loss.scale);
    case LossType::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(loss.scale);
  }
  return nullptr;
}

class EveryLoss : public testing::TestWithParam<std::tuple<LossType, double>> {
 protected:
  const Loss loss{std::get<0>(GetParam()), std::get<1>(GetParam())};
};

TEST_P(EveryLoss, AgreesWithCeres) {
  const auto ceres_loss = CeresLossOf(loss);
  for (double s = 1e-4; s < 1e9; s *= 1.7) {
    double rho[3], expected[3];
    loss.Evaluate(s, rho);
    ceres_loss->Evaluate(s, expected);
    // Ceres' values round 1 + s / scale^2, ours do not.
    const double cancelled = loss.type >= LossType::kSoftL1 ? 1e-15 * loss.scale * loss.scale : 0.0;
    EXPECT_NEAR(rho[0], expected[0], 1e-13 * expected[0] + cancelled) << s;
    EXPECT_NEAR(rho[1], expected[1], 1e-13 * std::abs(expected[1])) << s;
    EXPECT_NEAR(rho[2], expected[2], 1e-13 * std::abs(expected[2])) << s;
    EXPECT_EQ(loss.Cost(s), rho[0]);
  }
}

TEST_P(EveryLoss, HasTheDerivativesOfItsValue) {
  for (const double ratio : {0.01, 0.3, 0.9, 1.2, 3.0, 50.0, 1e4}) {
    const double s = ratio * loss.scale * loss.scale;
    const double h = 1e-4 * s;
    double rho[3], below[3], above[3];
    loss.Evaluate(s, rho);
    loss.Evaluate(s - h, below);
    loss.Evaluate(s + h, above);
    EXPECT_NEAR(rho[1], (above[0] - below[0]) / (2 * h), 1e-7 * rho[1]) << ratio;
    EXPECT_NEAR(rho[2], (above[1] - below[1]) / (2 * h),
                1e-6 * std::abs(rho[2]) + 1e-11 * rho[1] / s)
        << ratio;
  }
}

TEST_P(EveryLoss, IsTheSquareNearZeroAndNeverSteeper) {
  double rho[3];
  loss.Evaluate(0.0, rho);
  EXPECT_EQ(rho[0], 0.0);
  EXPECT_EQ(rho[1], 1.0);
  // rho(s) = s (1 + O(s / scale^2)), to full precision however small s is.
  const double tiny = 1e-14 * loss.scale * loss.scale;
  EXPECT_NEAR(loss.Cost(tiny), tiny, 2e-14 * tiny);
  double last = 0.0;
  for (double s = 1e-6; s < 1e6; s *= 3) {
    loss.Evaluate(s, rho);
    EXPECT_GT(rho[0], last) << s;
    EXPECT_LE(rho[0], s) << s;
    EXPECT_LE(rho[1], 1.0) << s;
    EXPECT_LE(rho[2], 0.0) << s;
    last = rho[0];
  }
}

TEST_P(EveryLoss, ScalesWithTheUnitOfTheResidual) {
  // With residuals and scale in another unit, the cost is in the square of that unit.
  constexpr double kUnit = 1000.0;
  const Loss other{loss.type, kUnit * loss.scale};
  for (const double s : {0.1, 1.0, 7.0, 400.0}) {
    EXPECT_NEAR(other.Cost(kUnit * kUnit * s), kUnit * kUnit * loss.Cost(s),
                1e-10 * kUnit * kUnit * loss.Cost(s));
  }
}

INSTANTIATE_TEST_SUITE_P(TypesAndScales, EveryLoss,
                         testing::Combine(testing::ValuesIn(kTypes),
                                          testing::Values(0.05, 1.0, 3.0, 40.0)));

TEST(Huber, IsContinuousWithItsSlopeWhereItDeparts) {
  const Loss huber{LossType::kHuber, 2.0};
  double below[3], above[3];
  huber.Evaluate(4.0, below);
  huber.Evaluate(std::nextafter(4.0, 5.0), above);
  EXPECT_NEAR(below[0], above[0], 1e-14);
  EXPECT_NEAR(below[1], above[1], 1e-15);
}

TEST(LossNames, AreTheWordsOfTheOptions) {
  EXPECT_EQ(NameOf(LossType::kTrivial), "trivial");
  EXPECT_EQ(NameOf(LossType::kHuber), "huber");
  EXPECT_EQ(NameOf(LossType::kSoftL1), "soft_l1");
  EXPECT_EQ(NameOf(LossType::kCauchy), "cauchy");
}

}  // namespace
}  // namespace holba
