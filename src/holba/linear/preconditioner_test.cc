// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/preconditioner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "holba/linear/linear_testing.h"

namespace holba {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

double SmallestEigenvalue(const MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(0.5 * (matrix + matrix.transpose()))
      .eigenvalues()[0];
}

int Iterations(LinearOperator* A, Preconditioner* preconditioner, const VectorXd& b,
               double residual_tolerance) {
  ConjugateGradients solver;
  VectorXd x(b.size());
  const ConjugateGradientsOptions options{
      .max_iterations = 5000, .eta = 0.0, .residual_tolerance = residual_tolerance};
  const ConjugateGradientsResult result =
      solver.Solve(A, preconditioner, b.size(), b.data(), options, x.data());
  EXPECT_EQ(result.end, ConjugateGradientsEnd::kConverged);
  return result.iterations;
}

// Entries of pairs of different nodes set to 0 where `keep` does not hold.
template <typename Keep>
MatrixXd Masked(const BlockPattern& pattern, MatrixXd matrix, const Keep& keep) {
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    for (int b = 0; b < pattern.num_nodes(); ++b) {
      if (a == b || keep(a, b)) continue;
      matrix.block(pattern.offset[a], pattern.offset[b], pattern.widths[a], pattern.widths[b])
          .setZero();
    }
  }
  return matrix;
}

TEST(BlockJacobi, InvertsTheDiagonalBlocks) {
  Random random(1);
  std::vector<int> widths;
  for (int width = 1; width <= BlockPattern::kMaxWidth; ++width) widths.push_back(width);
  const BlockPattern pattern =
      MakePattern(widths, [&](int, int) { return random.Uniform() < 0.3; });
  MatrixXd dense = RandomSpd(pattern, &random);
  // Unknowns of very different size do not matter.
  for (Eigen::Index i = 0; i < dense.rows(); ++i) {
    const double scale = std::pow(10.0, random.Uniform(-6.0, 6.0));
    dense.row(i) *= scale;
    dense.col(i) *= scale;
  }
  BlockJacobiPreconditioner jacobi(pattern);
  jacobi.Set(FromDense(pattern, dense));
  EXPECT_EQ(jacobi.num_repaired(), 0);
  const MatrixXd product = MatrixOf(&jacobi, pattern.num_unknowns) *
                           Masked(pattern, dense, [](int, int) { return false; });
  const VectorXd scale = dense.diagonal().cwiseSqrt();
  const MatrixXd scaled = scale.asDiagonal() * product * scale.cwiseInverse().asDiagonal();
  EXPECT_LT((scaled - MatrixXd::Identity(scaled.rows(), scaled.cols())).cwiseAbs().maxCoeff(),
            1e-9);
}

TEST(BlockJacobi, IsPositiveDefiniteWhateverTheBlocksAre) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  Random random(2);
  const BlockPattern pattern = MakePattern({3, 3, 3, 3, 3, 3, 3}, [](int, int) { return false; });
  MatrixXd dense = MatrixXd::Zero(21, 21);
  for (int node = 0; node < 7; ++node) {
    const MatrixXd rows = Eigen::Matrix3d::NullaryExpr([&] { return random.Normal(); });
    dense.block<3, 3>(3 * node, 3 * node) = rows.transpose() * rows;
  }
  dense.block<3, 3>(3, 3) -= 0.5 * Eigen::Matrix3d(dense.block<3, 3>(3, 3).diagonal().asDiagonal());
  dense.block<3, 3>(6, 6).setConstant(2.0);  // singular
  dense(10, 10) = -4.0;
  dense.row(13).setZero();
  dense.col(13).setZero();
  dense(16, 15) = dense(15, 16) = nan;
  dense(18, 18) = infinity;
  BlockJacobiPreconditioner jacobi(pattern);
  jacobi.Set(FromDense(pattern, dense));
  EXPECT_EQ(jacobi.num_repaired(), 6);
  const MatrixXd inverse = MatrixOf(&jacobi, pattern.num_unknowns);
  ASSERT_TRUE(inverse.allFinite());
  EXPECT_GT(SmallestEigenvalue(inverse), 0.0);
  EXPECT_LT((inverse.topLeftCorner(3, 3) * dense.topLeftCorner(3, 3) - Eigen::Matrix3d::Identity())
                .norm(),
            1e-9);
  EXPECT_DOUBLE_EQ(inverse(10, 10), 0.25);
  EXPECT_DOUBLE_EQ(inverse(13, 13), 1.0);
}

