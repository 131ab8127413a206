// SPDX-License-Identifier: BSD-3-Clause
// From a model to a problem: which residuals there are (docs/FORMAT.md, "Residuals"), which blocks
// move, and that every option acts on what it names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::Pair;
using testing::UnorderedElementsAre;

// Five images around the origin; points and lines on the plane z = 0 and beside it.
struct SmallScene {
  ModelMaker maker;
  std::vector<point3D_t> points;
  std::vector<line3D_t> lines;
  group3D_t vp, plane, sphere, cuboid;

  explicit SmallScene(std::string_view camera_model = "PINHOLE",
                      std::vector<double> params = {700, 720, 500, 480})
      : maker(camera_model, params) {
    for (int i = 0; i < 5; ++i) {
      maker.AddImage({6.0 * std::cos(1.2 * i), 6.0 * std::sin(1.2 * i), 4.0}, {0, 0, 0}, i >= 3);
    }
    maker.Finish();
    points = {maker.AddPoint({0, 0, 0}, {1, 2, 3}), maker.AddPoint({1, 0, 0}, {1, 2}),
              maker.AddPoint({0, 1, 0}, {3, 4, 5, 1}), maker.AddPoint({0.5, 0.5, 1}, {2, 4}),
              maker.AddPoint({-1, 0, 0}, {5})};
    // The first line has two segments in image 1, the last is seen in one image only.
    lines = {maker.AddLine({0, 0, 0}, {1, 0, 0}, {1, 1, 2, 4}),
             maker.AddLine({0, 0, 0}, {0, 1, 0}, {2, 5}),
             maker.AddLine({0.5, 0.5, 0}, {0.5, 0.5, 1}, {1, 3, 4}),
             maker.AddLine({1, 1, 0}, {1.5, 1, 0}, {3, 3})};
    vp = maker.AddGroup("VP", {1, 0, 0}, {}, {lines[0], lines[3]});
    plane = maker.AddGroup("PLANE", {0, 0, 1, 0}, {points[0], points[1], points[2], points[4]},
                           {lines[0], lines[1]});
    sphere = maker.AddGroup("SPHERE", {0.5, 0.5, 0, 1}, {points[3], points[2]}, {});
    cuboid = maker.AddGroup("CUBOID", {1, 0, 0, 0, -2, -2, -2, -2, -2, 0}, {points[0]}, {lines[0]});
    maker.model.relations = {{vp, plane, RelationType::kOrthogonal}};
    // Edges: (points[0], lines[0]), (points[2], lines[1]), (points[3], lines[2]).
    maker.model.wireframe = {
        {points[0], lines[0], 2}, {points[2], lines[1], 1}, {points[3], lines[2], 1}};
    EXPECT_EQ(maker.model.FindInconsistency(), std::nullopt);
  }
  const Reconstruction& model() const { return maker.model; }
};

// Blocks per term as docs/FORMAT.md counts them, spelt out on the tracks above.
constexpr size_t kPointResiduals = 3 + 2 + 4 + 2 + 1;
constexpr size_t kLineResiduals = 4 + 2 + 3 + 2;
constexpr size_t kGroupPointResiduals = (3 + 2 + 4 + 1) + (2 + 4) + 3;  // plane, sphere, cuboid
constexpr size_t kGroupLineResiduals = (4 + 2) + 4;                     // plane, cuboid
constexpr size_t kVpResiduals = 2;
// Of these, the residuals of what a single image sees: points[4], in the plane, and lines[3], in
// the vanishing point. Evaluation counts them, a problem has them only where they are held.
constexpr size_t kSeenOncePoint = 1, kSeenOnceGroupPoint = 1, kSeenOnceVp = 1;
// Segments of the line in images that do not see the point:
// edge 1, point in {1 2 3}, segments in {1 1 2 4}: image 4. Edge 2, point in {3 4 5 1}, segments in
// {2 5}: image 2. Edge 3, point in {2 4}, segments in {1 3 4}: images 1 and 3.
constexpr size_t kWireframePointResiduals = 1 + 1 + 2;
// Observations of the point in images without a segment of the line: {3}, {3 4 1}, {2}.
constexpr size_t kWireframeLineResiduals = 1 + 3 + 1;

