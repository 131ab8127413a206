// SPDX-License-Identifier: BSD-3-Clause
// AdjustBundle on synthetic scenes: near the truth, the same from all files and threads, what is
// held keeps its bits, measurements pull, and wrong associations do little harm.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "holba/base/random.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/geometry/angle.h"
#include "holba/io/model_io.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

double Rms(const TermCost& term) {
  return std::sqrt(term.sum_squares /
                   static_cast<double>(std::max<size_t>(1, term.residuals - term.absent)));
}

GroundTruthErrors Errors(const Reconstruction& model, const Reconstruction& truth) {
  const auto errors = CompareToTruth(model, truth);
  EXPECT_TRUE(errors);
  return *errors;
}

struct ConvergenceCase {
  const char* name;
  BundleProblemOptions scene;
  bool gate;
};

class Convergence : public testing::TestWithParam<ConvergenceCase> {};

TEST_P(Convergence, EndsNearTheTruth) {
  const SyntheticProblem scene = MakeBundleProblem(GetParam().scene);
  Reconstruction model = scene.perturbed;
  BundleOptions options;
  options.gate = GetParam().gate;
  const BundleSummary summary = AdjustBundle(options, {}, &model);
  EXPECT_EQ(summary.solver.stop_reason, StopReason::kConverged);
  EXPECT_LT(summary.solver.final_cost, 0.2 * summary.solver.initial_cost);
  const GroundTruthErrors before = Errors(scene.perturbed, scene.truth),
                          after = Errors(model, scene.truth);
  // 1 px of noise at f = 700 px and 10 units of distance, some 50 observations per image.
  EXPECT_LT(after.rotation_deg->rms, 0.15) << "before: " << before.rotation_deg->rms;
  EXPECT_LT(after.position->rms, 0.04) << "before: " << before.position->rms;
  EXPECT_LT(after.point->median, 0.04) << "before: " << before.point->median;
  EXPECT_LT(after.line_direction_deg->median, 1.5);
  EXPECT_LT(after.plane_normal_deg->median, 1.5);
  const auto terms = TermsByName(EvaluateModel(model));
  EXPECT_LT(Rms(terms.at("point")), 1.5);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, Convergence,
    testing::Values(ConvergenceCase{"plain", {.num_images = 20}, false},
                    ConvergenceCase{"gated", {.num_images = 20, .vps = true}, true},
                    ConvergenceCase{"rigs_opencv",
                                    {.num_images = 20,
                                     .vps = true,
                                     .primitives = 1,
                                     .camera_model = "OPENCV",
                                     .rig_size = 2},
                                    false},
                    ConvergenceCase{
                        "fisheye_gated",
                        {.num_images = 20, .vps = true, .camera_model = "OPENCV_FISHEYE"},
                        true}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(Intrinsics, OfADistortedRigAreFoundAgain) {
  // Free focal lengths and distortion of two cameras in rigs, with all of the holistic model.
  const SyntheticProblem scene = MakeBundleProblem({.num_images = 20,
                                                    .observation_noise_px = 0.3,
                                                    .vps = true,
                                                    .camera_model = "OPENCV",
                                                    .rig_size = 2});
  Reconstruction model = scene.perturbed;
  for (auto& [id, camera] : model.cameras) {
    camera.params[0] *= 1.01;
    camera.params[1] *= 0.99;
    for (size_t k = 4; k < 8; ++k) camera.params[k] += 0.003;
  }
  AdjustBundle({}, {}, &model);
  for (const auto& [id, camera] : model.cameras) {
    const std::vector<double>& truth = scene.truth.cameras.at(id).params;
    for (int k : {2, 3}) EXPECT_EQ(camera.params[k], truth[k]) << "principal points are held";
    // Rays over the seen part of the image (22 degrees around the axis) meet the same pixels; at
    // the start they missed them by 3.
    for (double angle = 0.0; angle < 6.28; angle += 0.3) {
      for (const double radius : {0.1, 0.2, 0.3, 0.4}) {
        Eigen::Vector2d found, expected;
        const Eigen::Vector3d ray(radius * std::cos(angle), radius * std::sin(angle), 1.0);
        ASSERT_TRUE(camera.model->project(camera.params.data(), ray, &found));
        ASSERT_TRUE(camera.model->project(truth.data(), ray, &expected));
        EXPECT_LT((found - expected).norm(), 0.6) << "camera " << id << ", " << ray.transpose();
      }
    }
  }
  EXPECT_LT(Errors(model, scene.truth).rotation_deg->rms, 0.05);
}

const SyntheticProblem& SmallScene() {
  static const SyntheticProblem scene =
      MakeBundleProblem({.num_images = 10, .vps = true, .primitives = 1});
  return scene;
}

// Without primitives: smaller.
const SyntheticProblem& PlaneScene() {
  static const SyntheticProblem scene = MakeBundleProblem({.num_images = 10, .vps = true});
  return scene;
}

TEST(Optimum, IsTheSameFromTextAndBinaryFiles) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / "holba_adjust_synthetic";
  WriteModel(SmallScene().perturbed, folder / "txt", ModelFormat::kText);
  WriteModel(SmallScene().perturbed, folder / "bin", ModelFormat::kBinary);
  std::vector<Reconstruction> models{ReadModel(folder / "txt"), ReadModel(folder / "bin")};
  std::filesystem::remove_all(folder);
  SolverOptions solver;
  solver.num_threads = 1;
  std::vector<BundleSummary> summaries;
  for (Reconstruction& model : models) summaries.push_back(AdjustBundle({}, solver, &model));
  EXPECT_EQ(summaries[0].solver.final_cost, summaries[1].solver.final_cost);
  EXPECT_EQ(summaries[0].solver.iterations, summaries[1].solver.iterations);
  for (const auto& [id, point] : models[0].points3D)
    EXPECT_EQ(models[1].points3D.at(id).xyz, point.xyz);
  for (const auto& [id, group] : models[0].groups3D)
    EXPECT_EQ(models[1].groups3D.at(id).params, group.params);
  for (const auto& [id, frame] : models[0].frames) {
    EXPECT_EQ(models[1].frames.at(id).rig_from_world.rotation.coeffs(),
              frame.rig_from_world.rotation.coeffs());
    EXPECT_EQ(models[1].frames.at(id).rig_from_world.translation, frame.rig_from_world.translation);
  }
}

TEST(Optimum, IsTheSameForOneTwoAndFourThreads) {
  std::vector<double> costs;
  for (const int num_threads : {1, 2, 4}) {
    Reconstruction model = PlaneScene().perturbed;
    SolverOptions solver = TightSolver();
    solver.num_threads = num_threads;
    costs.push_back(
        AdjustBundle(PlainOptions(LossChoice::kCauchy), solver, &model).solver.final_cost);
  }
  EXPECT_NEAR(costs[1], costs[0], 1e-8 * costs[0]);
  EXPECT_NEAR(costs[2], costs[0], 1e-8 * costs[0]);
}

TEST(Optimum, RepeatsBitForBitWithOneThread) {
  SolverOptions solver;
  solver.num_threads = 1;
  Reconstruction a = PlaneScene().perturbed, b = PlaneScene().perturbed;
  const double cost_a = AdjustBundle({}, solver, &a).solver.final_cost;
  const double cost_b = AdjustBundle({}, solver, &b).solver.final_cost;
  EXPECT_EQ(cost_a, cost_b);
  for (const auto& [id, point] : a.points3D) EXPECT_EQ(b.points3D.at(id).xyz, point.xyz);
}

template <typename T>
bool SameBits(const T& a, const T& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(*a.data())) == 0;
}