// Leaves of width 6 and core nodes of several widths behind them; blocks of two leaves too if
// `all`.
BlockPattern ArrowPattern(int num_leaves, const std::vector<int>& core_widths, double density,
                          bool all, Random* random) {
  std::vector<int> widths(num_leaves, 6);
  widths.insert(widths.end(), core_widths.begin(), core_widths.end());
  return MakePattern(widths, [&](int a, int b) {
    if (a < num_leaves) return all && random->Uniform() < density;
    return random->Uniform() < density;
  });
}

TEST(Border, SolvesAnArrowMatrixExactly) {
  Random random(3);
  for (const double density : {0.05, 0.4, 1.0}) {
    const BlockPattern pattern =
        ArrowPattern(40, {3, 8, 4, 4, 10, 24, 1, 4, 4, 4}, density, false, &random);
    const MatrixXd dense = RandomSpd(pattern, &random);
    const BlockMatrix matrix = FromDense(pattern, dense);
    BorderPreconditioner border(pattern, 40);
    border.Set(matrix);
    EXPECT_EQ(border.num_core_nodes(), 10);
    EXPECT_EQ(border.coupling(), 1.0);
    EXPECT_FALSE(border.is_block_jacobi());
    const VectorXd r = RandomVector(pattern.num_unknowns, &random);
    VectorXd z(r.size());
    border.Apply(r.data(), z.data());
    const VectorXd expected = dense.llt().solve(r);
    EXPECT_LT((z - expected).norm(), 1e-9 * expected.norm());
    BlockMatrixOperator A(&matrix);
    EXPECT_LE(Iterations(&A, &border, r, 1e-9), 2);
  }
}

TEST(Border, LeavesBlocksOfTwoLeavesOut) {
  Random random(4);
  const BlockPattern pattern = ArrowPattern(20, {3, 4, 4, 4}, 0.5, true, &random);
  const MatrixXd dense = RandomSpd(pattern, &random);
  BorderPreconditioner border(pattern, 20);
  border.Set(FromDense(pattern, dense));
  ASSERT_EQ(border.coupling(), 1.0);
  const MatrixXd arrow = Masked(pattern, dense, [](int a, int b) { return a >= 20 || b >= 20; });
  const MatrixXd product = MatrixOf(&border, pattern.num_unknowns) * arrow;
  EXPECT_LT((product - MatrixXd::Identity(arrow.rows(), arrow.cols())).norm(), 1e-8);
}

TEST(Border, PutsTheBestCoupledNodesInASmallCore) {
  Random random(5);
  // Node 12 and 14 are coupled with everything, the other border nodes with few: before, between
  // and behind them, so that both orders of a leaf and a core node occur.
  std::vector<int> widths(10, 6);
  for (const int width : {4, 5, 3, 7, 9, 2, 4}) widths.push_back(width);
  const BlockPattern pattern = MakePattern(widths, [&](int a, int b) {
    return a == 12 || a == 14 || b == 12 || b == 14 || (a >= 10 && random.Uniform() < 0.4);
  });
  const MatrixXd dense = RandomSpd(pattern, &random);
  BorderPreconditioner border(pattern, 10, {.max_core_unknowns = 12});
  border.Set(FromDense(pattern, dense));
  EXPECT_EQ(border.num_core_nodes(), 2);
  EXPECT_EQ(border.num_core_unknowns(), 12u);
  ASSERT_EQ(border.coupling(), 1.0);
  const MatrixXd arrow =
      Masked(pattern, dense, [](int a, int b) { return a == 12 || a == 14 || b == 12 || b == 14; });
  const MatrixXd product = MatrixOf(&border, pattern.num_unknowns) * arrow;
  EXPECT_LT((product - MatrixXd::Identity(arrow.rows(), arrow.cols())).norm(), 1e-8);
}