TEST(BuildProblem, TakesRecordsInAnyOrderOfTheirIds) {
  const SmallScene scene;
  Reconstruction turned = scene.model();
  const auto turn = [](auto* records) {
    auto reversed = *records;
    reversed.RemoveIf([](auto, const auto&) { return true; });
    for (auto it = records->end(); it != records->begin();) {
      --it;
      reversed.Add(it->first, it->second);
    }
    *records = reversed;
  };
  turn(&turned.points3D);
  turn(&turned.lines3D);
  turn(&turned.groups3D);
  turn(&turned.images);
  ASSERT_GT(turned.points3D.begin()->first, std::next(turned.points3D.begin())->first);
  const auto terms = TermsByName(EvaluateModel(turned));
  for (const auto& [name, term] : TermsByName(EvaluateModel(scene.model()))) {
    EXPECT_EQ(terms.at(name).residuals, term.residuals) << name;
    EXPECT_NEAR(terms.at(name).sum_squares, term.sum_squares, 1e-12 * term.sum_squares) << name;
  }
}

TEST(BuildProblem, HasTheResidualsThatTheFormatCounts) {
  const SmallScene scene;
  const auto terms = TermsByName(EvaluateModel(scene.model()));
  const std::map<std::string, size_t> expected{{"point", kPointResiduals},
                                               {"line", kLineResiduals},
                                               {"group_point", kGroupPointResiduals},
                                               {"group_line", kGroupLineResiduals},
                                               {"vp", kVpResiduals},
                                               {"wireframe_point", kWireframePointResiduals},
                                               {"wireframe_line", kWireframeLineResiduals},
                                               {"relation", 1}};
  ASSERT_EQ(terms.size(), expected.size());
  for (const auto& [name, count] : expected) {
    EXPECT_EQ(terms.at(name).residuals, count) << name;
    EXPECT_EQ(terms.at(name).absent, 0u) << name;
  }
}

TEST(BuildProblem, CountsPointsOfStructureInATermOfTheirOwn) {
  Reconstruction model = SmallScene().model();
  Point3D& point = model.points3D.begin()->second;
  const size_t observations = point.track.size();
  point.origin = PointOrigin::kJunction;
  const BundleProblem bundle = BuildProblem(model, BundleOptions());
  std::map<std::string, size_t> counts;
  for (const auto& batch : bundle.problem.batches()) counts[batch->term()] += batch->size();
  EXPECT_EQ(counts.at("structure_point"), observations);
  EXPECT_EQ(counts.at("point"), kPointResiduals - kSeenOncePoint - observations);
}

TEST(BuildProblem, HasNoCostWhereTheModelIsExact) {
  const SmallScene scene;
  for (const TermCost& term : EvaluateModel(scene.model())) {
    // points[2] lies on the sphere? |(0, 1, 0) - (0.5, 0.5, 0)| = 0.707: it does not.
    if (term.term == "group_point") {
      EXPECT_GT(term.sum_squares, 1.0);
    } else {
      EXPECT_LT(term.sum_squares, 1e-18) << term.term;
    }
  }
}

TEST(BuildProblem, CountsASecondSegmentOfAnImageInEveryTermOfTheLine) {
  SmallScene scene;
  // A third segment of line 0 in image 4, which does not see points[0].
  Line3D& line = scene.maker.model.lines3D.at(scene.lines[0]);
  auto& lines2D = scene.maker.model.images.at(4).lines2D;
  line.track.push_back({4, static_cast<line2D_t>(lines2D.size())});
  lines2D.push_back(lines2D[0]);
  ASSERT_EQ(scene.model().FindInconsistency(), std::nullopt);
  const auto terms = TermsByName(EvaluateModel(scene.model()));
  EXPECT_EQ(terms.at("line").residuals, kLineResiduals + 1);
  EXPECT_EQ(terms.at("group_line").residuals, kGroupLineResiduals + 2)
      << "of the plane and the cuboid";
  EXPECT_EQ(terms.at("wireframe_point").residuals, kWireframePointResiduals + 1);
  EXPECT_EQ(terms.at("wireframe_line").residuals, kWireframeLineResiduals);
  EXPECT_EQ(terms.at("vp").residuals, kVpResiduals);
}

