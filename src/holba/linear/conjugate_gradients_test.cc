// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/conjugate_gradients.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "holba/linear/linear_testing.h"

namespace holba {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using End = ConjugateGradientsEnd;

struct System {
  BlockPattern pattern;
  MatrixXd A;
  VectorXd b;
};

System RandomSystem(uint64_t seed) {
  Random random(seed);
  System system;
  std::vector<int> widths(12);
  for (int& width : widths) width = 1 + static_cast<int>(random.Index(11));
  system.pattern = MakePattern(widths, [&](int, int) { return random.Uniform() < 0.4; });
  system.A = RandomSpd(system.pattern, &random);
  system.b = RandomVector(system.pattern.num_unknowns, &random);
  return system;
}

class InversePreconditioner : public Preconditioner {
 public:
  explicit InversePreconditioner(const MatrixXd& A) : llt_(A) {}
  void Apply(const double* r, double* z) override {
    const Eigen::Index n = llt_.rows();
    Eigen::Map<VectorXd>(z, n) = llt_.solve(Eigen::Map<const VectorXd>(r, n));
  }

 private:
  Eigen::LLT<MatrixXd> llt_;
};

class ScalingPreconditioner : public Preconditioner {
 public:
  ScalingPreconditioner(size_t size, double scale) : size_(size), scale_(scale) {}
  void Apply(const double* r, double* z) override {
    for (size_t i = 0; i < size_; ++i) z[i] = scale_ * r[i];
  }

 private:
  size_t size_;
  double scale_;
};

ConjugateGradientsOptions ByResidual(double tolerance, int max_iterations = 2000) {
  return {.max_iterations = max_iterations, .eta = 0.0, .residual_tolerance = tolerance};
}

ConjugateGradientsResult Solve(ConjugateGradients* solver, LinearOperator* A,
                               Preconditioner* preconditioner, const VectorXd& b,
                               const ConjugateGradientsOptions& options, VectorXd* x) {
  return solver->Solve(A, preconditioner, b.size(), b.data(), options, x->data());
}

double Model(const System& system, const VectorXd& x) {
  return 0.5 * x.dot(system.A * x) - system.b.dot(x);
}

TEST(ConjugateGradients, AgreesWithCholeskyOnRandomBlockMatrices) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const System system = RandomSystem(seed);
    const BlockMatrix matrix = FromDense(system.pattern, system.A);
    BlockMatrixOperator A(&matrix);
    ConjugateGradients solver;
    VectorXd x(system.b.size());
    const ConjugateGradientsResult result =
        Solve(&solver, &A, nullptr, system.b, ByResidual(1e-13), &x);
    EXPECT_EQ(result.end, End::kConverged);
    const VectorXd expected = system.A.llt().solve(system.b);
    EXPECT_LT((x - expected).norm(), 1e-8 * expected.norm()) << "seed " << seed;
    EXPECT_LE(result.relative_residual, 1e-13);
  }
}