TEST(Border, WithoutABorderOrACoreIsBlockJacobi) {
  Random random(6);
  const BlockPattern pattern = ArrowPattern(7, {4, 4}, 0.8, true, &random);
  const BlockMatrix matrix = FromDense(pattern, RandomSpd(pattern, &random));
  BlockJacobiPreconditioner jacobi(pattern);
  jacobi.Set(matrix);
  BorderPreconditioner no_border(pattern, 9), no_core(pattern, 7, {.max_core_unknowns = 3}),
      no_work(pattern, 7, {.max_schur_flops = 10.0});
  for (BorderPreconditioner* border : {&no_border, &no_core, &no_work}) {
    border->Set(matrix);
    EXPECT_TRUE(border->is_block_jacobi());
    EXPECT_EQ(MatrixOf(border, pattern.num_unknowns), MatrixOf(&jacobi, pattern.num_unknowns));
  }
}

TEST(Border, StaysPositiveDefiniteWhereTheArrowIsNot) {
  Random random(7);
  const BlockPattern pattern = ArrowPattern(15, {3, 4, 4}, 1.0, false, &random);
  const MatrixXd spd = RandomSpd(pattern, &random);
  const auto scaled_coupling = [&](double factor) {
    MatrixXd dense = spd;
    dense.topRightCorner(90, 11) *= factor;
    dense.bottomLeftCorner(11, 90) *= factor;
    return dense;
  };
  double last_coupling = 1.0;
  // The larger the coupling, the less of it can stay.
  for (const double factor : {1.0, 1.03, 1.3, 10.0}) {
    const MatrixXd dense = scaled_coupling(factor);
    BorderPreconditioner border(pattern, 15);
    border.Set(FromDense(pattern, dense));
    const MatrixXd inverse = MatrixOf(&border, pattern.num_unknowns);
    ASSERT_TRUE(inverse.allFinite());
    EXPECT_GT(SmallestEigenvalue(inverse), 0.0);
    EXPECT_FALSE(border.is_block_jacobi());
    EXPECT_LE(border.coupling(), last_coupling);
    // What it solves is what it says: E times the coupling.
    MatrixXd solved = dense;
    solved.topRightCorner(90, 11) *= border.coupling();
    solved.bottomLeftCorner(11, 90) *= border.coupling();
    EXPECT_LT((inverse * solved - MatrixXd::Identity(101, 101)).norm(), 1e-7);
    last_coupling = border.coupling();
  }
  EXPECT_EQ(last_coupling, 0.0);
}

TEST(Border, FallsBackToBlockJacobiWhereTheCoreIsIndefinite) {
  Random random(8);
  const BlockPattern pattern = ArrowPattern(5, {4, 4}, 1.0, false, &random);
  MatrixXd dense = RandomSpd(pattern, &random);
  dense.block<4, 4>(34, 30).setConstant(1e3);
  dense.block<4, 4>(30, 34).setConstant(1e3);
  BorderPreconditioner border(pattern, 5);
  border.Set(FromDense(pattern, dense));
  EXPECT_TRUE(border.is_block_jacobi());
  EXPECT_GT(SmallestEigenvalue(MatrixOf(&border, pattern.num_unknowns)), 0.0);

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const auto& [i, j] : {std::pair(31, 2), {33, 33}, {36, 31}, {4, 3}}) {
      MatrixXd spoilt = RandomSpd(pattern, &random);
      spoilt(i, j) = spoilt(j, i) = bad;
      border.Set(FromDense(pattern, spoilt));
      const MatrixXd inverse = MatrixOf(&border, pattern.num_unknowns);
      ASSERT_TRUE(inverse.allFinite()) << "entry " << i << " " << j;
      EXPECT_GT(SmallestEigenvalue(inverse), 0.0);
    }
  }
  // And recovers with the next good matrix.
  border.Set(FromDense(pattern, RandomSpd(pattern, &random)));
  EXPECT_EQ(border.coupling(), 1.0);
}