struct Moved {
  bool poses = false, cameras = false, points = false, lines = false, groups = false;
};

// What differs in any bit.
Moved Compare(const Reconstruction& a, const Reconstruction& b) {
  Moved moved;
  for (const auto& [id, frame] : a.frames) {
    const Rigid3d& other = b.frames.at(id).rig_from_world;
    moved.poses |= !SameBits(frame.rig_from_world.rotation.coeffs(), other.rotation.coeffs());
    moved.poses |= !SameBits(frame.rig_from_world.translation, other.translation);
  }
  for (const auto& [id, camera] : a.cameras)
    moved.cameras |= !SameBits(camera.params, b.cameras.at(id).params);
  for (const auto& [id, point] : a.points3D)
    moved.points |= !SameBits(point.xyz, b.points3D.at(id).xyz);
  for (const auto& [id, line] : a.lines3D) {
    const Line3D& other = b.lines3D.at(id);
    moved.lines |= !SameBits(line.line.direction, other.line.direction) ||
                   !SameBits(line.line.moment, other.line.moment) ||
                   !SameBits(line.start, other.start) || !SameBits(line.end, other.end);
  }
  for (const auto& [id, group] : a.groups3D)
    moved.groups |= !SameBits(group.params, b.groups3D.at(id).params);
  return moved;
}

