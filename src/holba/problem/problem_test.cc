// SPDX-License-Identifier: BSD-3-Clause
// Problem: what it refuses, sums of terms, ranges of residuals in panels, structure of the reduced
// system.
#include "holba/problem/problem.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

// r = q X + datum (t - X_0^2, X_1 X_2), a pose [q t] and a point X; absent where X_0 < 0.
struct MixedKernel {
  using Datum = double;
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    const double* pose = values[0];
    const double* X = values[1];
    if (X[0] < 0) return false;
    const Eigen::Quaterniond q(pose[3], pose[0], pose[1], pose[2]);
    const Eigen::Vector3d rotated = q * Eigen::Vector3d(X[0], X[1], X[2]);
    r[0] = rotated.x() + datum * (pose[4] - X[0] * X[0]);
    r[1] = rotated.y() + datum * X[1] * X[2];
    const Eigen::Matrix3d R = q.toRotationMatrix();
    if (jacobians[0]) {
      Eigen::Map<RowMajor<2, 6>> J(jacobians[0]);
      J.setZero();
      J(0, 1) = rotated.z(), J(0, 2) = -rotated.y();
      J(1, 0) = -rotated.z(), J(1, 2) = rotated.x();
      J(0, 3) = datum;
    }
    if (jacobians[1]) {
      Eigen::Map<RowMajor<2, 3>> J(jacobians[1]);
      J = R.topRows<2>();
      J(0, 0) -= 2 * datum * X[0];
      J(1, 1) += datum * X[2];
      J(1, 2) += datum * X[1];
    }
    return true;
  }
};

// r = sum of all blocks - datum, one dimension; absent for a negative datum.
struct SumKernel {
  using Datum = double;
  std::vector<int> sizes;
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    if (datum < 0) return false;
    r[0] = -datum;
    for (size_t s = 0; s < sizes.size(); ++s) {
      for (int c = 0; c < sizes[s]; ++c) {
        r[0] += values[s][c];
        if (jacobians[s]) jacobians[s][c] = 1.0;
      }
    }
    return true;
  }
};

std::unique_ptr<KernelBatch<SumKernel>> SumBatch(const std::string& term,
                                                 const std::vector<int>& sizes) {
  return std::make_unique<KernelBatch<SumKernel>>(term, 1, sizes, SumKernel{sizes});
}

BlockId AddScalars(Problem* problem, std::string_view kind, BlockRole role,
                   const std::vector<double>& values) {
  return problem->AddBlock(kind, EuclideanOps(static_cast<int>(values.size())), role, values);
}

template <typename Function>
std::string CheckErrorOf(const Function& function) {
  try {
    function();
  } catch (const CheckError& error) {
    return error.what();
  }
  return "no error";
}

TEST(AddBatch, RefusesAResidualOfTwoFeaturesByName) {
  Problem problem;
  const BlockId pose = AddScalars(&problem, "pose", BlockRole::kPose, {0, 0});
  const BlockId point = AddScalars(&problem, "point", BlockRole::kFeature, {0, 0});
  const BlockId line = AddScalars(&problem, "line", BlockRole::kFeature, {0, 0});
  auto batch = SumBatch("wireframe_3d", {2, 2, 2});
  batch->Add(std::array{pose, point, pose}, 0.0);
  batch->Add(std::array{point, pose, line}, 0.0);
  EXPECT_THAT(
      CheckErrorOf([&] { problem.AddBatch(std::move(batch)); }),
      AllOf(HasSubstr("residual 1"), HasSubstr("'wireframe_3d'"), HasSubstr("a point and a line")));
  EXPECT_TRUE(problem.batches().empty());
}

TEST(AddBatch, TakesTwoFeaturesWhereOneOfThemIsKept) {
  Problem problem;
  const BlockId point = AddScalars(&problem, "point", BlockRole::kFeature, {0, 0});
  const BlockId line = AddScalars(&problem, "line", BlockRole::kGroup, {0, 0});
  auto batch = SumBatch("wireframe_3d", {2, 2});
  batch->Add(std::array{point, line}, 0.0);
  problem.AddBatch(std::move(batch));
  EXPECT_EQ(problem.num_residuals(), 1u);
}