TEST(Preconditioners, AreTheSameBitForBitForEveryNumberOfThreads) {
  Random random(9);
  // The first core node is coupled with all leaves: more than one chunk of arms.
  const int num_leaves = 700;
  std::vector<int> widths(num_leaves, 6);
  widths.insert(widths.end(), {3, 4, 4, 4, 4});
  const BlockPattern pattern = MakePattern(widths, [&](int a, int) {
    return a == num_leaves || (a > num_leaves && random.Uniform() < 0.3);
  });
  // Diagonally dominant: RandomSpd would take long here.
  BlockMatrix matrix(&pattern);
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    const int padded = PaddedWidth(widths[a]);
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      const bool diagonal = pattern.column[k] == a;
      for (int j = 0; j < widths[pattern.column[k]]; ++j) {
        for (int i = 0; i < widths[a]; ++i) {
          matrix.Block(k)[j * padded + i] =
              diagonal ? (i == j ? (a < num_leaves ? 40.0 : 7000.0) : 0.3) : random.Normal();
        }
      }
    }
  }
  const VectorXd r = RandomVector(pattern.num_unknowns, &random);
  VectorXd jacobi_1, border_1;
  for (const int num_threads : {1, 2, 3}) {
    VectorXd z(r.size());
    BlockJacobiPreconditioner jacobi(pattern, num_threads);
    jacobi.Set(matrix);
    jacobi.Apply(r.data(), z.data());
    if (num_threads == 1) jacobi_1 = z;
    EXPECT_EQ(z, jacobi_1);
    BorderPreconditioner border(pattern, num_leaves, {}, num_threads);
    border.Set(matrix);
    EXPECT_EQ(border.coupling(), 1.0);
    border.Apply(r.data(), z.data());
    if (num_threads == 1) border_1 = z;
    EXPECT_EQ(z, border_1);
    EXPECT_NE(z, jacobi_1);
    BlockMatrixOperator A(&matrix);
    EXPECT_LE(Iterations(&A, &border, r, 1e-9), 2);
  }
}

// U as an arrow (before elimination nothing couples two poses) and all of S.
struct BundleSystem {
  BlockPattern arrow, full;
  BlockMatrix U, S;
  MatrixXd dense_S;
  DenseOperator E;
  VectorXd b;
  int camera;
};

std::unique_ptr<BundleSystem> MakeBundleSystem(int num_poses, int num_planes, uint64_t seed) {
  SmallBundle bundle = MakeSmallBundle(num_poses, num_planes, 12 * num_poses, 3, 6, 1e-4, seed);
  auto system = std::make_unique<BundleSystem>(BundleSystem{.dense_S = bundle.U - bundle.E,
                                                            .E = DenseOperator(bundle.E),
                                                            .b = bundle.b,
                                                            .camera = num_poses});
  system->arrow = MakePattern(bundle.widths, [&](int a, int) { return a >= num_poses; });
  system->full = MakePattern(bundle.widths, [](int, int) { return true; });
  system->U = FromDense(system->arrow, bundle.U);
  system->S = FromDense(system->full, system->dense_S);
  return system;
}