class HeldParts : public testing::TestWithParam<bool> {};

TEST_P(HeldParts, KeepTheirBitsAndTheOthersMove) {
  const Reconstruction& start = PlaneScene().perturbed;
  const auto adjust = [&](auto change) {
    BundleOptions options;
    options.gate = GetParam();
    change(&options);
    SolverOptions solver;
    solver.num_threads = 1;
    solver.max_num_iterations = 3;
    Reconstruction model = start;
    AdjustBundle(options, solver, &model);
    return Compare(start, model);
  };
  Moved moved = adjust([](BundleOptions*) {});
  EXPECT_TRUE(moved.poses && moved.cameras && moved.points && moved.lines && moved.groups);
  moved = adjust([](BundleOptions* o) { o->fix_poses = true; });
  EXPECT_TRUE(!moved.poses && moved.cameras && moved.points && moved.lines && moved.groups);
  moved = adjust([](BundleOptions* o) { o->fix_points = true; });
  EXPECT_TRUE(moved.poses && moved.cameras && !moved.points && moved.lines && moved.groups);
  moved = adjust([](BundleOptions* o) { o->fix_lines = true; });
  EXPECT_TRUE(moved.poses && moved.cameras && moved.points && !moved.lines && moved.groups);
  moved = adjust([](BundleOptions* o) { o->fix_groups = true; });
  EXPECT_TRUE(moved.poses && moved.cameras && moved.points && moved.lines && !moved.groups);
  moved = adjust([](BundleOptions* o) { o->refine_focal_length = o->refine_extra_params = false; });
  EXPECT_TRUE(moved.poses && !moved.cameras && moved.points && moved.lines && moved.groups);
  moved =
      adjust([](BundleOptions* o) { o->config = BundleConfig::kPoint, o->refit_others = false; });
  EXPECT_TRUE(moved.poses && moved.cameras && moved.points && !moved.lines && !moved.groups);
  moved = adjust(
      [](BundleOptions* o) { o->config = BundleConfig::kPointLine, o->refit_others = false; });
  EXPECT_TRUE(moved.poses && moved.cameras && moved.points && moved.lines && !moved.groups);
  moved = adjust([](BundleOptions* o) {
    o->fix_poses = o->fix_points = o->fix_lines = o->fix_groups = true;
    o->refine_focal_length = o->refine_extra_params = false;
  });
  EXPECT_FALSE(moved.poses || moved.cameras || moved.points || moved.lines || moved.groups);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutGate, HeldParts, testing::Bool(),
                         [](const auto& info) { return info.param ? "gate" : "plain"; });

TEST(RefitOthers, EstimatesWhatTheConfigurationLeavesOut) {
  Reconstruction model = PlaneScene().perturbed;
  BundleOptions options;
  options.config = BundleConfig::kPoint;
  AdjustBundle(options, {}, &model);
  const GroundTruthErrors before = Errors(PlaneScene().perturbed, PlaneScene().truth),
                          after = Errors(model, PlaneScene().truth);
  EXPECT_LT(after.line_direction_deg->median, 0.5 * before.line_direction_deg->median);
  const auto terms = TermsByName(EvaluateModel(model));
  EXPECT_LT(Rms(terms.at("line")), 3.0);
}

