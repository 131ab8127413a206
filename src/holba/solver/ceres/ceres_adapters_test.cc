// SPDX-License-Identifier: BSD-3-Clause
// What Ceres sees of manifolds, losses and residuals is what the problem says.
#include "holba/solver/ceres/ceres_adapters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "holba/base/random.h"

namespace holba {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using testing::Each;
using testing::ElementsAre;

std::vector<double> RandomPose(Random* random) {
  const Eigen::Quaterniond q = ExpRotation({random->Normal(), random->Normal(), random->Normal()});
  return {q.x(), q.y(), q.z(), q.w(), random->Normal(), random->Normal(), random->Normal()};
}

std::vector<double> RandomLine(Random* random) {
  const Eigen::Vector3d d =
      Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()).normalized();
  return {d.x(), d.y(), d.z(), random->Normal(), random->Normal(), random->Normal()};
}

struct ManifoldCase {
  const ManifoldOps* ops;
  std::vector<double> (*make)(Random*);
  uint32_t held;
};

class CeresManifoldOf : public testing::TestWithParam<ManifoldCase> {};

TEST_P(CeresManifoldOf, MovesTheFreeCoordinatesOnlyAndBackAgain) {
  const auto& [ops, make, held] = GetParam();
  Random random(5);
  const CeresManifold manifold(*ops, held);
  ASSERT_EQ(manifold.AmbientSize(), ops->ambient);
  ASSERT_EQ(manifold.TangentSize(), ops->tangent - std::popcount(held));
  const int n = manifold.TangentSize();
  for (int repeat = 0; repeat < 20; ++repeat) {
    const std::vector<double> x = make(&random);
    std::vector<double> delta(n), back(n), moved(ops->ambient), full(ops->tangent);
    for (double& d : delta) d = random.Normal(0.3);
    ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), moved.data()));
    ASSERT_TRUE(manifold.Minus(moved.data(), x.data(), back.data()));
    EXPECT_THAT(back, testing::Pointwise(testing::DoubleNear(1e-12), delta));
    // In the problem's own coordinates the held ones stayed where they were.
    ops->minus(moved.data(), x.data(), full.data());
    for (int i = 0, free = 0; i < ops->tangent; ++i) {
      EXPECT_NEAR(full[i], held >> i & 1 ? 0.0 : delta[free++], 1e-12);
    }
  }
}

TEST_P(CeresManifoldOf, PicksTheFreeCoordinatesOfTangentJacobians) {
  const auto& [ops, make, held] = GetParam();
  Random random(6);
  const CeresManifold manifold(*ops, held);
  const int n = manifold.TangentSize(), m = ops->ambient;
  const std::vector<double> x = make(&random);
  Matrix plus(m, n), minus(n, m), lifted = Matrix::Zero(2, m);
  for (int i = 0; i < 2 * ops->tangent; ++i) lifted(i % 2, i / 2) = random.Normal();
  ASSERT_TRUE(manifold.PlusJacobian(x.data(), plus.data()));
  ASSERT_TRUE(manifold.MinusJacobian(x.data(), minus.data()));
  EXPECT_EQ(minus * plus, Matrix::Identity(n, n));
  const Matrix picked = lifted * plus;
  for (int i = 0, free = 0; i < ops->tangent; ++i) {
    if (held >> i & 1) continue;
    EXPECT_EQ(picked.col(free++), lifted.col(i));
  }
}