TEST(PowerSeries, ConvergesToTheInverse) {
  const auto system = MakeBundleSystem(8, 2, 10);
  const size_t size = system->full.num_unknowns;
  BorderPreconditioner u_inverse(system->arrow, system->camera);
  u_inverse.Set(system->U);
  const MatrixXd U_inverse = MatrixOf(&u_inverse, size);
  // Positive definite at every order, and closer to the inverse at each.
  const MatrixXd half = system->dense_S.llt().matrixL();
  double last_distance = std::numeric_limits<double>::infinity();
  for (const int order : {0, 1, 2, 5, 50}) {
    PowerSeriesPreconditioner series(&u_inverse, &system->E, size, order);
    const MatrixXd inverse = MatrixOf(&series, size);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(half.transpose() * inverse * half);
    EXPECT_GT(eigen.eigenvalues()[0], 0.0);
    EXPECT_LT(eigen.eigenvalues()[size - 1], 1.0 + 1e-9);
    const double distance = 1.0 - eigen.eigenvalues()[0];
    EXPECT_LT(distance, last_distance);
    if (order == 0) {
      EXPECT_LT((inverse - U_inverse).norm(), 1e-12 * U_inverse.norm());
    }
    last_distance = distance;
  }
  // A system whose series converges fast.
  Random random(11);
  const BlockPattern pattern = ArrowPattern(10, {4}, 1.0, false, &random);
  const MatrixXd U = RandomSpd(pattern, &random);
  const MatrixXd L = U.llt().matrixL();
  const MatrixXd rows = MatrixXd::NullaryExpr(5, 64, [&] { return random.Normal(); });
  MatrixXd E = rows.transpose() * rows;
  E *= 0.5 / Eigen::SelfAdjointEigenSolver<MatrixXd>(L.triangularView<Eigen::Lower>().solve(E) *
                                                     L.transpose().inverse())
                 .eigenvalues()[63];
  DenseOperator E_operator(E);
  BorderPreconditioner border(pattern, 10);
  border.Set(FromDense(pattern, U));
  const VectorXd r = RandomVector(64, &random);
  const VectorXd expected = (U - E).llt().solve(r);
  VectorXd z(64);
  PowerSeriesPreconditioner(&border, &E_operator, 64, 60).Apply(r.data(), z.data());
  EXPECT_LT((z - expected).norm(), 1e-9 * expected.norm());
}

TEST(Preconditioners, OfABundleRankAsTheyShould) {
  const auto system = MakeBundleSystem(60, 5, 12);
  const size_t size = system->full.num_unknowns;
  BlockMatrixOperator S(&system->S);
  BlockJacobiPreconditioner jacobi(system->full), u_jacobi(system->arrow);
  jacobi.Set(system->S);
  u_jacobi.Set(system->U);
  BorderPreconditioner border(system->full, system->camera),
      u_border(system->arrow, system->camera);
  border.Set(system->S);
  u_border.Set(system->U);
  EXPECT_EQ(border.coupling(), 1.0);
  EXPECT_EQ(u_border.coupling(), 1.0);

  const double tolerance = 1e-6;
  const int with_jacobi = Iterations(&S, &jacobi, system->b, tolerance);
  const int with_border = Iterations(&S, &border, system->b, tolerance);
  const int with_u_border = Iterations(&S, &u_border, system->b, tolerance);
  RecordProperty("jacobi", with_jacobi);
  RecordProperty("border", with_border);
  RecordProperty("u_border", with_u_border);
  EXPECT_LE(with_border, with_jacobi);
  int last = with_u_border;
  for (const int order : {1, 2, 3, 5}) {
    PowerSeriesPreconditioner series(&u_border, &system->E, size, order);
    const int with_series = Iterations(&S, &series, system->b, tolerance);
    EXPECT_LE(with_series, last) << "order " << order;
    // Conjugate gradients choose the best polynomial there is: a series cannot save products.
    EXPECT_GE(with_series * (order + 1), with_u_border - order);
    last = with_series;
  }
  EXPECT_LT(last, with_u_border);
}

}  // namespace
}  // namespace holba
