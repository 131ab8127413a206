// SPDX-License-Identifier: BSD-3-Clause
// What README.md states: two cameras and three points in a world of one dimension.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <memory>
#include <vector>

#include "holba/linear/reduced_solver.h"
#include "holba/solver/native/normal_equations.h"

namespace holba::native {
namespace {

using testing::ElementsAre;

// r = first value - sum of the others - observation; all blocks have one coordinate.
struct DifferenceKernel {
  using Datum = double;
  int num_slots;
  bool Evaluate(const Datum& observation, const double* const* values, double* r,
                double* const* jacobians) const {
    r[0] = values[0][0] - observation;
    for (int s = 1; s < num_slots; ++s) r[0] -= values[s][0];
    for (int s = 0; s < num_slots; ++s) {
      if (jacobians[s]) jacobians[s][0] = s == 0 ? 1.0 : -1.0;
    }
    return true;
  }
};

struct Example {
  Problem problem;
  BlockId pose_A, pose_B, C, D, points[3];

  // with_D: pose B has intrinsics of its own. with_priors: of the intrinsics.
  Example(bool with_D, bool with_priors) {
    pose_A = Add(BlockRole::kPose);
    pose_B = Add(BlockRole::kPose);
    C = Add(BlockRole::kIntrinsics);
    D = with_D ? Add(BlockRole::kIntrinsics) : C;
    for (BlockId& point : points) point = Add(BlockRole::kFeature);
    auto observations = Batch("observations", 3), pose_prior = Batch("pose prior", 1),
         intrinsics_prior = Batch("intrinsics prior", 1);
    observations->Add(std::array{points[0], pose_A, C}, -2.0);
    observations->Add(std::array{points[0], pose_B, D}, 0.0);
    observations->Add(std::array{points[1], pose_A, C}, 0.0);
    observations->Add(std::array{points[1], pose_B, D}, 0.0);
    observations->Add(std::array{points[2], pose_B, D}, 0.0);
    pose_prior->Add(std::array{pose_A}, 0.0);
    if (with_priors) intrinsics_prior->Add(std::array{C}, 0.0);
    if (with_priors && with_D) intrinsics_prior->Add(std::array{D}, 0.0);
    problem.AddBatch(std::move(observations));
    problem.AddBatch(std::move(pose_prior));
    problem.AddBatch(std::move(intrinsics_prior));
  }