TEST(BuildProblem, OmitsIncidencesWhereBothAreObserved) {
  // A point and a line that are seen by the same images.
  ModelMaker maker;
  for (int i = 0; i < 3; ++i) maker.AddImage({2.0 * i, -6, 1}, {0, 0, 0});
  maker.Finish();
  const point3D_t point = maker.AddPoint({0, 0, 0}, {1, 2, 3});
  const line3D_t line = maker.AddLine({0, 0, 0}, {0, 0, 1}, {3, 2, 1, 1});
  maker.model.wireframe = {{point, line, 3}};
  const auto terms = TermsByName(EvaluateModel(maker.model));
  EXPECT_EQ(terms.at("wireframe_point").residuals, 0u);
  EXPECT_EQ(terms.at("wireframe_line").residuals, 0u);
}

std::set<std::string> TermsOf(const BundleOptions& options) {
  const SmallScene scene;
  std::set<std::string> names;
  const BundleProblem bundle = BuildProblem(scene.model(), options);
  for (const auto& batch : bundle.problem.batches()) names.insert(batch->term());
  return names;
}

TEST(Configurations, AddToTheOnesBefore) {
  BundleOptions options;
  options.config = BundleConfig::kPoint;
  EXPECT_THAT(TermsOf(options), UnorderedElementsAre("point"));
  options.config = BundleConfig::kPointLine;
  EXPECT_THAT(TermsOf(options), UnorderedElementsAre("point", "line"));
  options.config = BundleConfig::kGroups;
  EXPECT_THAT(TermsOf(options),
              UnorderedElementsAre("point", "line", "group_point", "group_line", "vp", "relation"));
  options.config = BundleConfig::kHolistic;
  EXPECT_THAT(TermsOf(options),
              UnorderedElementsAre("point", "line", "group_point", "group_line", "vp", "relation",
                                   "wireframe_point", "wireframe_line"));
}

TEST(StructureForms, ReplaceTheirTermsOnly) {
  BundleOptions options;
  options.group_form = StructureForm::k3d;
  EXPECT_THAT(TermsOf(options),
              UnorderedElementsAre("point", "line", "group_point_3d", "group_line_3d", "vp",
                                   "relation", "wireframe_point", "wireframe_line"));
  options = {};
  options.wireframe_form = StructureForm::k3d;
  EXPECT_THAT(TermsOf(options), UnorderedElementsAre("point", "line", "group_point", "group_line",
                                                     "vp", "relation", "wireframe_3d"));
  const SmallScene scene;
  const auto terms = TermsByName(EvaluateTerms(BuildProblem(scene.model(), options).problem));
  EXPECT_EQ(terms.at("wireframe_3d").residuals, 3u) << "one for each edge";
}

TEST(StructureForms, In3dHaveTheirOwnWeightsAndNoLoss) {
  BundleOptions options;
  options.group_form = options.wireframe_form = StructureForm::k3d;
  options.group_3d_weight = 11.0;
  options.wireframe_3d_weight = 13.0;
  const SmallScene scene;
  const BundleProblem bundle = BuildProblem(scene.model(), options);
  size_t reached = 0;
  for (const auto& batch : bundle.problem.batches()) {
    if (!batch->term().ends_with("_3d")) continue;
    ++reached;
    EXPECT_EQ(batch->weight, batch->term() == "wireframe_3d" ? 13.0 : 11.0) << batch->term();
    EXPECT_EQ(batch->loss.type, LossType::kTrivial) << batch->term();
  }
  EXPECT_GE(reached, 3u);
}

TEST(StructureForms, OfTheWireframeIn3dKeepItsLines) {
  BundleOptions options;
  options.wireframe_form = StructureForm::k3d;
  const SmallScene scene;
  const BundleProblem bundle = BuildProblem(scene.model(), options);
  std::set<line3D_t> kept;
  for (const auto& [id, block] : bundle.lines) {
    if (IsKept(bundle.problem.block(block).role)) kept.insert(id);
  }
  EXPECT_THAT(kept, UnorderedElementsAre(scene.lines[0], scene.lines[1], scene.lines[2]));
  EXPECT_GT(AnalyseReducedSystem(bundle.problem).size,
            AnalyseReducedSystem(BuildProblem(scene.model(), {}).problem).size);
}

