// SPDX-License-Identifier: BSD-3-Clause
#include "holba/problem/weigh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/simd/targets.h"

namespace holba {
namespace {

// Batches here are only their shape: residuals of 3, as many blocks as there may be, the first and
// the last of tangents 2 and 4.
class Shape final : public ResidualBatch {
 public:
  Shape() : ResidualBatch("shape", 3, Tangents()) {}
  static std::vector<int> Tangents() {
    std::vector<int> tangents(kMaxSlots, 1);
    tangents.front() = 2;
    tangents.back() = 4;
    return tangents;
  }
  void EvaluateRange(const ResidualRange&, const ParameterReader&,
                     const ResidualPanel&) const override {}
};

struct Panel {
  std::vector<double> residuals, first, second;
  std::unique_ptr<bool[]> present;
  ResidualPanel panel;

  Panel(size_t count, size_t stride, const std::vector<double>& norms)
      : residuals(3 * stride, kBeyond),
        first(6 * stride, kBeyond),
        second(12 * stride, kBeyond),
        present(std::make_unique<bool[]>(count)) {
    Random random(17);
    const auto fill = [&](std::vector<double>* entries, size_t j, double scale) {
      for (size_t k = j; k < entries->size(); k += stride) (*entries)[k] = scale * random.Normal();
    };
    for (size_t j = 0; j < count; ++j) {
      present[j] = j % 7 != 3;
      fill(&residuals, j, present[j] ? norms[j % norms.size()] : 0.0);
      fill(&first, j, present[j]);
      fill(&second, j, present[j]);
    }
    panel.stride = stride;
    panel.residuals = residuals.data();
    panel.jacobians.front() = first.data();
    panel.jacobians.back() = second.data();
    panel.present = present.get();
  }

  static constexpr double kBeyond = std::numeric_limits<double>::quiet_NaN();
};

using Parameters = std::tuple<SimdTarget, LossType, double>;

class Weighing : public testing::TestWithParam<Parameters> {
 protected:
  void SetUp() override {
    if (!IsSupported(std::get<0>(GetParam()))) GTEST_SKIP();
    SetSimdTarget(std::get<0>(GetParam()));
    batch.loss = {std::get<1>(GetParam()), 0.7};
    batch.weight = std::get<2>(GetParam());
  }
  void TearDown() override { SetSimdTarget(before_); }

  Shape batch;
  const std::vector<double> norms{1e-9, 1e-3, 0.3, 0.7, 2.0, 100.0};

 private:
  const SimdTarget before_ = CurrentSimdTarget();
};

TEST_P(Weighing, MultipliesByTheRootOfTheSlopeAndAddsUpTheLoss) {
  for (const size_t count :
       {size_t{0}, size_t{1}, size_t{5}, size_t{8}, size_t{64}, size_t{129}, size_t{300}}) {
    const size_t stride = std::max<size_t>((count + 7) / 8 * 8, 8);
    const Panel before(count, stride, norms);
    Panel weighed(count, stride, norms);
    const PanelCost cost_alone = CostOfPanel(batch, count, weighed.panel);
    EXPECT_THAT(weighed.residuals,
                testing::Pointwise(testing::NanSensitiveDoubleEq(), before.residuals));
    const PanelCost cost = WeighPanel(batch, count, weighed.panel);
    double expected_cost = 0.0, expected_squares = 0.0;
    size_t absent = 0;
    for (size_t j = 0; j < count; ++j) {
      double s = 0.0;
      for (int k = 0; k < 3; ++k) s += std::pow(before.residuals[k * stride + j], 2);
      double rho[3];
      batch.loss.Evaluate(s, rho);
      const double factor = std::sqrt(batch.weight * rho[1]);
      const auto expect = [&](const std::vector<double>& to, const std::vector<double>& from) {
        for (size_t k = j; k < to.size(); k += stride) {
          EXPECT_NEAR(to[k], factor * from[k], 1e-14 * std::abs(factor * from[k]));
        }
      };
      expect(weighed.residuals, before.residuals);
      expect(weighed.first, before.first);
      expect(weighed.second, before.second);
      if (!before.present[j]) {
        ++absent;
        continue;
      }
      expected_cost += 0.5 * batch.weight * rho[0];
      expected_squares += s;
    }
    EXPECT_NEAR(cost.cost, expected_cost, 1e-13 * expected_cost);
    EXPECT_NEAR(cost.sum_squares, expected_squares, 1e-13 * expected_squares);
    EXPECT_EQ(cost.absent, absent);
    EXPECT_EQ(cost_alone.cost, cost.cost);
    EXPECT_EQ(cost_alone.sum_squares, cost.sum_squares);
    EXPECT_EQ(cost_alone.absent, absent);
  }
}

TEST_P(Weighing, OfARangeOfOneIsThatOfAPanel) {
  Panel one(1, 1, norms), panel(1, 8, norms);
  const PanelCost a = WeighPanel(batch, 1, one.panel), b = WeighPanel(batch, 1, panel.panel);
  EXPECT_DOUBLE_EQ(a.cost, b.cost);
  for (int k = 0; k < 3; ++k) EXPECT_DOUBLE_EQ(one.residuals[k], panel.residuals[8 * k]);
  for (int k = 0; k < 12; ++k) EXPECT_DOUBLE_EQ(one.second[k], panel.second[8 * k]);
}

TEST_P(Weighing, LeavesJacobiansThatAreNotThere) {
  Panel panel(9, 16, norms);
  panel.panel.jacobians[0] = nullptr;
  const std::vector<double> first = panel.first;
  WeighPanel(batch, 9, panel.panel);
  EXPECT_THAT(panel.first, testing::Pointwise(testing::NanSensitiveDoubleEq(), first));
}

INSTANTIATE_TEST_SUITE_P(All, Weighing,
                         testing::Combine(testing::Values(SimdTarget::kScalar, SimdTarget::kVec128,
                                                          SimdTarget::kVec256, SimdTarget::kVec512),
                                          testing::Values(LossType::kTrivial, LossType::kHuber,
                                                          LossType::kSoftL1, LossType::kCauchy),
                                          testing::Values(1.0, 3.7)),
                         [](const auto& info) {
                           return std::string(NameOf(std::get<0>(info.param))) + "_" +
                                  std::string(NameOf(std::get<1>(info.param))) +
                                  (std::get<2>(info.param) == 1.0 ? "" : "_weighted");
                         });

}  // namespace
}  // namespace holba