TEST(Weights, OfAnglesFollowTheMeasuredNoise) {
  for (const double noise_px : {0.3, 1.0}) {
    Reconstruction model =
        MakeBundleProblem({.num_images = 20, .observation_noise_px = noise_px, .vps = true})
            .perturbed;
    const double factor = AdjustBundle({}, {}, &model).angular_weight_factor;
    // Residuals are smaller than the noise: each point is fitted to its 4 to 8 observations.
    EXPECT_GT(factor, 0.4 * noise_px * noise_px);
    EXPECT_LT(factor, noise_px * noise_px);
  }
  // Nothing is measured: the weights are as given.
  Reconstruction model = PlaneScene().perturbed;
  EXPECT_EQ(AdjustBundle(PlainOptions(), {}, &model).angular_weight_factor, 1.0);
}

TEST(Weights, OfZeroAreAsIfTheTermWereNotThere) {
  // Weight 0 of all structure: cameras, points and lines end where they end without it.
  BundleOptions plain = PlainOptions(LossChoice::kCauchy), weightless = plain;
  plain.config = BundleConfig::kPointLine;
  for (TermFamily family :
       {TermFamily::kGroup, TermFamily::kVp, TermFamily::kWireframe, TermFamily::kRelation}) {
    weightless[family].weight = 0.0;
  }
  Reconstruction a = PlaneScene().perturbed, b = PlaneScene().perturbed;
  const SolverSummary solved_a = AdjustBundle(plain, TightSolver(), &a).solver;
  const SolverSummary solved_b = AdjustBundle(weightless, TightSolver(), &b).solver;
  EXPECT_NEAR(solved_b.final_cost, solved_a.final_cost, 1e-8 * solved_a.final_cost);
  for (const TermCost& term : solved_b.final_terms) {
    if (term.term != "point" && term.term != "line") {
      EXPECT_EQ(term.cost, 0.0) << term.term;
    }
  }
}

TEST(Weights, TradeOneTermForAnother) {
  double last_group = HUGE_VAL, last_point = 0.0;
  for (const double weight : {0.01, 0.5, 50.0}) {
    BundleOptions options = PlainOptions();
    options[TermFamily::kGroup].weight = weight;
    Reconstruction model = PlaneScene().perturbed;
    const auto terms = TermsByName(AdjustBundle(options, TightSolver(), &model).solver.final_terms);
    EXPECT_LT(terms.at("group_point").sum_squares, last_group) << weight;
    EXPECT_GT(terms.at("point").sum_squares, last_point) << weight;
    last_group = terms.at("group_point").sum_squares;
    last_point = terms.at("point").sum_squares;
  }
}

TEST(Losses, OfEachKindReachAnOptimumOfTheirOwn) {
  std::set<double> costs;
  for (const LossChoice choice :
       {LossChoice::kTrivial, LossChoice::kHuber, LossChoice::kSoftL1, LossChoice::kCauchy}) {
    Reconstruction model = PlaneScene().perturbed;
    BundleOptions options = PlainOptions();
    options[TermFamily::kPoint].loss = choice;
    const BundleSummary summary = AdjustBundle(options, {}, &model);
    EXPECT_EQ(summary.solver.stop_reason, StopReason::kConverged);
    EXPECT_TRUE(summary.auto_scales.empty());
    costs.insert(summary.solver.final_cost);
  }
  EXPECT_EQ(costs.size(), 4u);
}