// Free tangent coordinates by kind of block.
std::map<std::string, int> FreeByKind(const BundleProblem& bundle) {
  std::map<std::string, int> free;
  const Problem& problem = bundle.problem;
  for (const auto& [id, block] : bundle.poses) free["pose"] += problem.block(block).FreeTangent();
  for (const auto& [id, block] : bundle.cameras)
    free["camera"] += problem.block(block).FreeTangent();
  for (const auto& [id, block] : bundle.points) free["point"] += problem.block(block).FreeTangent();
  for (const auto& [id, block] : bundle.lines) free["line"] += problem.block(block).FreeTangent();
  for (const auto& [id, block] : bundle.groups) free["group"] += problem.block(block).FreeTangent();
  return free;
}

constexpr int kGroupTangents = 2 + 3 + 4 + 9;

TEST(Gauge, HoldsSevenCoordinatesOfPosesOrNone) {
  const SmallScene scene;
  BundleOptions options;
  EXPECT_THAT(FreeByKind(BuildProblem(scene.model(), options)),
              UnorderedElementsAre(Pair("pose", 5 * 6 - 7), Pair("camera", 3 * 2),
                                   // The last point and the last line are seen by one image only.
                                   Pair("point", 4 * 3), Pair("line", 3 * 4),
                                   Pair("group", kGroupTangents)));
  options.gauge = Gauge::kFree;
  EXPECT_EQ(FreeByKind(BuildProblem(scene.model(), options)).at("pose"), 5 * 6);
}

TEST(Gauge, HoldsTheTranslationThatGrowsWithTheSceneMost) {
  const SmallScene scene;
  const BundleProblem bundle = BuildProblem(scene.model(), {});
  EXPECT_TRUE(bundle.problem.block(bundle.poses[0].second).constant);
  // The held coordinate must change when everything is scaled about the first camera.
  int held_blocks = 0;
  for (const auto& [frame_id, block] : bundle.poses) {
    const uint32_t held = bundle.problem.block(block).held;
    if (held == 0) continue;
    ++held_blocks;
    int coordinate = 0;
    while (held != (1u << (3 + coordinate))) ASSERT_LT(++coordinate, 3);
    Reconstruction scaled = scene.model();
    const Eigen::Vector3d centre = scaled.CameraCentre(1);
    scaled.Transform({2.0, Eigen::Quaterniond::Identity(), -centre});
    EXPECT_NEAR((scaled.frames.at(1).rig_from_world.rotation.normalized().conjugate() *
                 scaled.frames.at(1).rig_from_world.translation)
                    .norm(),
                centre.norm(), 1e-9)
        << "the first camera stays";
    const Eigen::Vector3d moved = scaled.frames.at(frame_id).rig_from_world.translation -
                                  scene.model().frames.at(frame_id).rig_from_world.translation;
    EXPECT_EQ(std::abs(moved[coordinate]), moved.cwiseAbs().maxCoeff());
    EXPECT_GT(std::abs(moved[coordinate]), 1.0);
  }
  EXPECT_EQ(held_blocks, 1);
}

TEST(Gauge, IsLeftToWhatIsFixedAnyway) {
  const SmallScene scene;
  BundleOptions options;
  options.fix_points = true;
  EXPECT_EQ(FreeByKind(BuildProblem(scene.model(), options)).at("pose"), 5 * 6);
  options = {};
  options.fix_poses = true;
  EXPECT_EQ(FreeByKind(BuildProblem(scene.model(), options)).at("pose"), 0);
}

TEST(FixOptions, HoldWhatTheyName) {
  const SmallScene scene;
  const auto with = [&](bool BundleOptions::*fix) {
    BundleOptions options;
    options.gauge = Gauge::kFree;
    if (fix) options.*fix = true;
    return FreeByKind(BuildProblem(scene.model(), options));
  };
  const auto none = with(nullptr);
  const std::map<std::string, bool BundleOptions::*> fixes{{"pose", &BundleOptions::fix_poses},
                                                           {"point", &BundleOptions::fix_points},
                                                           {"line", &BundleOptions::fix_lines},
                                                           {"group", &BundleOptions::fix_groups}};
  for (const auto& [kind, fix] : fixes) {
    for (const auto& [other, free] : with(fix)) {
      EXPECT_EQ(free, other == kind ? 0 : none.at(other)) << "with fixed " << kind << ": " << other;
    }
  }
}

