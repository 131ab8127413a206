// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_floor.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <vector>

namespace holba {
namespace {

struct NoKernel {
  struct Datum {};
  bool Evaluate(const Datum&, const double* const*, double*, double* const*) const { return false; }
};

// Poses in a row and points, each seen by the poses listed.
Problem PosesAndPoints(int num_poses, const std::vector<std::vector<int>>& tracks) {
  Problem problem;
  const double pose[7] = {0, 0, 0, 1, 0, 0, 0}, point[3] = {0, 0, 1};
  std::vector<BlockId> poses;
  for (int i = 0; i < num_poses; ++i) {
    poses.push_back(problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, pose));
  }
  auto batch =
      std::make_unique<KernelBatch<NoKernel>>("point", 2, std::vector<int>{3, 6}, NoKernel{});
  for (const auto& track : tracks) {
    const BlockId id = problem.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature, point);
    for (const int i : track) batch->Add(std::array{id, poses[i]}, {});
  }
  problem.AddBatch(std::move(batch));
  return problem;
}

// Of one observation, f = 3, w = 6, d = 2: 24 + 12 + 24 + 84 + 18 + 72 + 36.
constexpr double kEliminateObservation = 270.0;

TEST(CountIterationFlops, IsTheCountByHandForOnePointInTwoImages) {
  const IterationFlops flops = CountIterationFlops(PosesAndPoints(2, {{0, 1}}));
  EXPECT_EQ(flops.linearise, 300.0);
  // Reduced system of 12 unknowns: 3 * 12 * 13 for both diagonal blocks (3 * 6 * 7 each) and the
  // pair (2 * 6 * 6 * 3).
  EXPECT_EQ(flops.eliminate, 2 * kEliminateObservation + 2 * 126 + 216);
  EXPECT_EQ(flops.back_substitute, 2 * (36 + 9));
  EXPECT_EQ(flops.dense_factor, 12.0 * 12 * 12 / 3);
}

TEST(CountIterationFlops, HoldsConstantBlocksAndCoordinates) {
  Problem problem = PosesAndPoints(2, {{0, 1}});
  problem.block(0).constant = true;  // a pose
  problem.block(1).held = 1;         // 5 unknowns are left of the other
  const IterationFlops flops = CountIterationFlops(problem);
  EXPECT_EQ(flops.linearise, 300.0);
  EXPECT_EQ(flops.eliminate, 2 * (24 + 12 + 18) + 20 + 60 + 60 + 30 + 3 * 5 * 6);
  EXPECT_EQ(flops.back_substitute, 30 + 2 * 9);
  EXPECT_EQ(flops.Factor(), 5.0 * 5 * 5 / 3);
}

TEST(CountIterationFlops, OfAFullSystemHasTheSameFactorSparseOrDense) {
  const IterationFlops flops = CountIterationFlops(PosesAndPoints(5, {{0, 1, 2, 3, 4}}));
  // Of the sparse one also the lower order terms are counted.
  EXPECT_NEAR(flops.sparse_factor, flops.dense_factor, 0.1 * flops.dense_factor);
  EXPECT_GE(flops.sparse_factor, flops.dense_factor);
}

TEST(CountIterationFlops, OfAChainHasNoFill) {
  constexpr int kPoses = 50;
  std::vector<std::vector<int>> tracks;
  for (int i = 0; i + 1 < kPoses; ++i) tracks.push_back({i, i + 1});
  // Every node but the last has one row block below: 72 + 216 + 252.
  EXPECT_EQ(CountIterationFlops(PosesAndPoints(kPoses, tracks)).sparse_factor,
            (kPoses - 1) * (72.0 + 216.0 + 6 * 6 * 7) + 72.0);
}

TEST(CountIterationFlops, OfAStarDoesNotDependOnWhichNodeIsItsCentre) {
  double first = 0.0;
  for (const int centre : {0, 7, 19}) {
    std::vector<std::vector<int>> tracks;
    for (int i = 0; i < 20; ++i) {
      if (i != centre) tracks.push_back({centre, i});
    }
    const double flops = CountIterationFlops(PosesAndPoints(20, tracks)).sparse_factor;
    if (first == 0.0) first = flops;
    EXPECT_EQ(flops, first);
    EXPECT_EQ(flops, 19 * (72.0 + 216.0 + 252.0) + 72.0);  // the centre goes last
  }
}

TEST(MeasurePeakGflops, IsThatOfAComputer) {
  EXPECT_GT(MeasurePeakGflops(1), 0.1);
  EXPECT_LT(MeasurePeakGflops(1), 1e4);
}

}  // namespace
}  // namespace holba