// What Ceres takes for the derivative by the step is that of Plus.
TEST_P(CeresManifoldOf, MovesByTheStepItself) {
  const auto& [ops, make, held] = GetParam();
  Random random(7);
  const CeresManifold manifold(*ops, held);
  const int n = manifold.TangentSize(), m = ops->ambient;
  const std::vector<double> x = make(&random);
  Matrix by_tangent(m, ops->tangent);
  ops->plus_jacobian(x.data(), by_tangent.data());
  for (int c = 0, t = 0; c < n; ++c, ++t) {
    while (held >> t & 1) ++t;
    constexpr double h = 1e-6;
    std::vector<double> delta(n, 0.0), above(m), below(m);
    delta[c] = h;
    manifold.Plus(x.data(), delta.data(), above.data());
    delta[c] = -h;
    manifold.Plus(x.data(), delta.data(), below.data());
    for (int r = 0; r < m; ++r) {
      EXPECT_NEAR(by_tangent(r, t), (above[r] - below[r]) / (2 * h), 1e-9);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Manifolds, CeresManifoldOf,
    testing::Values(ManifoldCase{&OpsOf<PoseManifold>(), &RandomPose, 0},
                    ManifoldCase{&OpsOf<PoseManifold>(), &RandomPose, 0b010000},
                    ManifoldCase{&OpsOf<PoseManifold>(), &RandomPose, 0b100101},
                    ManifoldCase{&OpsOf<LineManifold>(), &RandomLine, 0},
                    ManifoldCase{&OpsOf<LineManifold>(), &RandomLine, 0b1100},
                    ManifoldCase{&EuclideanOps(4),
                                 [](Random* r) {
                                   return std::vector<double>{r->Normal(), 2, 3, 4};
                                 },
                                 0b1010}));

TEST(CeresLoss, MultipliesTheRobustifiedCostByTheWeight) {
  const Loss loss{LossType::kCauchy, 0.7};
  const CeresLoss weighted(loss, 5.0);
  double rho[3], expected[3];
  for (const double s : {0.0, 0.3, 9.0}) {
    loss.Evaluate(s, expected);
    weighted.Evaluate(s, rho);
    for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(rho[i], 5.0 * expected[i]);
  }
}

// r = (R p + t) - datum of a pose and the anchor p of a line, with the line's direction in the
// third component's Jacobian; absent where t_z < 0.
struct AnchorKernel {
  using Datum = Eigen::Vector3d;
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    const double* pose = values[0];
    if (pose[6] < 0) return false;
    const Eigen::Matrix3d R =
        Eigen::Quaterniond(pose[3], pose[0], pose[1], pose[2]).toRotationMatrix();
    const Eigen::Map<const Eigen::Vector3d> d(values[1]), p(values[1] + 3), t(pose + 4);
    const Eigen::Vector3d rotated = R * p;
    Eigen::Map<Eigen::Vector3d>{r} = rotated + t + R * d - datum;
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(d);
    if (jacobians[0]) {
      Eigen::Map<RowMajor<3, 6>> J(jacobians[0]);
      J.leftCols<3>() = -CrossMatrix((rotated + R * d).eval());
      J.rightCols<3>().setIdentity();
    }
    if (jacobians[1]) {
      Eigen::Map<RowMajor<3, 4>> J(jacobians[1]);
      J.leftCols<2>() = R * basis;
      J.rightCols<2>() = R * basis;
    }
    return true;
  }
};

struct AnchorProblem {
  Problem problem;
  BlockId pose, line;
  ResidualMemory memory;
  std::unique_ptr<CeresResidual> residual;

  explicit AnchorProblem(Random* random) {
    std::vector<double> values = RandomPose(random);
    values[6] = 2.0;
    pose = problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values);
    line = problem.AddBlock("line", OpsOf<LineManifold>(), BlockRole::kFeature, RandomLine(random));
    auto batch = std::make_unique<KernelBatch<AnchorKernel>>("anchor", 3, std::vector<int>{6, 4},
                                                             AnchorKernel{});
    batch->Add(std::array{pose, line}, Eigen::Vector3d(0.1, 0.2, 0.3));
    problem.AddBatch(std::move(batch));
    memory.Resize(1, 3);
    residual = std::make_unique<CeresResidual>(problem, *problem.batches()[0], 0, &memory);
  }
};