TEST(RefineOptions, ReleaseTheirIntrinsicsOnly) {
  // OPENCV: fx fy cx cy k1 k2 p1 p2.
  const SmallScene scene("OPENCV", {700, 720, 500, 480, -0.05, 0.01, 0.001, -0.0005});
  const auto held = [&](bool focal, bool principal, bool extra) {
    BundleOptions options;
    options.refine_focal_length = focal;
    options.refine_principal_point = principal;
    options.refine_extra_params = extra;
    const BundleProblem bundle = BuildProblem(scene.model(), options);
    const ParameterBlock& block = bundle.problem.block(bundle.cameras[0].second);
    return block.constant ? 0xffu : block.held;
  };
  EXPECT_EQ(held(true, false, true), 0b00001100u) << "COLMAP's defaults";
  EXPECT_EQ(held(true, false, false), 0b11111100u);
  EXPECT_EQ(held(false, true, false), 0b11110011u);
  EXPECT_EQ(held(false, false, true), 0b00001111u);
  EXPECT_EQ(held(true, true, true), 0u);
  EXPECT_EQ(held(false, false, false), 0xffu);
  const BundleOptions defaults;
  EXPECT_TRUE(defaults.refine_focal_length && !defaults.refine_principal_point &&
              defaults.refine_extra_params);
}

TEST(RefineOptions, DoNotChangeTheCost) {
  // Observations of lines that follow the intrinsics start where the fixed ones are.
  SmallScene scene("OPENCV", {700, 720, 500, 480, -0.05, 0.01, 0.001, -0.0005});
  for (auto& [id, point] : scene.maker.model.points3D)
    point.xyz += Eigen::Vector3d(0.02, -0.01, 0.015);
  for (auto& [id, line] : scene.maker.model.lines3D) {
    line.line = PlueckerLine::FromPoints(line.start + Eigen::Vector3d(0.01, 0.02, 0), line.end);
  }
  BundleOptions fixed, free;
  fixed.refine_focal_length = fixed.refine_extra_params = false;
  free.refine_principal_point = true;
  const std::vector<TermCost> a = EvaluateTerms(BuildProblem(scene.model(), fixed).problem);
  const std::vector<TermCost> b = EvaluateTerms(BuildProblem(scene.model(), free).problem);
  ASSERT_EQ(a.size(), b.size());
  for (size_t t = 0; t < a.size(); ++t) {
    EXPECT_EQ(a[t].term, b[t].term);
    EXPECT_NEAR(a[t].sum_squares, b[t].sum_squares, 1e-10 * a[t].sum_squares) << a[t].term;
  }
}

TEST(TermSettings, ReachTheirTermsOnly) {
  const std::map<TermFamily, std::set<std::string>> families{
      {TermFamily::kPoint, {"point"}},
      {TermFamily::kLine, {"line"}},
      {TermFamily::kGroup, {"group_point", "group_line"}},
      {TermFamily::kVp, {"vp"}},
      {TermFamily::kWireframe, {"wireframe_point", "wireframe_line"}},
      {TermFamily::kRelation, {"relation"}},
      {TermFamily::kMeasurement, {"group_measurement"}},
      {TermFamily::kPrior, {"principal_point_prior"}}};
  ASSERT_EQ(families.size(), size_t{kNumTermFamilies});
  const SmallScene scene;
  const std::vector<GroupMeasurement> measurements{{1, scene.vp, {1, 0, 0}, 2.0}};
  const std::map<LossChoice, LossType> losses{{LossChoice::kTrivial, LossType::kTrivial},
                                              {LossChoice::kHuber, LossType::kHuber},
                                              {LossChoice::kSoftL1, LossType::kSoftL1},
                                              {LossChoice::kCauchy, LossType::kCauchy}};
  for (const auto& [family, terms] : families) {
    for (const auto& [choice, type] : losses) {
      BundleOptions options =
          PlainOptions(choice == LossChoice::kTrivial ? LossChoice::kHuber : LossChoice::kTrivial);
      const LossType others =
          choice == LossChoice::kTrivial ? LossType::kHuber : LossType::kTrivial;
      for (TermSettings& settings : options.terms) settings.weight = 1.0;
      options.refine_principal_point = true;
      options.principal_point_sigma = 0.02;
      options[family] = {choice, 0.125, 7.0};
      size_t reached = 0;
      const BundleProblem bundle = BuildProblem(scene.model(), options, measurements);
      for (const auto& batch : bundle.problem.batches()) {
        const bool named = terms.contains(batch->term());
        reached += named;
        EXPECT_EQ(batch->loss.type, named ? type : others) << batch->term();
        EXPECT_EQ(batch->weight, named ? 7.0 : 1.0) << batch->term();
        if (named) {
          EXPECT_EQ(batch->loss.scale, 0.125) << batch->term();
        }
      }
      EXPECT_GT(reached, 0u);
    }
  }
}

