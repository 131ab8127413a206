// SPDX-License-Identifier: BSD-3-Clause
// Against Eigen's dense Cholesky, over many shapes of matrices.
#include "holba/linear/reduced_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "holba/base/check.h"
#include "holba/linear/linear_testing.h"
#include "holba/simd/targets.h"

namespace holba {
namespace {

struct Shape {
  std::string name;
  BlockPattern pattern;
  Eigen::MatrixXd S = {};  // a positive definite matrix of this pattern
};

std::vector<int> MixedWidths(int n, int seed) {
  Random random(seed);
  std::vector<int> widths(n);
  for (int& w : widths) w = 1 + static_cast<int>(random.Index(BlockPattern::kMaxWidth));
  return widths;
}

std::function<bool(int, int)> RandomlyCoupled(double probability, int seed) {
  auto random = std::make_shared<Random>(seed);
  return [=](int, int) { return random->Uniform() < probability; };
}

std::vector<Shape> MakeShapes() {
  const auto everything = [](int, int) { return true; };
  const auto nothing = [](int, int) { return false; };
  std::vector<Shape> shapes;
  for (const int width : {1, 7, 8, 9, 16, 17, 24}) {
    shapes.push_back({"one node of " + std::to_string(width), MakePattern({width}, everything)});
  }
  shapes.push_back({"diagonal", MakePattern(MixedWidths(30, 1), nothing)});
  shapes.push_back({"arrow to the last",
                    MakePattern(std::vector<int>(60, 6), [](int a, int) { return a == 59; })});
  shapes.push_back({"arrow to the first",
                    MakePattern(std::vector<int>(60, 6), [](int, int b) { return b == 0; })});
  shapes.push_back(
      {"band", MakePattern(std::vector<int>(120, 6), [](int a, int b) { return a - b <= 8; })});
  shapes.push_back({"band of mixed widths",
                    MakePattern(MixedWidths(60, 2), [](int a, int b) { return a - b <= 4; })});
  shapes.push_back({"grid", MakePattern(std::vector<int>(144, 3), [](int a, int b) {
                      return a - b == 12 || (a - b == 1 && a % 12 != 0);
                    })});
  shapes.push_back(
      {"two parts", MakePattern(MixedWidths(40, 3), [](int a, int b) { return a % 2 == b % 2; })});
  shapes.push_back({"sparse", MakePattern(MixedWidths(80, 4), RandomlyCoupled(0.04, 5))});
  shapes.push_back({"half full", MakePattern(MixedWidths(40, 6), RandomlyCoupled(0.5, 7))});
  shapes.push_back({"full", MakePattern(MixedWidths(30, 8), everything)});
  shapes.push_back({"full of sixes", MakePattern(std::vector<int>(70, 6), everything)});
  for (Shape& shape : shapes) {
    Random random(11);
    shape.S = RandomSpd(shape.pattern, &random);
  }
  return shapes;
}

const std::vector<Shape>& Shapes() {
  static const std::vector<Shape> shapes = MakeShapes();
  return shapes;
}

using Make = std::unique_ptr<ReducedSolver> (*)(const BlockPattern&, Precision, int);
constexpr Make kMakers[] = {MakeDenseSolver, MakeSparseSolver};

double RelativeResidual(const Eigen::MatrixXd& S, const Eigen::VectorXd& b,
                        const Eigen::VectorXd& x) {
  const Eigen::VectorXd scale = S.diagonal().cwiseSqrt().cwiseInverse();
  return scale.cwiseProduct(b - S * x).norm() / scale.cwiseProduct(b).norm();
}

TEST(ReducedSolver, AgreesWithEigenOnEveryShape) {
  for (const Shape& shape : Shapes()) {
    Random random(11);
    const Eigen::MatrixXd& S = shape.S;
    const BlockMatrix matrix = FromDense(shape.pattern, S);
    const Eigen::VectorXd b = RandomVector(S.rows(), &random);
    const Eigen::VectorXd expected = S.llt().solve(b);
    for (const Make make : kMakers) {
      for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
        const auto solver = make(shape.pattern, precision, 1);
        for (int again = 0; again < 2; ++again) {
          ASSERT_TRUE(solver->Factorise(matrix)) << shape.name << ", " << solver->Name();
          Eigen::VectorXd x(b.size());
          ASSERT_TRUE(solver->Solve(b.data(), x.data())) << shape.name << ", " << solver->Name();
          EXPECT_LT(RelativeResidual(S, b, x), 2e-11) << shape.name << ", " << solver->Name();
          EXPECT_LT((x - expected).norm(), 1e-8 * expected.norm())
              << shape.name << ", " << solver->Name();
        }
      }
    }
  }
}

TEST(ReducedSolver, EveryInstructionSetAgreesWithEigen) {
  const SimdTarget chosen = CurrentSimdTarget();
  for (const SimdTarget target :
       {SimdTarget::kScalar, SimdTarget::kVec128, SimdTarget::kVec256, SimdTarget::kVec512}) {
    if (!IsSupported(target)) continue;
    SetSimdTarget(target);
    for (const BlockPattern& pattern :
         {MakePattern(MixedWidths(30, 21), [](int, int) { return true; }),
          MakePattern(MixedWidths(60, 22), RandomlyCoupled(0.08, 23))}) {
      Random random(24);
      const Eigen::MatrixXd S = RandomSpd(pattern, &random);
      const BlockMatrix matrix = FromDense(pattern, S);
      const Eigen::VectorXd b = RandomVector(S.rows(), &random);
      for (const Make make : kMakers) {
        for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
          const auto solver = make(pattern, precision, 2);
          Eigen::VectorXd x(b.size());
          ASSERT_TRUE(solver->Factorise(matrix) && solver->Solve(b.data(), x.data()));
          EXPECT_LT(RelativeResidual(S, b, x), 2e-11) << NameOf(target) << ", " << solver->Name();
        }
      }
    }
  }
  SetSimdTarget(chosen);
}