TEST(Losses, AutoMeasureTheNoiseThatWasPutIn) {
  for (const double noise_px : {0.3, 1.0}) {
    Reconstruction model =
        MakeBundleProblem({.num_images = 20, .observation_noise_px = noise_px}).perturbed;
    BundleOptions options;
    options.config = BundleConfig::kPointLine;
    const BundleSummary summary = AdjustBundle(options, {}, &model);
    // Residuals are smaller than the noise: six observations and more carry three unknowns and a
    // part of a pose.
    EXPECT_NEAR(summary.auto_sigmas.at("point"), 0.8 * noise_px, 0.15 * noise_px);
    EXPECT_NEAR(summary.auto_scales.at("point"), 2.0 * summary.auto_sigmas.at("point"),
                0.05 * noise_px);
    EXPECT_TRUE(summary.auto_sigmas.contains("line"));
  }
}

// Every third point is seen four times as badly as the others, and is declared to be of structure.
TEST(StructurePoints, AreWeighedByTheirOwnNoise) {
  SyntheticProblem scene = MakeBundleProblem({.seed = 3, .num_images = 20});
  BundleOptions options;
  Random random(5);
  for (auto& [id, point] : scene.perturbed.points3D) {
    if (id % 3 != 0) continue;
    point.origin = PointOrigin::kCorner;
    for (const PointObservation& o : point.track) {
      Eigen::Vector2d& xy = scene.perturbed.images.at(o.image_id).points2D[o.point2D_idx].xy;
      const double dx = random.Normal(4.0), dy = random.Normal(4.0);
      xy += Eigen::Vector2d(dx, dy);
    }
  }
  options.config = BundleConfig::kPointLine;
  Reconstruction aware = scene.perturbed, unaware = scene.perturbed;
  const BundleSummary summary = AdjustBundle(options, {}, &aware);
  EXPECT_NEAR(summary.auto_sigmas.at("structure_point"), 4.1 * summary.auto_sigmas.at("point"),
              0.8 * summary.auto_sigmas.at("point"));
  EXPECT_NEAR(summary.structure_point_weight_factor, 1.0 / (4.1 * 4.1), 0.03);

  for (auto& [id, point] : unaware.points3D) point.origin = PointOrigin::kDetected;
  const BundleSummary plain = AdjustBundle(options, {}, &unaware);
  EXPECT_EQ(plain.structure_point_weight_factor, 1.0);
  EXPECT_FALSE(plain.auto_sigmas.contains("structure_point"));
  EXPECT_LT(Errors(aware, scene.truth).rotation_deg->rms,
            Errors(unaware, scene.truth).rotation_deg->rms);
}

TEST(Losses, AutoNeedNoAnnealingWhereTheNoiseIsKnown) {
  Reconstruction first = MakeBundleProblem({.seed = 2, .num_images = 20}).perturbed;
  BundleOptions options;
  options.config = BundleConfig::kPoint;
  options.refit_others = false;
  const BundleSummary annealed = AdjustBundle(options, {}, &first);
  Reconstruction again = first;
  const BundleSummary known = AdjustBundle(options, {}, &again, {}, {}, annealed.auto_sigmas);
  EXPECT_EQ(known.rounds, 1);
  EXPECT_LT(known.solver.iterations, annealed.solver.iterations / 4);
  EXPECT_NEAR(known.auto_scales.at("point"), annealed.auto_scales.at("point"),
              0.03 * annealed.auto_scales.at("point"));
  EXPECT_NEAR(known.solver.final_cost, annealed.solver.final_cost,
              0.03 * annealed.solver.final_cost);
}

TEST(Losses, AutoFollowTheirOptions) {
  const auto scale_of = [](double num_sigmas, double min_scale_px) {
    Reconstruction model = PlaneScene().perturbed;
    BundleOptions options;
    options.config = BundleConfig::kPointLine;
    options.refit_others = false;
    options.auto_num_sigmas = num_sigmas;
    options.auto_min_scale_px = min_scale_px;
    const BundleSummary summary = AdjustBundle(options, {}, &model);
    return std::pair(summary.auto_scales.at("point"), summary.auto_sigmas.at("point"));
  };
  const auto [scale, sigma] = scale_of(4.0, 0.05);
  EXPECT_NEAR(scale, 4.0 * sigma, 0.1 * sigma);
  EXPECT_GT(scale, 1.5 * scale_of(2.0, 0.05).first);
  EXPECT_EQ(scale_of(2.0, 20.0).first, 20.0);
}

