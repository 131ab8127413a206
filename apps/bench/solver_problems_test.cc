// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_problems.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "holba/base/error.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/io/bal.h"
#include "holba/solver/solver.h"

namespace holba {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::ThrowsMessage;

SolverProblemOptions Named(std::vector<std::string> names) {
  SolverProblemOptions options;
  options.names = std::move(names);
  options.bundle[TermFamily::kPoint].loss = LossChoice::kTrivial;
  options.bundle.refine_focal_length = options.bundle.refine_extra_params = false;
  return options;
}

SolverProblem Make(SolverProblemOptions options) {
  return SolverProblemSources(options).at(0).make();
}

// 6 cameras in a row, each point seen by three in a row and one that only one sees.
std::filesystem::path WriteSmallBal() {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / "problem-6-9-pre.txt";
  Reconstruction model = Make(Named({"sequence_6"})).start;
  model.cameras.at(1).params[3] = 0.01;
  for (auto& [id, camera] : model.cameras) camera.params[1] = camera.params[2] = 500.0;
  WriteBal(model, path);
  return path;
}

TEST(SolverProblems, NamesWhatItKnowsForAnUnknownName) {
  EXPECT_THAT(
      [] { SolverProblemSources(Named({"rink_100"})); },
      ThrowsMessage<InputError>(testing::AllOf(HasSubstr("rink_100"), HasSubstr("ring_N"))));
  for (const char* bad : {"ring_", "ring_x", "ring_9", "ring_10x", "sequence_3"}) {
    EXPECT_THROW(SolverProblemSources(Named({bad})), InputError) << bad;
  }
}

TEST(SolverProblems, HaveTheImagesOfTheirNames) {
  for (const char* name : {"ring_10", "sequence_10", "collection_10", "random_point_10",
                           "random_holistic_10", "near_point_10", "near_holistic_10"}) {
    const SolverProblem problem = Make(Named({name}));
    EXPECT_EQ(problem.name, name);
    EXPECT_EQ(problem.start.images.size(), 10u);
    EXPECT_EQ(problem.bundle.config, std::string(name).find("holistic") == std::string::npos
                                         ? BundleConfig::kPoint
                                         : BundleConfig::kHolistic);
  }
}

TEST(SolverProblems, GiveEveryImageAnAdjustedCameraIfAskedFor) {
  SolverProblemOptions options = Named({"sequence_8"});
  EXPECT_EQ(
      AnalyseReducedSystem(BuildProblem(Make(options).start, Make(options).bundle).problem).size,
      8u * 6 - 7);
  options.camera_per_image = true;
  // Focal length and one coefficient of distortion more.
  EXPECT_EQ(
      AnalyseReducedSystem(BuildProblem(Make(options).start, Make(options).bundle).problem).size,
      8u * 8 - 7);
}

TEST(SolverProblems, OfGraphsConvergeToTheNoiseOfTheirObservations) {
  for (const char* name : {"sequence_20", "collection_20"}) {
    for (const bool camera_per_image : {false, true}) {
      SolverProblemOptions options = Named({name});
      options.camera_per_image = camera_per_image;
      const SolverProblem problem = Make(options);
      BundleProblem bundle = BuildProblem(problem.start, problem.bundle);
      SolverOptions solver;
      solver.backend = Backend::kCeres;
      const SolverSummary summary = Solve(solver, &bundle.problem);
      const double unknowns = 3.0 * static_cast<double>(problem.start.points3D.size()) +
                              static_cast<double>(AnalyseReducedSystem(bundle.problem).size);
      const double redundancy =
          2.0 * static_cast<double>(bundle.problem.num_residuals()) - unknowns;
      EXPECT_GT(summary.initial_cost, 10.0 * summary.final_cost);
      EXPECT_NEAR(summary.final_cost, 0.5 * redundancy * 0.25, 0.05 * summary.final_cost) << name;
    }
  }
}

TEST(SolverProblems, OfFilesComeWholeAndAsLocalCuts) {
  SolverProblemOptions options = Named({"bal", "local"});
  options.bal_paths = {WriteSmallBal().string()};
  const std::vector<SolverProblemSource> sources = SolverProblemSources(options);
  ASSERT_THAT(sources, SizeIs(2));
  const SolverProblem whole = sources[0].make(), local = sources[1].make();
  EXPECT_EQ(whole.name, "bal_6-9");
  EXPECT_EQ(local.name, "local_6-9");
  EXPECT_FALSE(whole.is_local);
  EXPECT_TRUE(local.is_local);
  EXPECT_EQ(whole.start.images.size(), 6u);
  // All nine parameters of all cameras are free, the gauge too.
  EXPECT_EQ(AnalyseReducedSystem(BuildProblem(whole.start, whole.bundle).problem).size, 54u);
}

TEST(LocalCut, KeepsWhatTwoOfItsImagesSee) {
  const Reconstruction whole = Make(Named({"sequence_20"})).start;
  const Reconstruction cut = LocalCut(whole, 7, 1000000);
  EXPECT_EQ(cut.FindInconsistency(), std::nullopt);
  EXPECT_EQ(cut.images.size(), 7u);
  size_t expected = 0;
  for (const auto& [id, point] : whole.points3D) {
    std::vector<PointObservation> inside;
    for (const PointObservation& o : point.track) {
      if (o.image_id <= 7) inside.push_back(o);
    }
    if (inside.size() < 2) {
      EXPECT_FALSE(cut.points3D.contains(id));
      continue;
    }
    ++expected;
    const Point3D& kept = cut.points3D.at(id);
    EXPECT_EQ(kept.xyz, point.xyz);
    ASSERT_EQ(kept.track.size(), inside.size());
    for (size_t i = 0; i < inside.size(); ++i) {
      EXPECT_EQ(kept.track[i].image_id, inside[i].image_id);
      EXPECT_EQ(cut.images.at(inside[i].image_id).points2D[kept.track[i].point2D_idx].xy,
                whole.images.at(inside[i].image_id).points2D[inside[i].point2D_idx].xy);
    }
  }
  EXPECT_EQ(cut.points3D.size(), expected);
  EXPECT_EQ(LocalCut(whole, 7, 11).points3D.size(), 11u);
}

}  // namespace
}  // namespace holba