TEST(ReducedSolver, ResultsAreTheSameForEveryNumberOfThreads) {
  std::vector<Shape> shapes = Shapes();
  shapes.push_back({"large", MakePattern(std::vector<int>(230, 6), [](int, int) { return true; })});
  shapes.push_back({"large grid", MakePattern(std::vector<int>(900, 6), [](int a, int b) {
                      return a - b == 30 || a - b == 29 || (a - b == 1 && a % 30 != 0);
                    })});
  for (const Shape& shape : shapes) {
    Random random(31);
    // Diagonally dominant: quick to make at every size.
    BlockMatrix matrix(&shape.pattern);
    for (int a = 0; a < shape.pattern.num_nodes(); ++a) {
      for (size_t k = shape.pattern.row_start[a]; k < shape.pattern.row_start[a + 1]; ++k) {
        const int w = shape.pattern.widths[a], stride = PaddedWidth(w);
        const bool diagonal = shape.pattern.column[k] == a;
        for (int j = 0; j < shape.pattern.widths[shape.pattern.column[k]]; ++j) {
          for (int i = diagonal ? j : 0; i < w; ++i) {
            double value = random.Uniform(-1.0, 1.0);
            if (diagonal && i == j) value = 0.6 * shape.pattern.num_unknowns;
            matrix.Block(k)[j * stride + i] = value;
            if (diagonal) matrix.Block(k)[i * stride + j] = value;
          }
        }
      }
    }
    const Eigen::VectorXd b = RandomVector(shape.pattern.num_unknowns, &random);
    for (const Make make : kMakers) {
      if (make == MakeDenseSolver && b.size() > 2000) continue;
      for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
        Eigen::VectorXd first(b.size());
        BlockMatrix first_inverse(&shape.pattern);
        for (const int num_threads : {1, 2, 3, 5}) {
          const auto solver = make(shape.pattern, precision, num_threads);
          for (int again = 0; again < 3; ++again) {
            Eigen::VectorXd x(b.size());
            ASSERT_TRUE(solver->Factorise(matrix) && solver->Solve(b.data(), x.data()));
            if (num_threads == 1 && again == 0) first = x;
            EXPECT_EQ(x, first) << shape.name << ", " << solver->Name() << ", " << num_threads;
          }
          if (precision != Precision::kDouble || b.size() > 2000) continue;
          BlockMatrix inverse(&shape.pattern);
          ASSERT_TRUE(solver->SelectedInverse(&inverse));
          if (num_threads == 1) {
            first_inverse = std::move(inverse);
          } else {
            EXPECT_EQ(inverse.ToDense(), first_inverse.ToDense()) << shape.name;
          }
        }
      }
    }
  }
}

TEST(ReducedSolver, WhatIsNotPositiveDefiniteIsRefusedAndTheNextMatrixIsTaken) {
  for (const Shape& shape : Shapes()) {
    Random random(41);
    const Eigen::MatrixXd& good = shape.S;
    Eigen::MatrixXd bad = good;
    const Eigen::Index at = random.Index(good.rows());
    // One eigenvalue below zero: the Schur complement of this entry, and a little more, is taken
    // off.
    bad(at, at) -= 1.001 / good.llt().solve(Eigen::VectorXd::Unit(good.rows(), at))[at];
    Eigen::MatrixXd not_finite = good;
    not_finite(at, at) = std::numeric_limits<double>::quiet_NaN();
    Eigen::MatrixXd infinite = good;
    infinite(at, at) = std::numeric_limits<double>::infinity();
    const BlockMatrix good_matrix = FromDense(shape.pattern, good);
    const Eigen::VectorXd b = RandomVector(good.rows(), &random);
    for (const Make make : kMakers) {
      for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
        for (const int num_threads : {1, 2}) {
          const auto solver = make(shape.pattern, precision, num_threads);
          for (const Eigen::MatrixXd& matrix : {bad, not_finite, infinite}) {
            EXPECT_FALSE(solver->Factorise(FromDense(shape.pattern, matrix)))
                << shape.name << ", " << solver->Name();
            ASSERT_TRUE(solver->Factorise(good_matrix)) << shape.name << ", " << solver->Name();
            Eigen::VectorXd x(b.size());
            ASSERT_TRUE(solver->Solve(b.data(), x.data()));
            EXPECT_LT(RelativeResidual(good, b, x), 2e-11) << shape.name << ", " << solver->Name();
          }
        }
      }
    }
  }
}