TEST(TermSettings, AreThePapersByDefault) {
  BundleOptions options;
  options.SetDefaultLosses(false);
  EXPECT_EQ(options[TermFamily::kPoint].loss, LossChoice::kAuto);
  EXPECT_EQ(options[TermFamily::kLine].loss, LossChoice::kAuto);
  EXPECT_EQ(options[TermFamily::kPoint].weight, 1.0);
  EXPECT_EQ(options[TermFamily::kLine].weight, 1.0);
  for (TermFamily family :
       {TermFamily::kGroup, TermFamily::kVp, TermFamily::kWireframe, TermFamily::kRelation}) {
    EXPECT_EQ(options[family].loss, LossChoice::kCauchy);
  }
  EXPECT_EQ(options[TermFamily::kGroup].weight, 0.5);
  EXPECT_EQ(options[TermFamily::kGroup].loss_scale, 1.0);
  EXPECT_EQ(options[TermFamily::kVp].weight, 5e3);
  EXPECT_EQ(options[TermFamily::kVp].loss_scale, 0.2);
  EXPECT_EQ(options[TermFamily::kWireframe].weight, 0.1);
  EXPECT_EQ(options[TermFamily::kWireframe].loss_scale, 1.0);
  BundleOptions bal;
  bal.SetDefaultLosses(true);
  EXPECT_EQ(bal[TermFamily::kPoint].loss, LossChoice::kTrivial);
}

TEST(AngularTerms, AreThoseWithoutPixels) {
  const SmallScene scene;
  const std::vector<GroupMeasurement> measurements{{1, scene.vp, {1, 0, 0}, 2.0}};
  std::set<std::string> angular;
  const BundleProblem bundle = BuildProblem(scene.model(), {}, measurements);
  for (const auto& batch : bundle.problem.batches()) {
    if (batch->angular) angular.insert(batch->term());
  }
  EXPECT_THAT(angular, UnorderedElementsAre("vp", "relation", "group_measurement"));
}

TEST(AssociationFilter, LeavesOutWhatItHoldsAndNothingElse) {
  const SmallScene scene;
  AssociationFilter filter;
  filter.points = {{scene.plane, scene.points[0]}};    // 3 observations
  filter.lines = {{scene.cuboid, scene.lines[0]}};     // 4 segments
  filter.edges = {{scene.points[3], scene.lines[2]}};  // 2 and 1
  const BundleProblem all = BuildProblem(scene.model(), {}),
                      some = BuildProblem(scene.model(), {}, {}, &filter);
  const auto terms = TermsByName(EvaluateTerms(some.problem));
  EXPECT_EQ(terms.at("group_point").residuals, kGroupPointResiduals - kSeenOnceGroupPoint - 3);
  EXPECT_EQ(terms.at("group_line").residuals, kGroupLineResiduals - 4);
  EXPECT_EQ(terms.at("wireframe_point").residuals, kWireframePointResiduals - 2);
  EXPECT_EQ(terms.at("wireframe_line").residuals, kWireframeLineResiduals - 1);
  EXPECT_EQ(terms.at("vp").residuals, kVpResiduals - kSeenOnceVp);
  EXPECT_EQ(terms.at("relation").residuals, 1u);
  EXPECT_EQ(some.problem.num_blocks(), all.problem.num_blocks());
  EXPECT_EQ(some.problem.state(), all.problem.state());

  filter = {};
  filter.groups = {scene.vp};
  const auto without_vp =
      TermsByName(EvaluateTerms(BuildProblem(scene.model(), {}, {}, &filter).problem));
  EXPECT_FALSE(without_vp.contains("vp"));
  EXPECT_FALSE(without_vp.contains("relation"));
  EXPECT_EQ(without_vp.at("group_point").residuals, kGroupPointResiduals - kSeenOnceGroupPoint);
}