TEST(Losses, AutoCanBeAskedForByEveryTermOfPixels) {
  Reconstruction model = PlaneScene().perturbed;
  BundleOptions options;
  options[TermFamily::kGroup].loss = options[TermFamily::kWireframe].loss = LossChoice::kAuto;
  const BundleSummary summary = AdjustBundle(options, {}, &model);
  for (const char* term :
       {"point", "line", "group_point", "group_line", "wireframe_point", "wireframe_line"}) {
    ASSERT_TRUE(summary.auto_scales.contains(term)) << term;
    EXPECT_GE(summary.auto_scales.at(term), options.auto_min_scale_px);
  }
  EXPECT_FALSE(summary.auto_scales.contains("vp"));
}

TEST(Measurements, OfAVanishingPointDetermineItWhereNothingElseDoes) {
  for (const bool gate : {false, true}) {
    ModelMaker maker;
    for (int i = 0; i < 4; ++i) maker.AddImage({2.0 * i - 3, -8, 1}, {0, 0, 0});
    maker.Finish();
    for (int k = 0; k < 20; ++k)
      maker.AddPoint({std::sin(k), std::cos(3 * k), std::sin(7 * k)}, {1, 2, 3, 4});
    const group3D_t vp = maker.AddGroup("VP", {1, 0, 0}, {}, {});
    const Eigen::Vector3d direction = Eigen::Vector3d(0.5, 0.1, -0.4).normalized();
    const GroupMeasurement measurement{
        2, vp, maker.model.images.at(2).cam_from_world.RotationMatrix() * -direction, 1.0};
    BundleOptions options = PlainOptions();
    options.gate = gate;
    AdjustBundle(options, TightSolver(), &maker.model, std::array{measurement});
    const Eigen::Map<const Eigen::Vector3d> found(maker.model.groups3D.at(vp).params.data());
    EXPECT_LT(found.cross(direction).norm(), 1e-6)
        << "gate " << gate << ", found " << found.transpose();
  }
}

TEST(Measurements, PullAVanishingPointTowardsThemAsMuchAsTheyAreTrusted) {
  // Cameras are held, or the scene would turn instead.
  BundleOptions options = PlainOptions();
  options.fix_poses = true;
  Reconstruction start = PlaneScene().perturbed;
  AdjustBundle(options, TightSolver(), &start);
  group3D_t vp = kNoId;
  for (const auto& [id, group] : start.groups3D) {
    if (group.type->IsParallelism() && vp == kNoId) vp = id;
  }
  ASSERT_NE(vp, kNoId);
  const Eigen::Vector3d at_start =
      Eigen::Map<const Eigen::Vector3d>(start.groups3D.at(vp).params.data());
  // Five degrees off, in every image.
  const Eigen::Vector3d measured =
      Eigen::AngleAxisd(DegToRad(5.0), TangentBasis(at_start).col(0)) * at_start;
  std::vector<double> away_deg;
  for (const double sigma_deg : {1000.0, 3.0, 1.0, 0.01}) {
    std::vector<GroupMeasurement> measurements;
    for (const auto& [image_id, image] : start.images) {
      measurements.push_back(
          {image_id, vp, image.cam_from_world.RotationMatrix() * measured, sigma_deg});
    }
    Reconstruction model = start;
    const auto terms =
        TermsByName(AdjustBundle(options, TightSolver(), &model, measurements).solver.final_terms);
    EXPECT_EQ(terms.at("group_measurement").residuals, measurements.size());
    const Eigen::Vector3d found =
        Eigen::Map<const Eigen::Vector3d>(model.groups3D.at(vp).params.data());
    away_deg.push_back(RadToDeg(std::asin(found.cross(measured).norm())));
  }
  EXPECT_NEAR(away_deg[0], 5.0, 0.01) << "hardly trusted";
  EXPECT_LT(away_deg[1], 4.99);
  EXPECT_LT(away_deg[2], away_deg[1]);
  EXPECT_LT(away_deg[3], 0.1) << "trusted above all";
}