TEST(AddBatch, RefusesBlocksThatDoNotFitTheirSlots) {
  Problem problem;
  const BlockId point = AddScalars(&problem, "point", BlockRole::kFeature, {0, 0, 0});
  auto wrong_size = SumBatch("relation", {2});
  wrong_size->Add(std::array{point}, 0.0);
  EXPECT_THAT(CheckErrorOf([&] { problem.AddBatch(std::move(wrong_size)); }),
              AllOf(HasSubstr("relation"), HasSubstr("slot 0"), HasSubstr("a point does not fit")));
  auto unknown = SumBatch("vp", {3});
  unknown->Add(std::array{BlockId{7}}, 0.0);
  EXPECT_THAT(CheckErrorOf([&] { problem.AddBatch(std::move(unknown)); }), HasSubstr("vp"));
  auto too_wide = std::make_unique<KernelBatch<SumKernel>>("wide", kMaxResidualDim + 1,
                                                           std::vector<int>{3}, SumKernel{{3}});
  too_wide->Add(std::array{point}, 0.0);
  EXPECT_NE(CheckErrorOf([&] { problem.AddBatch(std::move(too_wide)); }), "no error");
  EXPECT_TRUE(problem.batches().empty());
}

TEST(AddBlock, RefusesValuesThatAreNotOfItsManifold) {
  Problem problem;
  const double values[6] = {};
  EXPECT_THAT(CheckErrorOf([&] {
                problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values);
              }),
              HasSubstr("pose"));
  EXPECT_EQ(problem.num_blocks(), 0u);
}

TEST(ParameterBlock, CountsTheTangentCoordinatesThatMove) {
  Problem problem;
  const double values[7] = {0, 0, 0, 1, 0, 0, 0};
  ParameterBlock& block =
      problem.block(problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values));
  EXPECT_EQ(block.FreeTangent(), 6);
  block.held = 0b101000;
  EXPECT_EQ(block.FreeTangent(), 4);
  block.constant = true;
  EXPECT_EQ(block.FreeTangent(), 0);
}

TEST(EvaluateTerms, SumsBatchesOfATermAndCountsAbsentResiduals) {
  Problem problem;
  const BlockId x = AddScalars(&problem, "x", BlockRole::kGroup, {10.0});
  auto a = SumBatch("point", {1});
  for (const double datum : {8.0, 7.0, -1.0}) a->Add(std::array{x}, datum);  // 2, 3, absent
  a->weight = 5.0;
  auto b = SumBatch("vp", {1});
  b->Add(std::array{x}, 6.0);  // 4
  b->angular = true;
  b->loss = {LossType::kHuber, 1.0};  // rho(16) = 2 * 4 - 1
  b->weight = 2.0;
  auto c = SumBatch("point", {1});
  c->Add(std::array{x}, 9.0);  // 1
  c->loss = {LossType::kCauchy, 1.0};
  problem.AddBatch(std::move(a));
  problem.AddBatch(std::move(b));
  problem.AddBatch(std::move(c));
  problem.AddBatch(SumBatch("line", {1}));  // empty: no term

  const std::vector<TermCost> terms = EvaluateTerms(problem);
  ASSERT_EQ(terms.size(), 2u);
  EXPECT_EQ(terms[0].term, "point");
  EXPECT_FALSE(terms[0].angular);
  EXPECT_EQ(terms[0].residuals, 4u);
  EXPECT_EQ(terms[0].absent, 1u);
  EXPECT_DOUBLE_EQ(terms[0].sum_squares, 4.0 + 9.0 + 1.0);
  EXPECT_DOUBLE_EQ(terms[0].cost, 0.5 * 5.0 * 13.0 + 0.5 * std::log(2.0));
  EXPECT_EQ(terms[1].term, "vp");
  EXPECT_TRUE(terms[1].angular);
  EXPECT_EQ(terms[1].residuals, 1u);
  EXPECT_DOUBLE_EQ(terms[1].sum_squares, 16.0);
  EXPECT_DOUBLE_EQ(terms[1].cost, 0.5 * 2.0 * 7.0);
  EXPECT_EQ(problem.num_residuals(), 5u);

  EXPECT_THAT(ResidualNorms(problem, "point", false), ElementsAre(2.0, 3.0, 1.0));
  EXPECT_THAT(ResidualNorms(problem, "line", false), testing::IsEmpty());
}

TEST(ResidualNorms, AreOfResidualsOrOfTheirComponents) {
  Problem problem;
  const double pose_values[7] = {0, 0, 0, 1, 0, 0, 0};
  const BlockId pose =
      problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, pose_values);
  const BlockId point = AddScalars(&problem, "point", BlockRole::kFeature, {3.0, -4.0, 0.0});
  auto batch =
      std::make_unique<KernelBatch<MixedKernel>>("point", 2, std::vector<int>{6, 3}, MixedKernel{});
  batch->Add(std::array{pose, point}, 0.0);
  problem.AddBatch(std::move(batch));
  EXPECT_THAT(ResidualNorms(problem, "point", false), ElementsAre(5.0));
  EXPECT_THAT(ResidualNorms(problem, "point", true), ElementsAre(3.0, 4.0));
}