TEST(ReducedSolver, TheSelectedInverseHoldsTheBlocksOfTheInverse) {
  for (const Shape& shape : Shapes()) {
    const Eigen::MatrixXd& S = shape.S;
    const Eigen::MatrixXd inverse = S.llt().solve(Eigen::MatrixXd::Identity(S.rows(), S.cols()));
    const BlockMatrix matrix = FromDense(shape.pattern, S);
    for (const Make make : kMakers) {
      for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
        for (const int num_threads : {1, 3}) {
          const auto solver = make(shape.pattern, precision, num_threads);
          ASSERT_TRUE(solver->Factorise(matrix));
          BlockMatrix Z(&shape.pattern);
          ASSERT_TRUE(solver->SelectedInverse(&Z));
          const Eigen::MatrixXd expected = FromDense(shape.pattern, inverse).ToDense();
          EXPECT_LT((Z.ToDense() - expected).cwiseAbs().maxCoeff(),
                    1e-9 * expected.cwiseAbs().maxCoeff())
              << shape.name << ", " << solver->Name();
        }
      }
    }
  }
}

TEST(ReducedSolver, MixedPrecisionIsAsGoodWhereFloatAloneHasNoDigitLeft) {
  for (const double smallest : {1e-3, 1e-5, 1e-7, 1e-9}) {
    const BlockPattern pattern =
        MakePattern(std::vector<int>(40, 6), [](int, int) { return true; });
    Random random(61);
    const Eigen::MatrixXd raw = RandomSpd(pattern, &random);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(raw);
    Eigen::VectorXd values(raw.rows());
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      values[i] = std::pow(smallest, static_cast<double>(i) / (values.size() - 1));
    }
    const Eigen::MatrixXd q = eigen.eigenvectors();
    Eigen::MatrixXd S = q * values.asDiagonal() * q.transpose();
    // Unknowns of very different units.
    Eigen::VectorXd units(S.rows());
    for (double& unit : units) unit = std::pow(10.0, random.Uniform(-25.0, 25.0));
    S = units.asDiagonal() * S * units.asDiagonal();
    S = 0.5 * (S + S.transpose()).eval();
    const BlockMatrix matrix = FromDense(pattern, S);
    const Eigen::VectorXd b = units.cwiseProduct(RandomVector(S.rows(), &random));
    for (const Make make : kMakers) {
      const auto solver = make(pattern, Precision::kMixed, 1);
      ASSERT_TRUE(solver->Factorise(matrix)) << smallest;
      Eigen::VectorXd x(b.size());
      ASSERT_TRUE(solver->Solve(b.data(), x.data())) << smallest;
      EXPECT_LT(RelativeResidual(S, b, x), 1e-11 + 1e-15 / smallest) << smallest;
    }
  }
}

TEST(ReducedSolver, ARightSideOfZeroHasTheSolutionZero) {
  const BlockPattern pattern = MakePattern({6, 6, 3}, [](int, int) { return true; });
  Random random(71);
  const BlockMatrix matrix = FromDense(pattern, RandomSpd(pattern, &random));
  for (const Make make : kMakers) {
    for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
      const auto solver = make(pattern, precision, 1);
      ASSERT_TRUE(solver->Factorise(matrix));
      Eigen::VectorXd x = Eigen::VectorXd::Zero(15);
      ASSERT_TRUE(solver->Solve(x.data(), x.data()));
      EXPECT_EQ(x.norm(), 0.0);
    }
  }
}

TEST(ReducedSolver, AnEmptySystemIsSolved) {
  const BlockPattern pattern = MakePattern({}, [](int, int) { return true; });
  const BlockMatrix matrix(&pattern);
  for (const Make make : kMakers) {
    for (const Precision precision : {Precision::kDouble, Precision::kMixed}) {
      const auto solver = make(pattern, precision, 2);
      double nothing = 0.0;
      EXPECT_TRUE(solver->Factorise(matrix) && solver->Solve(&nothing, &nothing));
    }
  }
}

TEST(ReducedSolver, SolveWithoutAFactorIsAFault) {
  const BlockPattern pattern = MakePattern({2}, [](int, int) { return true; });
  double x[2] = {};
  for (const Make make : kMakers) {
    EXPECT_THROW(make(pattern, Precision::kDouble, 1)->Solve(x, x), CheckError);
  }
}

}  // namespace
}  // namespace holba
