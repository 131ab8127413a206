// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/block_matrix.h"

#include <gtest/gtest.h>

#include "holba/base/check.h"
#include "holba/linear/linear_testing.h"
#include "holba/simd/targets.h"

namespace holba {
namespace {

std::vector<SimdTarget> Targets() {
  std::vector<SimdTarget> targets;
  for (const SimdTarget target :
       {SimdTarget::kScalar, SimdTarget::kVec128, SimdTarget::kVec256, SimdTarget::kVec512}) {
    if (IsSupported(target)) targets.push_back(target);
  }
  return targets;
}

std::vector<int> AllWidths() {
  std::vector<int> widths;
  for (int w = 1; w <= BlockPattern::kMaxWidth; ++w) widths.push_back(w);
  return widths;
}

TEST(BlockPattern, KnowsWhetherItIsFullAndFindsItsBlocks) {
  const BlockPattern full = MakePattern({6, 3, 6}, [](int, int) { return true; });
  EXPECT_TRUE(full.full);
  EXPECT_EQ(full.num_unknowns, 15u);
  EXPECT_EQ(full.Find(2, 1), 4u);
  const BlockPattern arrow = MakePattern({6, 3, 6}, [](int a, int b) { return a == 2 && b == 0; });
  EXPECT_FALSE(arrow.full);
  EXPECT_EQ(arrow.Find(2, 0), 2u);
  EXPECT_EQ(arrow.Find(2, 1), arrow.num_blocks());
  EXPECT_EQ(arrow.Find(2, 2), 3u);
}

TEST(BlockPattern, ARowThatDoesNotEndOnTheDiagonalIsAFault) {
  BlockPattern pattern;
  pattern.widths = {2, 2};
  pattern.row_start = {0, 1, 2};
  pattern.column = {0, 0};
  EXPECT_THROW(pattern.Finish(), CheckError);
}

TEST(BlockMatrix, BlocksAreAlignedAndKeepTheirOrder) {
  const BlockPattern pattern = MakePattern(AllWidths(), [](int a, int b) { return (a + b) % 3; });
  BlockMatrix matrix(&pattern);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(matrix.values.data()) % 64, 0u);
  for (const size_t offset : matrix.block_offset) EXPECT_EQ(offset % 8, 0u);
  matrix.Block(1)[0] = 5.0;
  matrix.SetZero();
  EXPECT_EQ(matrix.Block(1)[0], 0.0);
}

TEST(BlockMatrix, TheProductAgreesWithTheDenseMatrixForEveryInstructionSet) {
  Random random(1);
  const BlockPattern pattern =
      MakePattern(AllWidths(), [](int a, int b) { return (a * 7 + b * 3) % 4 != 0; });
  const Eigen::MatrixXd dense = FromDense(pattern, RandomSpd(pattern, &random)).ToDense();
  const BlockMatrix matrix = FromDense(pattern, dense);
  const Eigen::VectorXd x = RandomVector(pattern.num_unknowns, &random);
  const SimdTarget chosen = CurrentSimdTarget();
  for (const SimdTarget target : Targets()) {
    SetSimdTarget(target);
    Eigen::VectorXd y(x.size());
    std::vector<double> scratch;
    matrix.Multiply(x.data(), y.data(), 1, &scratch);
    EXPECT_LT((y - dense * x).norm(), 1e-13 * dense.norm() * x.norm()) << NameOf(target);
  }
  SetSimdTarget(chosen);
}

TEST(BlockMatrix, TheProductIsTheSameForEveryNumberOfThreads) {
  Random random(2);
  const BlockPattern pattern = MakePattern(std::vector<int>(120, 6), [](int, int) { return true; });
  BlockMatrix matrix(&pattern);
  for (size_t i = 0; i < matrix.values.size(); ++i) matrix.values.data()[i] = random.Normal();
  const Eigen::VectorXd x = RandomVector(pattern.num_unknowns, &random);
  std::vector<double> scratch;
  Eigen::VectorXd one(x.size());
  matrix.Multiply(x.data(), one.data(), 1, &scratch);
  for (const int num_threads : {2, 3, 7}) {
    Eigen::VectorXd y(x.size());
    matrix.Multiply(x.data(), y.data(), num_threads, &scratch);
    EXPECT_EQ(y, one) << num_threads;
  }
}

}  // namespace
}  // namespace holba
