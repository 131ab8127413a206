// SPDX-License-Identifier: BSD-3-Clause
// Solve: the optimum of a small bundle problem whatever the start and the linear solver, what must
// not move, residuals that vanish on the way, and every reason to stop.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "holba/base/random.h"
#include "holba/camera/camera_model.h"
#include "holba/residual/point.h"
#include "holba/solver/small_bundle_testing.h"
#include "holba/solver/solver.h"

namespace holba {
namespace {

using testing::HasSubstr;

// The tests below are run with every backend.
const std::vector<Backend> kBackends {
  Backend::kNative,
#if HOLBA_WITH_CERES
      Backend::kCeres,
#endif
};
Backend tested_backend = Backend::kNative;

SolverOptions Defaults() {
  SolverOptions options;
  options.backend = tested_backend;
  return options;
}

SolverOptions Tight(LinearSolver linear_solver = LinearSolver::kAuto, int num_threads = 1) {
  SolverOptions options = Defaults();
  options.linear_solver = linear_solver;
  options.num_threads = num_threads;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 0.0;
  options.parameter_tolerance = 1e-12;
  return options;
}

double LargestDifference(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0.0;
  for (size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, std::abs(a[i] - b[i]) / std::max(1.0, std::abs(b[i])));
  return largest;
}

class EverySolver : public testing::TestWithParam<std::tuple<Backend, LinearSolver, int>> {
 protected:
  EverySolver() {
    tested_backend = std::get<0>(GetParam());
    options = Tight(std::get<1>(GetParam()), std::get<2>(GetParam()));
    // Inexact steps take many iterations to the last digits.
    options.eta = 1e-3;
  }
  SolverOptions options;
};

class EveryBackend : public testing::TestWithParam<Backend> {
 protected:
  EveryBackend() { tested_backend = GetParam(); }
};
class AbsentResiduals : public EveryBackend {};
class StopReasonOf : public EveryBackend {};
class FunctionTolerance : public EveryBackend {};
#define HOLBA_FOR_EVERY_BACKEND(suite)                                                           \
  INSTANTIATE_TEST_SUITE_P(Backends, suite, testing::ValuesIn(kBackends), [](const auto& info) { \
    return info.param == Backend::kNative ? "Native" : "Ceres";                                  \
  })
HOLBA_FOR_EVERY_BACKEND(EveryBackend);
HOLBA_FOR_EVERY_BACKEND(AbsentResiduals);
HOLBA_FOR_EVERY_BACKEND(StopReasonOf);
HOLBA_FOR_EVERY_BACKEND(FunctionTolerance);

TEST_P(EverySolver, FindsTheTruthFromExactObservations) {
  SmallBundle bundle(0.0);
  for (const uint64_t seed : {1, 2, 3}) {
    bundle.Perturb(seed);
    const SolverSummary summary = Solve(options, &bundle.problem);
    EXPECT_GT(summary.initial_cost, 100.0);
    EXPECT_LT(summary.final_cost, 1e-14);
    EXPECT_LT(LargestDifference(bundle.problem.state(), bundle.truth), 1e-8);
  }
}

TEST_P(EverySolver, FindsTheSameOptimumOfNoisyObservationsFromEveryStart) {
  // The reference: dense, one thread, from the truth.
  SmallBundle reference(0.7, true, LossType::kCauchy);
  const SolverSummary expected = Solve(Tight(LinearSolver::kDense), &reference.problem);
  EXPECT_GT(expected.final_cost, 10.0);
  SmallBundle bundle(0.7, true, LossType::kCauchy);
  for (const uint64_t seed : {4, 5}) {
    bundle.Perturb(seed);
    const SolverSummary summary = Solve(options, &bundle.problem);
    EXPECT_NEAR(summary.final_cost, expected.final_cost, 1e-8 * expected.final_cost);
    EXPECT_LT(LargestDifference(bundle.problem.state(), reference.problem.state()), 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Solvers, EverySolver,
                         testing::Combine(testing::ValuesIn(kBackends),
                                          testing::Values(LinearSolver::kAuto, LinearSolver::kDense,
                                                          LinearSolver::kSparse,
                                                          LinearSolver::kIterative),
                                          testing::Values(1, 2)));

TEST_P(EveryBackend, NamesTheLinearSolverThatItUsed) {
  const bool native = tested_backend == Backend::kNative;
  const std::map<LinearSolver, std::string> names{
      {LinearSolver::kAuto, native ? "dense" : "DENSE_SCHUR"},
      {LinearSolver::kDense, native ? "dense" : "DENSE_SCHUR"},
      {LinearSolver::kSparse, native ? "sparse" : "SPARSE_SCHUR"},
      {LinearSolver::kIterative, native ? "conjugate gradients" : "ITERATIVE_SCHUR"}};
  for (const auto& [linear_solver, name] : names) {
    SmallBundle bundle(0.5);
    SolverOptions options = Defaults();
    options.linear_solver = linear_solver;
    options.num_threads = 2;
    const SolverSummary summary = Solve(options, &bundle.problem);
    EXPECT_THAT(summary.linear_solver, HasSubstr(name));
    EXPECT_EQ(summary.num_threads, 2);
    EXPECT_EQ(summary.backend, native ? "native" : "ceres");
  }
}

TEST(NativeOptions, WhateverThePreconditionerAndPrecisionTheOptimumIsTheSame) {
  tested_backend = Backend::kNative;
  SmallBundle bundle(0.5);
  bundle.Perturb(3);
  const std::vector<double> start = bundle.problem.state();
  const SolverSummary exact = Solve(Tight(LinearSolver::kDense), &bundle.problem);
  const std::vector<double> optimum = bundle.problem.state();
  const auto expect_optimum = [&](const SolverOptions& options, const std::string& name) {
    bundle.problem.state() = start;
    const SolverSummary summary = Solve(options, &bundle.problem);
    EXPECT_THAT(summary.linear_solver, HasSubstr(name));
    EXPECT_NEAR(summary.final_cost, exact.final_cost, 1e-9 * exact.final_cost) << name;
    EXPECT_LT(LargestDifference(bundle.problem.state(), optimum), 1e-5) << name;
  };
  for (const auto& [type, name] :
       {std::pair(PreconditionerType::kBlockJacobi, "block Jacobi"),
        std::pair(PreconditionerType::kBorder, "border"),
        std::pair(PreconditionerType::kPowerSeries, "power series"),
        std::pair(PreconditionerType::kAuto, "border")}) {  // one camera, which all poses see
    SolverOptions options = Tight(LinearSolver::kIterative);
    options.preconditioner = type;
    options.eta = 1e-3;
    expect_optimum(options, name);
  }
  for (LinearSolver solver : {LinearSolver::kDense, LinearSolver::kSparse}) {
    for (const auto& [precision, name] : {std::pair(FactorPrecision::kDouble, "double"),
                                          std::pair(FactorPrecision::kMixed, "mixed"),
                                          std::pair(FactorPrecision::kAuto, "double")}) {
      SolverOptions options = Tight(solver);
      options.precision = precision;
      expect_optimum(options, name);
    }
  }
}

TEST_P(EveryBackend, WithOneThreadRepeatsBitForBit) {
  std::vector<std::vector<double>> ends;
  for (int run = 0; run < 2; ++run) {
    SmallBundle bundle(0.7);
    bundle.Perturb(3);
    Solve(Tight(), &bundle.problem);
    ends.push_back(bundle.problem.state());
  }
  EXPECT_EQ(std::memcmp(ends[0].data(), ends[1].data(), ends[0].size() * sizeof(double)), 0);
}

TEST_P(EveryBackend, KeepsTheBitsOfConstantBlocksAndHeldCoordinates) {
  SmallBundle bundle(0.7);
  bundle.Perturb(6);
  bundle.problem.block(bundle.points[3]).constant = true;
  bundle.problem.block(bundle.poses[2]).constant = true;
  bundle.problem.block(bundle.poses[4]).held = 0b110000;
  const std::vector<double> start = bundle.problem.state();
  const SolverSummary summary = Solve(Tight(), &bundle.problem);
  EXPECT_LT(summary.final_cost, 0.5 * summary.initial_cost);
  const auto at = [&](const std::vector<double>& state, BlockId id) {
    return state.data() + (bundle.problem.values(id) - bundle.problem.state().data());
  };
  const auto same = [&](BlockId id, int from, int count) {
    return std::memcmp(at(start, id) + from, bundle.problem.values(id) + from,
                       count * sizeof(double)) == 0;
  };
  EXPECT_TRUE(same(bundle.points[3], 0, 3));
  EXPECT_TRUE(same(bundle.poses[0], 0, 7));
  EXPECT_TRUE(same(bundle.poses[2], 0, 7));
  EXPECT_TRUE(same(bundle.poses[4], 5, 2));
  EXPECT_FALSE(same(bundle.poses[4], 4, 1));
  EXPECT_TRUE(same(bundle.poses.back(), 4, 1));
  EXPECT_TRUE(same(bundle.camera, 2, 2));
  EXPECT_FALSE(same(bundle.camera, 0, 1));
  EXPECT_FALSE(same(bundle.points[4], 0, 1));
}

TEST_P(EveryBackend, WorksWithFeaturesOnlyAndWithKeptBlocksOnly) {
  for (const bool features_only : {true, false}) {
    for (const LinearSolver linear_solver :
         {LinearSolver::kDense, LinearSolver::kSparse, LinearSolver::kIterative}) {
      SmallBundle bundle(0.0);
      bundle.Perturb(7);
      for (BlockId id = 0; id < bundle.problem.num_blocks(); ++id) {
        ParameterBlock& block = bundle.problem.block(id);
        if ((block.role == BlockRole::kFeature) == features_only) continue;
        block.constant = true;
        std::copy_n(
            bundle.truth.data() + (bundle.problem.values(id) - bundle.problem.state().data()),
            block.manifold->ambient, bundle.problem.values(id));
      }
      const SolverSummary summary = Solve(Tight(linear_solver), &bundle.problem);
      EXPECT_LT(summary.final_cost, 1e-14) << summary.linear_solver;
      EXPECT_LT(LargestDifference(bundle.problem.state(), bundle.truth), 1e-8);
      EXPECT_EQ(summary.reduced_system.size == 0, features_only);
    }
  }
}

TEST_P(EveryBackend, ReportsCostsOfTheStatesItBeganAndEndedWith) {
  SmallBundle bundle(0.7, true, LossType::kHuber);
  bundle.Perturb(8);
  const std::vector<TermCost> before = EvaluateTerms(bundle.problem);
  SolverOptions options = Defaults();
  std::vector<IterationRecord> records;
  options.on_iteration = [&](const IterationRecord& record) {
    records.push_back(record);
    return true;
  };
  const SolverSummary summary = Solve(options, &bundle.problem);
  const std::vector<TermCost> after = EvaluateTerms(bundle.problem);
  ASSERT_EQ(summary.initial_terms.size(), 1u);
  const auto expect_same = [](double a, double b) { EXPECT_NEAR(a, b, 1e-12 * b); };
  expect_same(summary.initial_cost, before[0].cost);
  expect_same(summary.initial_terms[0].sum_squares, before[0].sum_squares);
  expect_same(summary.final_cost, after[0].cost);
  expect_same(summary.final_terms[0].sum_squares, after[0].sum_squares);
  EXPECT_EQ(summary.final_terms[0].residuals, bundle.poses.size() * bundle.points.size());
  // The records tell the same story: one for the start and one per step, costs never rise.
  ASSERT_EQ(records.size(), static_cast<size_t>(summary.iterations) + 1);
  EXPECT_NEAR(records[0].cost, before[0].cost, 1e-9 * before[0].cost);
  EXPECT_NEAR(records.back().terms[0].cost, after[0].cost, 1e-9 * after[0].cost);
  int accepted = 0;
  for (size_t i = 1; i < records.size(); ++i) {
    EXPECT_EQ(records[i].iteration, static_cast<int>(i));
    EXPECT_LE(records[i].terms[0].cost, records[i - 1].terms[0].cost);
    EXPECT_NEAR(records[i].terms[0].cost, records[i].cost, 1e-9 * records[i].cost);
    accepted += records[i].accepted;
  }
  EXPECT_EQ(accepted, summary.accepted_steps);
  EXPECT_EQ(summary.iteration_seconds.size(), static_cast<size_t>(summary.iterations));
  // 5 free poses, one coordinate held, and two focal lengths; every pose sees every point.
  EXPECT_EQ(summary.reduced_system.size, 31u);
}

// r = a (x - b), absent where x <= c, of a scalar.
struct ScalarKernel {
  struct Datum {
    double factor, target, absent_below;
  };
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    if (values[0][0] <= datum.absent_below) return false;
    r[0] = datum.factor * (values[0][0] - datum.target);
    if (jacobians[0]) jacobians[0][0] = datum.factor;
    return true;
  }
};
constexpr double kAlways = -std::numeric_limits<double>::infinity();

struct ScalarProblem {
  Problem problem;
  explicit ScalarProblem(double x) {
    problem.AddBlock("x", EuclideanOps(1), BlockRole::kGroup, {&x, 1});
  }
  void Add(const std::string& term, const ScalarKernel::Datum& datum, bool angular = false,
           double weight = 1.0) {
    auto batch =
        std::make_unique<KernelBatch<ScalarKernel>>(term, 1, std::vector<int>{1}, ScalarKernel{});
    batch->Add(std::array{BlockId{0}}, datum);
    batch->angular = angular;
    batch->weight = weight;
    problem.AddBatch(std::move(batch));
  }
  double x() const { return *problem.values(0); }
};

TEST_P(AbsentResiduals, KeepTheirLastValueAndGiveTheSolverNothing) {
  // One residual wants x = -1, the other x = 5 but vanishes below 0: from 0.5, its gradient is made
  // too weak to be heard, so that the first step leads past 0.
  ScalarProblem p(0.5);
  p.Add("pull", {10.0, -1.0, kAlways});
  p.Add("vanishing", {1.0, 5.0, 0.0});
  std::vector<double> of_vanishing;
  SolverOptions options = Tight();
  options.on_iteration = [&](const IterationRecord& record) {
    of_vanishing.push_back(record.terms[1].cost);
    return true;
  };
  const SolverSummary summary = Solve(options, &p.problem);
  EXPECT_LT(p.x(), 0.0);
  EXPECT_EQ(summary.initial_terms[1].absent, 0u);
  EXPECT_EQ(summary.final_terms[1].residuals, 1u);
  EXPECT_EQ(summary.final_terms[1].absent, 1u);
  // It counts as it did when it was last seen: at the start.
  for (const double cost : of_vanishing) EXPECT_DOUBLE_EQ(cost, 0.5 * 4.5 * 4.5);
  EXPECT_DOUBLE_EQ(summary.final_terms[1].cost, 0.5 * 4.5 * 4.5);
  EXPECT_NEAR(summary.final_cost, 0.5 * 4.5 * 4.5 + summary.final_terms[0].cost, 1e-12);
  EXPECT_NEAR(p.x(), -1.0, 1e-6) << "a zero Jacobian does not hold the others back";
}

TEST_P(AbsentResiduals, AreNotHiddenForTheirCost) {
  // Alone, the residual would be cheapest where it is not: the solver must find its optimum
  // instead.
  ScalarProblem p(0.5);
  p.Add("only", {100.0, 5.0, 0.0});
  p.Add("pull", {1.0, -1.0, kAlways});
  const SolverSummary summary = Solve(Tight(), &p.problem);
  EXPECT_NEAR(p.x(), (1e4 * 5.0 - 1.0) / (1e4 + 1.0), 1e-6);
  EXPECT_EQ(summary.final_terms[0].absent, 0u);
}

TEST_P(AbsentResiduals, CountNothingWhereTheyWereNeverPresent) {
  ScalarProblem p(-3.0);
  p.Add("point", {1.0, 5.0, 0.0});
  p.Add("point", {1.0, -1.0, kAlways});
  const SolverSummary summary = Solve(Tight(), &p.problem);
  EXPECT_DOUBLE_EQ(summary.initial_cost, 0.5 * 2.0 * 2.0);
  EXPECT_LT(summary.final_cost, 1e-20);
  EXPECT_NEAR(p.x(), -1.0, 1e-9);
  ASSERT_EQ(summary.final_terms.size(), 1u);
  EXPECT_EQ(summary.initial_terms[0].absent, 1u);
  EXPECT_EQ(summary.final_terms[0].absent, 1u);
  EXPECT_EQ(summary.final_terms[0].residuals, 2u);
}

TEST_P(AbsentResiduals, ReturnWhenTheyArePresentAgain) {
  // From -3 the pull to 2 brings the other residual into being; then both count.
  ScalarProblem p(-3.0);
  p.Add("late", {1.0, 2.5, 0.0});
  p.Add("pull", {1.0, 2.0, kAlways});
  const SolverSummary summary = Solve(Tight(), &p.problem);
  EXPECT_NEAR(p.x(), 2.25, 1e-6);
  EXPECT_EQ(summary.initial_terms[0].absent, 1u);
  EXPECT_EQ(summary.final_terms[0].absent, 0u);
}

TEST_P(AbsentResiduals, CountOnceWhereTheyAppear) {
  // The same, stopped at the first accepted step, which brings the residual into being.
  ScalarProblem p(-3.0);
  p.Add("late", {1.0, 2.5, 0.0});
  p.Add("pull", {1.0, 2.0, kAlways});
  SolverOptions options = Tight();
  options.function_tolerance = 1.0;
  const SolverSummary summary = Solve(options, &p.problem);
  EXPECT_EQ(summary.accepted_steps, 1);
  EXPECT_GT(p.x(), 0.0);
  const std::vector<TermCost> terms = EvaluateTerms(p.problem);
  EXPECT_NEAR(summary.final_cost, terms[0].cost + terms[1].cost, 1e-12);
  for (int t : {0, 1}) {
    EXPECT_NEAR(summary.final_terms[t].cost, terms[t].cost, 1e-12);
    EXPECT_NEAR(summary.final_terms[t].sum_squares, terms[t].sum_squares, 1e-12);
  }
  EXPECT_GT(terms[0].cost, 0.01);
}

TEST_P(AbsentResiduals, OfAPointBehindACameraKeepTheLastPixels) {
  // A point is drawn behind the second camera by a strong pull in the first problem's own
  // coordinates: it is seen there no longer, but the cost of its two observations does not fall to
  // that of one.
  const CameraModel& model = *FindCameraModel("SIMPLE_PINHOLE");
  Problem problem;
  const double params[3] = {500, 320, 240}, pose[7] = {0, 0, 0, 1, 0, 0, 0}, X[3] = {0.4, 0.0, 1.0};
  const BlockId camera =
      problem.AddBlock("camera", EuclideanOps(3), BlockRole::kIntrinsics, params);
  const BlockId pose_block =
      problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, pose);
  const BlockId point = problem.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature, X);
  problem.block(camera).constant = problem.block(pose_block).constant = true;
  auto seen = std::make_unique<KernelBatch<PointResidual>>("point", 2, std::vector<int>{3, 6, 3},
                                                           PointResidual{&model});
  seen->Add(std::array{point, pose_block, camera},
            {Eigen::Vector2d(520, 240), nullptr});  // exact for X / 1
  problem.AddBatch(std::move(seen));
  struct PullKernel {
    using Datum = Eigen::Vector3d;
    bool Evaluate(const Datum& goal, const double* const* values, double* r,
                  double* const* jacobians) const {
      for (int k = 0; k < 3; ++k) r[k] = 1e5 * (values[0][k] - goal[k]);
      if (jacobians[0])
        Eigen::Map<RowMajor<3, 3>>{jacobians[0]} = 1e5 * Eigen::Matrix3d::Identity();
      return true;
    }
  };
  auto pull =
      std::make_unique<KernelBatch<PullKernel>>("pull", 3, std::vector<int>{3}, PullKernel{});
  pull->Add(std::array{point}, {0.4, 0.0, -1.0});
  problem.AddBatch(std::move(pull));
  const double before = EvaluateTerms(problem)[0].cost;
  EXPECT_NEAR(before, 0.0, 1e-20);
  const SolverSummary summary = Solve(Tight(), &problem);
  EXPECT_NEAR(problem.values(point)[2], -1.0, 1e-6);
  EXPECT_EQ(summary.final_terms[0].absent, 1u);
  EXPECT_EQ(summary.final_terms[0].cost, before);
}

TEST_P(StopReasonOf, IsConvergedByEachTolerance) {
  for (const int which : {0, 1, 2}) {
    SmallBundle bundle(0.7);
    bundle.Perturb(9);
    SolverOptions options = Tight();
    options.function_tolerance = which == 0 ? 1e-3 : 0.0;
    options.gradient_tolerance = which == 1 ? 1e-1 : 0.0;
    options.parameter_tolerance = which == 2 ? 1e-3 : 0.0;
    const SolverSummary summary = Solve(options, &bundle.problem);
    EXPECT_EQ(summary.stop_reason, StopReason::kConverged) << which;
    EXPECT_FALSE(summary.message.empty());
    EXPECT_LT(summary.iterations, 20) << which;
    EXPECT_EQ(NameOf(summary.stop_reason), "converged");
  }
}

TEST_P(StopReasonOf, IsTheLimitThatWasReached) {
  SmallBundle bundle(0.7);
  bundle.Perturb(9);
  SolverOptions options = Tight();
  options.max_num_iterations = 2;
  SolverSummary summary = Solve(options, &bundle.problem);
  EXPECT_EQ(summary.stop_reason, StopReason::kMaxIterations);
  EXPECT_EQ(summary.iterations, 2);
  bundle.Perturb(9);
  options = Tight();
  options.max_seconds = 1e-9;
  summary = Solve(options, &bundle.problem);
  EXPECT_EQ(summary.stop_reason, StopReason::kMaxTime);
  EXPECT_LT(summary.iterations, 2);
}

TEST_P(StopReasonOf, IsMaxIterationsWhenNoneWereAllowedAndNothingMoved) {
  SmallBundle bundle(0.7);
  bundle.Perturb(9);
  const std::vector<double> start = bundle.problem.state();
  SolverOptions options = Tight();
  options.max_num_iterations = 0;
  const SolverSummary summary = Solve(options, &bundle.problem);
  EXPECT_EQ(summary.stop_reason, StopReason::kMaxIterations);
  EXPECT_EQ(bundle.problem.state(), start);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
}

TEST_P(StopReasonOf, IsTheCallersWishAndTheBestStateIsKept) {
  SmallBundle bundle(0.7);
  bundle.Perturb(9);
  SolverOptions options = Tight();
  double last = 0.0;
  options.on_iteration = [&](const IterationRecord& record) {
    last = record.terms[0].cost;
    return record.iteration < 3;
  };
  const SolverSummary summary = Solve(options, &bundle.problem);
  EXPECT_EQ(summary.stop_reason, StopReason::kCallback);
  EXPECT_EQ(summary.iterations, 3);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_DOUBLE_EQ(summary.final_cost, last);
  const double cost = EvaluateTerms(bundle.problem)[0].cost;
  EXPECT_NEAR(summary.final_cost, cost, 1e-12 * cost);
}

TEST_P(StopReasonOf, IsNothingToDoWhereAllIsConstantOrThereAreNoResiduals) {
  SmallBundle bundle(0.7);
  for (BlockId id = 0; id < bundle.problem.num_blocks(); ++id)
    bundle.problem.block(id).constant = true;
  const SolverSummary summary = Solve(Tight(), &bundle.problem);
  EXPECT_EQ(summary.stop_reason, StopReason::kNothingToDo);
  EXPECT_GT(summary.final_cost, 0.0);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_EQ(bundle.problem.state(), bundle.truth);

  ScalarProblem without_residuals(3.0);
  EXPECT_EQ(Solve(Tight(), &without_residuals.problem).stop_reason, StopReason::kNothingToDo);
  Problem empty;
  EXPECT_EQ(Solve(Tight(), &empty).stop_reason, StopReason::kNothingToDo);
}

// A Jacobian that is not a number.
struct BrokenKernel {
  struct Datum {
    double broken_below;
  };
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    r[0] = values[0][0];
    if (jacobians[0])
      jacobians[0][0] = r[0] < datum.broken_below ? std::numeric_limits<double>::quiet_NaN() : 1.0;
    return true;
  }
};