class WrongAssociationsOf : public testing::TestWithParam<std::tuple<WrongAssociations, double>> {};

TEST_P(WrongAssociationsOf, HardlyHarmWithThePapersWeights) {
  const auto& [kind, fraction] = GetParam();
  const SyntheticProblem scene = MakeBundleProblem({.num_images = 20,
                                                    .fraction_wrong_associations = fraction,
                                                    .wrong_associations = kind,
                                                    .vps = true});
  for (const bool gate : {true, false}) {
    BundleOptions features, holistic;
    features.config = BundleConfig::kPointLine;
    holistic.gate = gate;
    Reconstruction a = scene.perturbed, b = scene.perturbed;
    AdjustBundle(features, {}, &a);
    AdjustBundle(holistic, {}, &b);
    const auto terms_a = TermsByName(EvaluateModel(a)), terms_b = TermsByName(EvaluateModel(b));
    EXPECT_LT(Rms(terms_b.at("point")), (gate ? 1.05 : 1.2) * Rms(terms_a.at("point")))
        << "gate " << gate;
    const GroundTruthErrors errors_a = Errors(a, scene.truth), errors_b = Errors(b, scene.truth);
    EXPECT_LT(errors_b.rotation_deg->rms, (gate ? 1.2 : 1.5) * errors_a.rotation_deg->rms + 0.01)
        << "gate " << gate;
    EXPECT_LT(errors_b.position->rms, (gate ? 1.2 : 1.5) * errors_a.position->rms + 0.002)
        << "gate " << gate;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, WrongAssociationsOf,
                         testing::Combine(testing::Values(WrongAssociations::kRandom,
                                                          WrongAssociations::kNearest),
                                          testing::Values(0.1, 0.3)));

TEST(Summary, ComparesCostsWithTheSameLossesAndAssociations) {
  Reconstruction model = SmallScene().perturbed;
  const BundleSummary summary = AdjustBundle({}, {}, &model);
  ASSERT_EQ(summary.solver.initial_terms.size(), summary.solver.final_terms.size());
  double initial = 0.0, final = 0.0;
  for (size_t t = 0; t < summary.solver.final_terms.size(); ++t) {
    EXPECT_EQ(summary.solver.initial_terms[t].term, summary.solver.final_terms[t].term);
    EXPECT_EQ(summary.solver.initial_terms[t].residuals, summary.solver.final_terms[t].residuals);
    initial += summary.solver.initial_terms[t].cost;
    final += summary.solver.final_terms[t].cost;
  }
  EXPECT_NEAR(summary.solver.initial_cost, initial, 1e-9 * initial);
  EXPECT_NEAR(summary.solver.final_cost, final, 1e-9 * final);
  EXPECT_LT(final, initial);
  EXPECT_GE(summary.rounds, 2);
  EXPECT_EQ(summary.solver.iteration_seconds.size(),
            static_cast<size_t>(summary.solver.iterations));
}

TEST(Caller, CanStopAnAdjustmentAndKeepsWhatWasReached) {
  Reconstruction model = SmallScene().perturbed;
  SolverOptions solver;
  int calls = 0;
  solver.on_iteration = [&](const IterationRecord&) { return ++calls < 4; };
  BundleOptions options = PlainOptions();
  const BundleSummary summary = AdjustBundle(options, solver, &model);
  EXPECT_EQ(summary.solver.stop_reason, StopReason::kCallback);
  EXPECT_EQ(calls, 4);
  EXPECT_LT(summary.solver.final_cost, summary.solver.initial_cost);
  EXPECT_TRUE(Compare(SmallScene().perturbed, model).points);
}

}  // namespace
}  // namespace holba