// 40 residuals of 5 poses and 11 points, about a quarter of them absent.
struct MixedProblem {
  Problem problem;
  MixedProblem() {
    Random random(3);
    std::vector<BlockId> poses, points;
    for (int i = 0; i < 5; ++i) {
      const Eigen::Quaterniond q = ExpRotation({random.Normal(), random.Normal(), random.Normal()});
      const double values[7] = {q.x(),           q.y(),           q.z(),          q.w(),
                                random.Normal(), random.Normal(), random.Normal()};
      poses.push_back(problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values));
    }
    for (int i = 0; i < 11; ++i) {
      points.push_back(
          AddScalars(&problem, "point", BlockRole::kFeature,
                     {i % 4 == 3 ? -1.0 : random.Uniform(), random.Normal(), random.Normal()}));
    }
    auto batch = std::make_unique<KernelBatch<MixedKernel>>("point", 2, std::vector<int>{6, 3},
                                                            MixedKernel{});
    for (int i = 0; i < 40; ++i)
      batch->Add(std::array{poses[i % 5], points[i * 7 % 11]}, random.Normal());
    problem.AddBatch(std::move(batch));
  }
};

TEST(Batch, EvaluatesRangesBitForBitAsItsSingleResiduals) {
  const MixedProblem mixed;
  const ResidualBatch& batch = *mixed.problem.batches()[0];
  const ParameterReader reader = mixed.problem.Reader();
  size_t absent = 0;
  for (const auto [begin, end, stride] : {std::array<size_t, 3>{0, 40, 40},
                                          {0, 40, 64},
                                          {13, 29, 16},
                                          {39, 40, 8},
                                          {5, 5, 8},
                                          {3, 5, 2}}) {
    const double unset = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> residuals(2 * stride, unset), by_pose(12 * stride, unset),
        by_point(6 * stride, unset);
    std::vector<uint8_t> present(stride, 2);
    ResidualPanel panel;
    panel.stride = stride;
    panel.residuals = residuals.data();
    panel.jacobians = {by_pose.data(), by_point.data()};
    panel.present = reinterpret_cast<bool*>(present.data());
    batch.Evaluate(begin, end, reader, panel);
    for (size_t i = begin; i < end; ++i) {
      const size_t j = i - begin;
      double r[2], jacobian_pose[12], jacobian_point[6];
      bool is_present = false;
      ResidualPanel single;
      single.residuals = r;
      single.jacobians = {jacobian_pose, jacobian_point};
      single.present = &is_present;
      batch.Evaluate(i, i + 1, reader, single);
      absent += !is_present;
      EXPECT_EQ(present[j], is_present);
      const auto same = [&, stride = stride](const std::vector<double>& values, const double* expected,
                            size_t size) {
        for (size_t k = 0; k < size; ++k) {
          EXPECT_EQ(std::bit_cast<uint64_t>(values[k * stride + j]),
                    std::bit_cast<uint64_t>(expected[k]))
              << "residual " << i << ", entry " << k << ", stride " << stride;
        }
      };
      same(residuals, r, 2);
      same(by_pose, jacobian_pose, 12);
      same(by_point, jacobian_point, 6);
      if (!is_present) {
        EXPECT_THAT(r, Each(0.0));
        EXPECT_THAT(jacobian_pose, Each(0.0));
        EXPECT_THAT(jacobian_point, Each(0.0));
      }
    }
    // Nothing beside the range is touched.
    for (size_t j = end - begin; j < stride; ++j) {
      EXPECT_EQ(present[j], 2);
      for (size_t k = 0; k < 2; ++k) EXPECT_TRUE(std::isnan(residuals[k * stride + j]));
    }
  }
  EXPECT_GT(absent, 10u);
}

TEST(Batch, GivesTheSameResidualsWithoutJacobiansAndFromPointers) {
  const MixedProblem mixed;
  const ResidualBatch& batch = *mixed.problem.batches()[0];
  for (size_t i = 0; i < batch.size(); ++i) {
    double with[2], without[2], jacobian[6];
    bool present_with = false, present_without = false;
    ResidualPanel panel;
    panel.residuals = with;
    panel.jacobians[1] = jacobian;
    panel.present = &present_with;
    batch.Evaluate(i, i + 1, mixed.problem.Reader(), panel);
    const double* slots[] = {mixed.problem.values(batch.block(i, 0)),
                             mixed.problem.values(batch.block(i, 1))};
    panel = {};
    panel.residuals = without;
    panel.present = &present_without;
    batch.Evaluate(i, i + 1, ParameterReader(slots), panel);
    EXPECT_EQ(present_with, present_without);
    EXPECT_EQ(with[0], without[0]);
    EXPECT_EQ(with[1], without[1]);
  }
}