TEST(BuildProblem, SharesPosesOfAFrameAndCamerasOfImages) {
  const SmallScene scene;
  const BundleProblem bundle = BuildProblem(scene.model(), {});
  EXPECT_EQ(bundle.poses.size(), 5u);
  EXPECT_EQ(bundle.cameras.size(), 3u);
  EXPECT_EQ(bundle.points.size(), 4u) << "but for what a single image sees";
  EXPECT_EQ(bundle.lines.size(), 3u);
  EXPECT_EQ(bundle.groups.size(), 4u);
  EXPECT_TRUE(bundle.sensor_poses.empty());
}

TEST(WriteBack, OfAnUnsolvedProblemChangesNothingButRounding) {
  SmallScene scene;
  BundleOptions options;
  options.gauge = Gauge::kFree;
  const Reconstruction before = scene.model();
  WriteBack(BuildProblem(before, options), &scene.maker.model);
  const Reconstruction& after = scene.model();
  for (const auto& [id, point] : before.points3D) EXPECT_EQ(after.points3D.at(id).xyz, point.xyz);
  for (const auto& [id, camera] : before.cameras)
    EXPECT_EQ(after.cameras.at(id).params, camera.params);
  for (const auto& [id, image] : before.images) {
    EXPECT_LT((after.images.at(id).cam_from_world.RotationMatrix() -
               image.cam_from_world.RotationMatrix())
                  .norm(),
              1e-15);
  }
  for (const auto& [id, line] : before.lines3D) {
    const Line3D& other = after.lines3D.at(id);
    EXPECT_LT((other.line.direction - line.line.direction).norm() +
                  (other.line.moment - line.line.moment).norm(),
              1e-14);
    EXPECT_LT((other.start - line.start).norm() + (other.end - line.end).norm(), 1e-14);
  }
  for (const auto& [id, group] : before.groups3D) {
    for (size_t k = 0; k < group.params.size(); ++k)
      EXPECT_NEAR(after.groups3D.at(id).params[k], group.params[k], 1e-14);
  }
}

// Nothing else says where the principal point is but the prior and one observation's worth of points.
TEST(BuildProblem, HoldsPrincipalPointsByWhatIsKnownOfThem) {
  ModelMaker maker;
  for (int i = 0; i < 3; ++i) maker.AddImage({i - 1.0, -6.0, 0.3 * i}, {0, 0, 0});
  for (int i = 0; i < 30; ++i)
    maker.AddPoint({0.3 * (i % 7) - 1, 0.4 * (i % 5), 0.35 * (i % 3)}, {1, 2, 3});
  maker.Finish();
  BundleOptions options = PlainOptions();
  options.fix_poses = options.fix_points = true;
  options.refine_focal_length = false;
  options.refine_principal_point = true;
  options.principal_point_sigma = 0.01;
  const BundleProblem free = BuildProblem(maker.model, options);
  const auto prior = [](const BundleProblem& bundle) -> const TermCost* {
    static std::vector<TermCost> terms;
    terms = EvaluateTerms(bundle.problem);
    for (const TermCost& term : terms) {
      if (term.term == "principal_point_prior") return &term;
    }
    return nullptr;
  };
  ASSERT_NE(prior(free), nullptr);
  EXPECT_EQ(prior(free)->residuals, 1u);
  EXPECT_EQ(prior(free)->cost, 0.0);
  // 5 px of 1000 and 480 px of 960, in standard deviations of 1 %.
  options.known_principal_points_px[1] = {505, 0};
  EXPECT_NEAR(prior(BuildProblem(maker.model, options))->sum_squares, 0.25 + 2500.0, 1e-9);
  options.refine_principal_point = false;
  EXPECT_EQ(prior(BuildProblem(maker.model, options)), nullptr);

  // In an adjustment of known points, 60 equations of noise 1 px against 10 px.
  options.refine_principal_point = true;
  options.known_principal_points_px[1] = {510, 480};
  for (const Backend backend : {Backend::kNative, Backend::kCeres}) {
    Reconstruction model = maker.model;
    SolverOptions solver = TightSolver();
    solver.backend = backend;
    AdjustBundle(options, solver, &model);
    // (90 * 0 + 10 / 10^2) / (90 + 1 / 10^2) with 90 observations.
    EXPECT_NEAR(model.cameras.at(1).params[2], 500.0 + 0.1 / 90.01, 1e-9);
  }
}

}  // namespace
}  // namespace holba