TEST(CeresResidual, GivesJacobiansWhoseTangentPartIsOurs) {
  Random random(8);
  for (int repeat = 0; repeat < 10; ++repeat) {
    AnchorProblem p(&random);
    EXPECT_THAT(p.residual->parameter_block_sizes(), ElementsAre(7, 6));
    EXPECT_EQ(p.residual->num_residuals(), 3);
    const double* parameters[] = {p.problem.values(p.pose), p.problem.values(p.line)};
    Matrix by_pose(3, 7), by_line(3, 6), ours_pose(3, 6), ours_line(3, 4);
    double r[3], ours[3];
    double* jacobians[] = {by_pose.data(), by_line.data()};
    ASSERT_TRUE(p.residual->Evaluate(parameters, r, jacobians));

    bool present = false;
    ResidualPanel panel;
    panel.residuals = ours;
    panel.jacobians = {ours_pose.data(), ours_line.data()};
    panel.present = &present;
    p.problem.batches()[0]->Evaluate(0, 1, p.problem.Reader(), panel);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(r[k], ours[k]);
    for (const uint32_t held : {0u, 0b010000u}) {
      const CeresManifold manifold(OpsOf<PoseManifold>(), held);
      Matrix plus(7, manifold.TangentSize());
      manifold.PlusJacobian(parameters[0], plus.data());
      Matrix expected(3, manifold.TangentSize());
      for (int c = 0, to = 0; c < 6; ++c) {
        if (!(held >> c & 1)) expected.col(to++) = ours_pose.col(c);
      }
      EXPECT_LT((by_pose * plus - expected).cwiseAbs().maxCoeff(), 1e-12);
    }
    Matrix plus(6, 4);
    CeresManifold(OpsOf<LineManifold>(), 0).PlusJacobian(parameters[1], plus.data());
    EXPECT_LT((by_line * plus - ours_line).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(CeresResidual, CountsNothingWhileItWasNeverPresent) {
  Random random(9);
  AnchorProblem p(&random);
  p.problem.values(p.pose)[6] = -1.0;
  const double* parameters[] = {p.problem.values(p.pose), p.problem.values(p.line)};
  double r[3] = {1, 1, 1}, by_pose[21], by_line[18];
  double* jacobians[] = {by_pose, by_line};
  ASSERT_TRUE(p.residual->Evaluate(parameters, r, jacobians));
  EXPECT_THAT(r, Each(0.0));
  EXPECT_THAT(by_pose, Each(0.0));
  EXPECT_THAT(by_line, Each(0.0));
  EXPECT_EQ(p.memory.known[0], 0);
  EXPECT_EQ(p.memory.present[0], 0);
}

TEST(CeresResidual, KeepsItsLastAcceptedValueWithAZeroJacobianWhileItIsAbsent) {
  Random random(10);
  AnchorProblem p(&random);
  double* pose = p.problem.values(p.pose);
  const double* parameters[] = {pose, p.problem.values(p.line)};
  double accepted[3], tried[3], r[3], by_pose[21], by_line[18];
  double* jacobians[] = {by_pose, by_line};
  ASSERT_TRUE(
      p.residual->Evaluate(parameters, accepted, jacobians));  // an accepted state: with Jacobians
  pose[4] += 10.0;
  ASSERT_TRUE(p.residual->Evaluate(parameters, tried, nullptr));  // a step that was only tried
  EXPECT_NE(tried[0], accepted[0]);
  pose[6] = -1.0;
  for (const bool with_jacobians : {false, true}) {
    ASSERT_TRUE(p.residual->Evaluate(parameters, r, with_jacobians ? jacobians : nullptr));
    EXPECT_THAT(r, ElementsAre(accepted[0], accepted[1], accepted[2]))
        << "of the accepted state, not the tried one";
  }
  EXPECT_THAT(by_pose, Each(0.0));
  EXPECT_THAT(by_line, Each(0.0));
  EXPECT_EQ(p.memory.known[0], 1);
  EXPECT_EQ(p.memory.present[0], 0);
}

}  // namespace
}  // namespace holba