TEST_P(StopReasonOf, IsNoStepWhereNoneCanBeComputedAndTheBestStateIsKept) {
  for (const double broken_below : {10.0, 1.0}) {  // at once, and after some steps
    Problem problem;
    const double x = 3.0;
    const BlockId block = problem.AddBlock("x", EuclideanOps(1), BlockRole::kGroup, {&x, 1});
    auto batch = std::make_unique<KernelBatch<BrokenKernel>>("broken", 1, std::vector<int>{1},
                                                             BrokenKernel{});
    batch->Add(std::array{block}, {broken_below});
    problem.AddBatch(std::move(batch));
    SolverOptions options = Tight();
    options.initial_trust_radius = 0.1;  // short steps
    const SolverSummary summary = Solve(options, &problem);
    EXPECT_EQ(summary.stop_reason, StopReason::kNoStep);
    EXPECT_FALSE(summary.message.empty());
    const double end = *problem.values(block);
    EXPECT_DOUBLE_EQ(summary.final_cost, 0.5 * end * end);
    if (broken_below == 10.0) {
      EXPECT_EQ(end, 3.0);
    } else {
      EXPECT_LT(end, 2.9);
    }
  }
}

TEST_P(FunctionTolerance, IgnoresAngularTermsUnlessToldOtherwise) {
  // The pixel term is at its optimum in another coordinate; only the angular one still falls.
  const auto solve = [](bool counts_angular, bool angular) {
    Problem problem;
    const double at[2] = {1.0, 4.0};
    const BlockId pixel = problem.AddBlock("x", EuclideanOps(1), BlockRole::kGroup, {at, 1});
    const BlockId angle = problem.AddBlock("y", EuclideanOps(1), BlockRole::kGroup, {at + 1, 1});
    for (const BlockId block : {pixel, angle}) {
      auto batch = std::make_unique<KernelBatch<ScalarKernel>>(block == pixel ? "point" : "vp", 1,
                                                               std::vector<int>{1}, ScalarKernel{});
      batch->Add(std::array{block}, {1.0, 1.0, kAlways});
      if (block == pixel)
        batch->Add(std::array{block}, {1.0, 1.0 + 1e-3, kAlways});  // a cost that stays
      batch->angular = block == angle && angular;
      batch->loss = block == angle ? Loss{LossType::kCauchy, 0.05} : Loss{};
      problem.AddBatch(std::move(batch));
    }
    SolverOptions options = Tight();
    options.function_tolerance = 1e-3;
    options.termination_counts_angular = counts_angular;
    options.initial_trust_radius = 1.0;
    return Solve(options, &problem);
  };
  const SolverSummary ignored = solve(false, true), counted = solve(true, true),
                      pixels = solve(false, false);
  EXPECT_EQ(ignored.stop_reason, StopReason::kConverged);
  EXPECT_EQ(counted.iterations, pixels.iterations) << "as if the term were one of pixels";
  EXPECT_LT(ignored.iterations, counted.iterations);
}

}  // namespace
}  // namespace holba