TEST(ConjugateGradients, ReturnsTheResidualOfItsSolution) {
  const System system = RandomSystem(3);
  DenseOperator A(system.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  for (const int iterations : {0, 1, 7, 30}) {
    const ConjugateGradientsResult result =
        Solve(&solver, &A, nullptr, system.b, ByResidual(0.0, iterations), &x);
    EXPECT_EQ(result.end, End::kMaxIterations);
    EXPECT_EQ(result.iterations, iterations);
    const VectorXd r = system.b - system.A * x;
    const Eigen::Map<const VectorXd> returned(solver.residual().data(), x.size());
    EXPECT_LT((returned - r).norm(), 1e-12 * system.b.norm());
    EXPECT_NEAR(result.relative_residual, r.norm() / system.b.norm(), 1e-12);
    EXPECT_NEAR(result.model_change, Model(system, x), 1e-12 * std::abs(Model(system, x)));
  }
}

TEST(ConjugateGradients, TakesOneStepWithTheInverseAsPreconditioner) {
  const System system = RandomSystem(4);
  DenseOperator A(system.A);
  InversePreconditioner inverse(system.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  const ConjugateGradientsResult result =
      Solve(&solver, &A, &inverse, system.b, ByResidual(1e-9), &x);
  EXPECT_EQ(result.end, End::kConverged);
  EXPECT_EQ(result.iterations, 1);
  EXPECT_EQ(A.num_products, 1);
}

TEST(ConjugateGradients, EndsWhereTheModelStopsGaining) {
  const System system = RandomSystem(5);
  DenseOperator A(system.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  int last = 0;
  for (const double eta : {0.5, 0.1, 1e-2, 1e-4}) {
    // The definition, with Q of the iterates themselves.
    int expected = 0;
    double last_model = 0.0;
    for (int i = 1; expected == 0; ++i) {
      Solve(&solver, &A, nullptr, system.b, ByResidual(0.0, i), &x);
      const double model = Model(system, x);
      if (i * (model - last_model) / model < eta) expected = i;
      last_model = model;
    }
    const ConjugateGradientsResult result =
        Solve(&solver, &A, nullptr, system.b, {.eta = eta, .residual_tolerance = 0.0}, &x);
    EXPECT_EQ(result.end, End::kConverged);
    EXPECT_EQ(result.iterations, expected) << "eta " << eta;
    EXPECT_GT(result.iterations, last) << "the cases of this test should differ";
    last = result.iterations;
  }
}

TEST(ConjugateGradients, TakesAtLeastTheIterationsAskedFor) {
  const System system = RandomSystem(6);
  DenseOperator A(system.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  const ConjugateGradientsResult result =
      Solve(&solver, &A, nullptr, system.b,
            {.min_iterations = 9, .eta = 1e3, .residual_tolerance = 1e3}, &x);
  EXPECT_EQ(result.iterations, 9);
  EXPECT_EQ(result.end, End::kConverged);
}

TEST(ConjugateGradients, FlagsAnIndefiniteMatrixAndKeepsADescentDirection) {
  System system = RandomSystem(7);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(system.A);
  // The smallest eigenvalue changes its sign; the steps before that is noticed are good ones.
  const VectorXd v = eigen.eigenvectors().col(0);
  system.A -= (eigen.eigenvalues()[0] + 1.0) * v * v.transpose();
  DenseOperator A(system.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  const ConjugateGradientsResult result =
      Solve(&solver, &A, nullptr, system.b, ByResidual(1e-12), &x);
  EXPECT_EQ(result.end, End::kNegativeCurvature);
  EXPECT_GT(result.iterations, 0);
  EXPECT_TRUE(x.allFinite());
  EXPECT_GT(system.b.dot(x), 0.0);
  EXPECT_LT(Model(system, x), 0.0);
}

TEST(ConjugateGradients, MovesNowhereWhenTheFirstDirectionHasNegativeCurvature) {
  const System system = RandomSystem(8);
  DenseOperator A(-system.A);
  ConjugateGradients solver;
  VectorXd x = system.b;
  const ConjugateGradientsResult result =
      Solve(&solver, &A, nullptr, system.b, ByResidual(1e-12), &x);
  EXPECT_EQ(result.end, End::kNegativeCurvature);
  EXPECT_EQ(result.iterations, 0);
  EXPECT_EQ(x, VectorXd::Zero(x.size()));
}

TEST(ConjugateGradients, FlagsAPreconditionerThatIsNotPositiveDefinite) {
  const System system = RandomSystem(9);
  DenseOperator A(system.A);
  ScalingPreconditioner negative(system.b.size(), -1.0);
  ConjugateGradients solver;
  VectorXd x(system.b.size());
  const ConjugateGradientsResult result =
      Solve(&solver, &A, &negative, system.b, ByResidual(1e-12), &x);
  EXPECT_EQ(result.end, End::kBadPreconditioner);
  EXPECT_EQ(x, VectorXd::Zero(x.size()));
}

TEST(ConjugateGradients, FlagsWhatIsNotFiniteAndReturnsFiniteNumbers) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, -infinity}) {
    System system = RandomSystem(10);
    ConjugateGradients solver;
    VectorXd x(system.b.size());
    {
      MatrixXd spoilt = system.A;
      spoilt(3, 3) = bad;
      DenseOperator A(spoilt);
      EXPECT_NE(Solve(&solver, &A, nullptr, system.b, ByResidual(1e-12), &x).end, End::kConverged);
      EXPECT_TRUE(x.allFinite());
    }
    DenseOperator A(system.A);
    ScalingPreconditioner scaling(system.b.size(), bad);
    EXPECT_EQ(Solve(&solver, &A, &scaling, system.b, ByResidual(1e-12), &x).end, End::kNotFinite);
    EXPECT_TRUE(x.allFinite());
    system.b[5] = bad;
    EXPECT_EQ(Solve(&solver, &A, nullptr, system.b, ByResidual(1e-12), &x).end, End::kNotFinite);
    EXPECT_TRUE(x.allFinite());
  }
}

TEST(ConjugateGradients, SolvesForNothingInNoSteps) {
  const System system = RandomSystem(11);
  DenseOperator A(system.A);
  ConjugateGradients solver;
  VectorXd x = system.b;
  const VectorXd zero = VectorXd::Zero(system.b.size());
  const ConjugateGradientsResult result = Solve(&solver, &A, nullptr, zero, ByResidual(1e-12), &x);
  EXPECT_EQ(result.end, End::kConverged);
  EXPECT_EQ(result.iterations, 0);
  EXPECT_EQ(x, zero);
}

TEST(ConjugateGradients, RepeatsBitForBitWhateverWasSolvedBefore) {
  const System system = RandomSystem(12), other = RandomSystem(13);
  DenseOperator A(system.A), other_A(other.A);
  ConjugateGradients solver;
  VectorXd x(system.b.size()), again(system.b.size()), other_x(other.b.size());
  Solve(&solver, &A, nullptr, system.b, ByResidual(1e-8), &x);
  Solve(&solver, &other_A, nullptr, other.b, ByResidual(1e-8), &other_x);
  Solve(&solver, &A, nullptr, system.b, ByResidual(1e-8), &again);
  EXPECT_EQ(x, again);
}

}  // namespace
}  // namespace holba
