// SPDX-License-Identifier: BSD-3-Clause
// Laws of the costs (paper, "Group-Induced Reprojection Error"): pixels do not know the scale of
// the scene, and an association weighs as much as its feature is observed (Fisher information).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

class ScaledScene : public testing::TestWithParam<double> {
 protected:
  // With every group type, relations, rigs and distortion; away from any optimum.
  static const Reconstruction& Model() {
    static const Reconstruction model = MakeBundleProblem({.num_images = 20,
                                                           .vps = true,
                                                           .primitives = 1,
                                                           .camera_model = "OPENCV",
                                                           .rig_size = 2})
                                            .perturbed;
    return model;
  }
  static Reconstruction Scaled(double scale) {
    Reconstruction model = Model();
    model.Transform({scale, ExpRotation({0.3, -1.1, 0.4}), scale * Eigen::Vector3d(3, -5, 2)});
    return model;
  }
};

TEST_P(ScaledScene, CostsTheSameInPixels) {
  const Reconstruction scaled = Scaled(GetParam());
  const std::vector<TermCost> before = EvaluateModel(Model()), after = EvaluateModel(scaled);
  ASSERT_EQ(before.size(), 8u);
  for (size_t t = 0; t < before.size(); ++t) {
    EXPECT_GT(before[t].residuals, 0u) << before[t].term;
    EXPECT_EQ(after[t].residuals, before[t].residuals) << before[t].term;
    EXPECT_EQ(after[t].absent, before[t].absent) << before[t].term;
    EXPECT_NEAR(after[t].sum_squares, before[t].sum_squares, 1e-9 * before[t].sum_squares)
        << before[t].term;
  }
}

TEST_P(ScaledScene, CostsTheSquareOfTheScaleIn3d) {
  BundleOptions options = PlainOptions();
  options.group_form = options.wireframe_form = StructureForm::k3d;
  const Reconstruction scaled = Scaled(GetParam());
  const auto before = TermsByName(EvaluateTerms(BuildProblem(Model(), options).problem));
  const auto after = TermsByName(EvaluateTerms(BuildProblem(scaled, options).problem));
  for (const char* term : {"group_point_3d", "group_line_3d", "wireframe_3d"}) {
    const double expected = GetParam() * GetParam() * before.at(term).sum_squares;
    EXPECT_GT(expected, 0.0);
    EXPECT_NEAR(after.at(term).sum_squares, expected, 1e-8 * expected) << term;
  }
  for (const char* term : {"point", "line", "vp", "relation"}) {
    EXPECT_NEAR(after.at(term).sum_squares, before.at(term).sum_squares,
                1e-9 * before.at(term).sum_squares)
        << term;
  }
}

TEST_P(ScaledScene, HasTheSameOptimum) {
  const SyntheticProblem scene = MakeBundleProblem({.num_images = 10, .vps = true});
  Reconstruction model = scene.perturbed, scaled = scene.perturbed;
  scaled.Transform({GetParam(), Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()});
  BundleOptions options = PlainOptions(LossChoice::kCauchy);
  const double cost = AdjustBundle(options, TightSolver(), &model).solver.final_cost;
  const double cost_scaled = AdjustBundle(options, TightSolver(), &scaled).solver.final_cost;
  EXPECT_NEAR(cost_scaled, cost, 1e-8 * cost);
}

INSTANTIATE_TEST_SUITE_P(Scales, ScaledScene, testing::Values(1e-3, 1e3));

// A plane z = 0 held by points that eight cameras see from all sides, and one more member at height
// 0.5 above it, seen by two cameras `baseline` apart that look straight down on it. Returns the
// largest distance that the plane moves over the extent of its members when it (and the points,
// unless held) is adjusted with the cameras held.
double PlaneMotion(double baseline, StructureForm form, bool fix_points) {
  ModelMaker maker;
  std::vector<image_t> around;
  for (int i = 0; i < 8; ++i) {
    around.push_back(
        maker.AddImage({8 * std::cos(M_PI / 4 * i), 8 * std::sin(M_PI / 4 * i), 6}, {0, 0, 0}));
  }
  const image_t a = maker.AddImage({1 - 0.5 * baseline, 1, 10}, {1 - 0.5 * baseline, 1, 0});
  const image_t b = maker.AddImage({1 + 0.5 * baseline, 1, 10}, {1 + 0.5 * baseline, 1, 0});
  maker.Finish();
  Random random(4);
  std::vector<point3D_t> members;
  for (int k = 0; k < 12; ++k) {
    members.push_back(maker.AddPoint({random.Uniform(-2, 2), random.Uniform(-2, 2), 0}, around));
  }
  members.push_back(maker.AddPoint({1, 1, 0.5}, {a, b}));
  const group3D_t plane = maker.AddGroup("PLANE", {0, 0, 1, 0}, members, {});
  BundleOptions options = PlainOptions();
  options.group_form = form;
  options.fix_poses = true;
  options.fix_points = fix_points;
  options.refine_focal_length = options.refine_extra_params = false;
  AdjustBundle(options, TightSolver(), &maker.model);
  const std::vector<double>& p = maker.model.groups3D.at(plane).params;
  double largest = 0.0;
  for (const double x : {-2.0, 2.0}) {
    for (const double y : {-2.0, 2.0}) {
      largest =
          std::max(largest, std::abs((p[0] * x + p[1] * y + p[3]) / p[2]));  // height at (x, y)
    }
  }
  return largest;
}

// Rays that are nearly parallel (0.1 apart at distance 10), and rays that cross at 53 degrees.
constexpr double kPoor = 0.1, kWell = 10.0;

TEST(FisherInformation, LetsAPoorlyObservedMemberHardlyMoveItsPlane) {
  const double poor = PlaneMotion(kPoor, StructureForm::k2d, false),
               well = PlaneMotion(kWell, StructureForm::k2d, false);
  EXPECT_GT(well, 0.01);
  EXPECT_GT(well, 50.0 * poor);
}

TEST(FisherInformation, WeighsAssociationsByViewsAloneWhereDistancesWeighThemAllAlike) {
  // With the points held, only the form of the residual decides.
  const double poor = PlaneMotion(kPoor, StructureForm::k2d, true),
               well = PlaneMotion(kWell, StructureForm::k2d, true);
  EXPECT_GT(well, 50.0 * poor);
  const double poor_3d = PlaneMotion(kPoor, StructureForm::k3d, true),
               well_3d = PlaneMotion(kWell, StructureForm::k3d, true);
  EXPECT_GT(poor_3d, 0.05);
  EXPECT_NEAR(poor_3d, well_3d, 1e-6);
}

}  // namespace
}  // namespace holba