// Poses of 6, a group of 3, points of 3; residuals of one dimension whose terms are by name.
struct StructureProblem {
  Problem problem;
  std::vector<BlockId> poses, points;

  StructureProblem(int num_poses, int num_points) {
    for (int i = 0; i < num_poses; ++i)
      poses.push_back(AddScalars(&problem, "pose", BlockRole::kPose, std::vector<double>(6)));
    for (int i = 0; i < num_points; ++i)
      points.push_back(AddScalars(&problem, "point", BlockRole::kFeature, {0, 0, 0}));
  }
  void Couple(const std::string& term, const std::vector<BlockId>& blocks) {
    std::vector<int> sizes;
    for (BlockId id : blocks) sizes.push_back(problem.block(id).manifold->tangent);
    auto batch = SumBatch(term, sizes);
    batch->Add(blocks, 0.0);
    problem.AddBatch(std::move(batch));
  }
  void See(int pose, int point) { Couple("point", {points[point], poses[pose]}); }
};

TEST(ReducedSystem, CouplesPosesThatShareAFeature) {
  StructureProblem p(3, 2);
  p.See(0, 0), p.See(1, 0);  // the first point couples poses 0 and 1, the second 1 and 2
  p.See(1, 1), p.See(2, 1);
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  EXPECT_EQ(system.size, 18u);
  EXPECT_DOUBLE_EQ(system.density, 7.0 / 9.0);
  EXPECT_DOUBLE_EQ(system.pose_density, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(system.pose_density_without_wireframe, 2.0 / 3.0);
}

TEST(ReducedSystem, LeavesOutConstantBlocksAndHeldCoordinates) {
  StructureProblem p(3, 2);
  p.See(0, 0), p.See(1, 0), p.See(1, 1), p.See(2, 1);
  p.problem.block(p.poses[0]).constant = true;
  p.problem.block(p.poses[1]).held = 1u << 3;
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  EXPECT_EQ(system.size, 11u);
  EXPECT_DOUBLE_EQ(system.density, 1.0);
  EXPECT_DOUBLE_EQ(system.pose_density, 1.0);
}

TEST(ReducedSystem, LetsAConstantFeatureCoupleNothing) {
  StructureProblem p(2, 1);
  p.See(0, 0), p.See(1, 0);
  p.problem.block(p.points[0]).constant = true;
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  EXPECT_EQ(system.size, 12u);
  EXPECT_DOUBLE_EQ(system.density, 0.5);
  EXPECT_DOUBLE_EQ(system.pose_density, 0.0);
}

TEST(ReducedSystem, TellsWhatTheWireframeAdds) {
  StructureProblem p(4, 2);
  p.See(0, 0), p.See(1, 0), p.See(2, 1), p.See(3, 1);
  p.Couple("wireframe_point", {p.points[0], p.poses[2]});
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  // Of 6 pairs 0-1 and 2-3 without it; 0-2 and 1-2 with it.
  EXPECT_DOUBLE_EQ(system.pose_density_without_wireframe, 2.0 / 6.0);
  EXPECT_DOUBLE_EQ(system.pose_density, 4.0 / 6.0);
  EXPECT_DOUBLE_EQ(system.density, 12.0 / 16.0);
}

TEST(ReducedSystem, HoldsGroupsAndWhatResidualsCoupleDirectly) {
  StructureProblem p(2, 2);
  const BlockId a = AddScalars(&p.problem, "group", BlockRole::kGroup, {0, 0, 0});
  const BlockId b = AddScalars(&p.problem, "group", BlockRole::kGroup, {0, 0, 0});
  p.See(0, 0), p.See(1, 1);
  p.Couple("group_point", {p.points[0], p.poses[0], a});
  p.Couple("relation", {a, b});
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  EXPECT_EQ(system.size, 18u);
  // Diagonal 36 + 36 + 9 + 9, pose 0 with a: 2 * 18, a with b: 2 * 9.
  EXPECT_DOUBLE_EQ(system.density, (90.0 + 36.0 + 18.0) / (18.0 * 18.0));
  EXPECT_DOUBLE_EQ(system.pose_density, 0.0);
}

TEST(ReducedSystem, IsEmptyWhereNothingIsKept) {
  StructureProblem p(1, 1);
  p.See(0, 0);
  p.problem.block(p.poses[0]).constant = true;
  const ReducedSystem system = AnalyseReducedSystem(p.problem);
  EXPECT_EQ(system.size, 0u);
  EXPECT_EQ(system.density, 0.0);
}

}  // namespace
}  // namespace holba