 private:
  BlockId Add(BlockRole role) {
    const double zero = 0.0;
    return problem.AddBlock("block", EuclideanOps(1), role, {&zero, 1});
  }
  static std::unique_ptr<KernelBatch<DifferenceKernel>> Batch(const char* term, int num_slots) {
    return std::make_unique<KernelBatch<DifferenceKernel>>(
        term, 1, std::vector<int>(num_slots, 1), DifferenceKernel{num_slots});
  }
};

TEST(WorkedExample, HasTheStructureThatTheReadmeStates) {
  const Example example(false, true);
  Structure s;
  s.Build(example.problem);
  EXPECT_THAT(s.node_blocks, ElementsAre(example.pose_A, example.pose_B, example.C));
  EXPECT_THAT(s.node_width, ElementsAre(1, 1, 1));
  EXPECT_EQ(s.num_pose_nodes, 2u);

  ASSERT_EQ(s.parts.size(), 3u);
  EXPECT_EQ(s.parts[0].feature_slot, 0);
  EXPECT_EQ(s.parts[0].residuals.size(), 5u);
  ASSERT_EQ(s.parts[0].num_segments, 2);
  EXPECT_EQ(s.parts[0].segments[0].parts[0].slot, 1);
  EXPECT_EQ(s.parts[0].segments[1].parts[0].slot, 2);
  for (int p : {1, 2}) {
    EXPECT_EQ(s.parts[p].feature_slot, -1);
    EXPECT_EQ(s.parts[p].num_segments, 1);
  }

  EXPECT_THAT(s.features, ElementsAre(example.points[0], example.points[1], example.points[2]));
  EXPECT_THAT(s.feature_clique, ElementsAre(0, 0, 1));
  ASSERT_EQ(s.cliques.size(), 2u);
  EXPECT_THAT(s.cliques.Nodes(0), ElementsAre(0, 1, 2));
  EXPECT_THAT(s.cliques.Nodes(1), ElementsAre(1, 2));

  ASSERT_EQ(s.chunks.size(), 3u);
  const Chunk& chunk = s.chunks[0];
  EXPECT_EQ(chunk.feature_end - chunk.feature_begin, 3u);
  ASSERT_EQ(chunk.parts_end - chunk.parts_begin, 1u);
  EXPECT_EQ(s.chunk_parts[chunk.parts_begin].end, 5u);
  EXPECT_EQ(chunk.num_positions, 8u);
  EXPECT_EQ(chunk.w_size, 8u * 8u);
  EXPECT_FALSE(chunk.plain);
  for (int c : {1, 2}) EXPECT_EQ(s.chunks[c].feature_tangent, 0);
}

TEST(WorkedExample, HasTheReducedSystemAndTheStepThatTheReadmeStates) {
  Example example(false, true);
  NormalEquations equations;
  equations.Begin(example.problem, 1);
  equations.SetForm(SchurForm::kExplicit);
  EXPECT_EQ(equations.num_slices(), 1u);
  EXPECT_EQ(equations.pattern().num_blocks(), 6u);
  EXPECT_TRUE(equations.pattern().full);

  Linearisation linearisation;
  equations.Linearise(std::numeric_limits<double>::infinity(), &linearisation);
  EXPECT_EQ(linearisation.cost.total, 2.0);
  const Eigen::Matrix3d S = equations.matrix().ToDense();
  const Eigen::Matrix3d expected{{2, -1, 0}, {-1, 1, 0}, {0, 0, 1}};
  EXPECT_LT((S - expected).cwiseAbs().maxCoeff(), 1e-14) << S;
  ASSERT_EQ(equations.rhs().size(), 3u);
  EXPECT_NEAR(equations.rhs()[0], 1.0, 1e-14);
  EXPECT_NEAR(equations.rhs()[1], -1.0, 1e-14);
  EXPECT_NEAR(equations.rhs()[2], 0.0, 1e-14);

  const std::vector<double> step{0.0, -1.0, 0.0};
  Trial trial;
  equations.Step(step, &trial);
  const std::vector<double> state{0.0, -1.0, 0.0, -1.5, -0.5, -1.0};
  for (size_t i = 0; i < state.size(); ++i)
    EXPECT_NEAR(equations.trial_state()[i], state[i], 1e-14);
  EXPECT_NEAR(trial.cost.total, 0.5, 1e-14);
  EXPECT_NEAR(trial.model_change, -1.5, 1e-14);
}

// U and T T^T of the implicit form: the matrices of the README before elimination.
TEST(WorkedExample, HasTheUThatTheReadmeStates) {
  Example example(false, true);
  NormalEquations equations;
  equations.Begin(example.problem, 1);
  equations.SetForm(SchurForm::kImplicitWithBorder);
  Linearisation linearisation;
  equations.Linearise(std::numeric_limits<double>::infinity(), &linearisation);
  const Eigen::Matrix3d expected{{3, 0, 2}, {0, 3, 3}, {2, 3, 6}};
  EXPECT_LT((equations.U().ToDense() - expected).cwiseAbs().maxCoeff(), 1e-14);
  // W V^-1 W^T, column by column.
  const Eigen::Matrix3d W{{-1, -1, 0}, {-1, -1, -1}, {-2, -2, -1}};
  const Eigen::Vector3d V(2, 2, 1);
  const Eigen::Matrix3d eliminated = W * V.cwiseInverse().asDiagonal() * W.transpose();
  for (int j = 0; j < 3; ++j) {
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(j);
    Eigen::Vector3d column;
    equations.MultiplyEliminated(unit.data(), column.data());
    EXPECT_LT((column - eliminated.col(j)).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(WorkedExample, MergesIntrinsicsWithTheOnlyPoseThatHasThem) {
  const Example merged(true, false);
  Structure s;
  s.Build(merged.problem);
  EXPECT_THAT(s.node_blocks, ElementsAre(merged.pose_A, merged.C, merged.pose_B, merged.D));
  EXPECT_THAT(s.node_width, ElementsAre(2, 2));
  EXPECT_EQ(s.num_pose_nodes, 2u);
  EXPECT_EQ(s.parts[0].num_segments, 1);
  EXPECT_EQ(s.parts[0].segments[0].num_parts, 2);
  EXPECT_THAT(s.cliques.Nodes(0), ElementsAre(0, 1));
  EXPECT_THAT(s.cliques.Nodes(1), ElementsAre(1));

  const Example apart(true, true);
  s.Build(apart.problem);
  EXPECT_THAT(s.node_blocks, ElementsAre(apart.pose_A, apart.pose_B, apart.C, apart.D));
  EXPECT_EQ(s.num_pose_nodes, 2u);
}

}  // namespace
}  // namespace holba::native
