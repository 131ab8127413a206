// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <vector>

#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/sfm/filter_model.h"
#include "holba/sfm/mapper_testing.h"
#include "holba/sfm/refine_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

MapperOptions WithIntrinsicsHeld() {
  MapperOptions options;
  options.structure = MapperStructure::kNone;
  options.global.refine_focal_length = options.global.refine_extra_params = false;
  return options;
}

SolverOptions Threads(int num_threads) {
  SolverOptions solver;
  solver.num_threads = num_threads;
  return solver;
}

Reconstruction Truth(double noise_px) {
  return MakeRefineScene({.noise_px = noise_px, .num_clutter = 0}).house.model;
}

// Largest difference in rotation and in the direction of the baseline over all pairs of images.
struct RelativeErrors {
  double rotation_deg = 0.0, direction_deg = 0.0;
};
RelativeErrors CompareRelativePoses(const Reconstruction& model, const Reconstruction& truth) {
  RelativeErrors errors;
  const auto relative = [](const Reconstruction& of, image_t a, image_t b) {
    return of.images.at(b).cam_from_world * of.images.at(a).cam_from_world.Inverse();
  };
  for (const auto& [a, image1] : model.images) {
    for (const auto& [b, image2] : model.images) {
      if (a >= b) continue;
      const Rigid3d ours = relative(model, a, b), theirs = relative(truth, a, b);
      errors.rotation_deg =
          std::max(errors.rotation_deg, RadToDeg(ours.rotation.angularDistance(theirs.rotation)));
      const Eigen::Vector3d s = ours.translation.normalized(), t = theirs.translation.normalized();
      errors.direction_deg =
          std::max(errors.direction_deg, RadToDeg(std::atan2(s.cross(t).norm(), s.dot(t))));
    }
  }
  return errors;
}

struct Purity {
  size_t num_pure = 0, num_mixed = 0;  // points of one true point, and of several or none
};
Purity PurityOf(const Reconstruction& model, const MappingProblem& problem) {
  Purity purity;
  for (const auto& [id, point] : model.points3D) {
    std::set<point3D_t> of_truth;
    for (const PointObservation& observation : point.track) {
      const auto found = problem.true_point.find({observation.image_id, observation.point2D_idx});
      of_truth.insert(found != problem.true_point.end() ? found->second : kNoId);
    }
    ++(of_truth.size() == 1 && *of_truth.begin() != kNoId ? purity.num_pure : purity.num_mixed);
  }
  return purity;
}

TEST(Mapper, ExactMatchesGiveTheTruthAndEveryTrackWhole) {
  const Reconstruction truth = Truth(0.0);
  const MappingProblem problem = MakeMappingProblem(truth);
  const MapResult result =
      MapImages(WithIntrinsicsHeld(), Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(result.models, SizeIs(1));
  const Reconstruction& model = result.models[0].model;
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_THAT(result.left_out, IsEmpty());
  ASSERT_EQ(model.images.size(), truth.images.size());
  const RelativeErrors errors = CompareRelativePoses(model, truth);
  EXPECT_LT(errors.rotation_deg, 1e-4);
  EXPECT_LT(errors.direction_deg, 1e-3);
  // Every point that three images see, with all of its observations.
  std::map<point3D_t, size_t> length;
  for (const auto& [id, point] : model.points3D) {
    const PointObservation& first = point.track.front();
    length[problem.true_point.at({first.image_id, first.point2D_idx})] = point.track.size();
  }
  EXPECT_EQ(length.size(), model.points3D.size()) << "a true point has two";
  size_t num_expected = 0, num_whole = 0;
  for (const auto& [id, point] : truth.points3D) {
    if (point.track.size() < 3) continue;
    ++num_expected;
    num_whole += length.contains(id) && length.at(id) == point.track.size();
  }
  EXPECT_GT(num_expected, 200u);
  EXPECT_EQ(num_whole, num_expected);
  EXPECT_EQ(PurityOf(model, problem).num_mixed, 0u);
}

TEST(Mapper, WrongMatchesDoNotMixTracksNorMovePoses) {
  const Reconstruction truth = Truth(0.3);
  const MappingProblem clean = MakeMappingProblem(truth),
                       wrong = MakeMappingProblem(truth, {.share_of_wrong_matches = 0.3});
  const MapResult of_clean =
      MapImages(WithIntrinsicsHeld(), Threads(2), clean.input, clean.scene, nullptr);
  const MapResult of_wrong =
      MapImages(WithIntrinsicsHeld(), Threads(2), wrong.input, wrong.scene, nullptr);
  ASSERT_THAT(of_wrong.models, SizeIs(1));
  const Reconstruction& model = of_wrong.models[0].model;
  ASSERT_EQ(model.images.size(), truth.images.size());
  const double clean_deg = CompareRelativePoses(of_clean.models[0].model, truth).rotation_deg;
  EXPECT_LT(CompareRelativePoses(model, truth).rotation_deg, 1.5 * clean_deg + 0.005);
  const Purity purity = PurityOf(model, wrong);
  EXPECT_GT(purity.num_pure, 200u);
  EXPECT_LE(20 * purity.num_mixed, purity.num_pure);
}

TEST(Mapper, TheNumberOfThreadsChangesNoBit) {
  const Reconstruction truth = Truth(0.3);
  const MappingProblem problem = MakeMappingProblem(truth, {.share_of_wrong_matches = 0.3});
  const MapResult one =
      MapImages(WithIntrinsicsHeld(), Threads(1), problem.input, problem.scene, nullptr);
  const MapResult three =
      MapImages(WithIntrinsicsHeld(), Threads(3), problem.input, problem.scene, nullptr);
  const Reconstruction &a = one.models[0].model, &b = three.models[0].model;
  ASSERT_EQ(a.images.size(), b.images.size());
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (size_t i = 0; i < a.points3D.size(); ++i) {
    const auto& [id_a, point_a] = a.points3D.begin()[i];
    const auto& [id_b, point_b] = b.points3D.begin()[i];
    ASSERT_EQ(id_a, id_b);
    ASSERT_EQ(std::memcmp(point_a.xyz.data(), point_b.xyz.data(), 24), 0);
    ASSERT_EQ(point_a.track, point_b.track);
  }
}

TEST(Mapper, AnUnknownFocalLengthIsFound) {
  const Reconstruction truth = Truth(0.1);
  MappingProblem problem = MakeMappingProblem(truth, {.focal_length_is_known = false});
  Camera& camera = problem.scene.cameras.at(1);
  const double focal = camera.params[0];
  camera.params[0] = 1.2 * 800.0;  // what COLMAP assumes: 37 % too long
  camera.params[3] = 0.0;
  MapperOptions options;
  options.structure = MapperStructure::kNone;
  const MapResult result = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(result.models, SizeIs(1));
  EXPECT_EQ(result.models[0].model.images.size(), truth.images.size());
  EXPECT_NEAR(result.models[0].model.cameras.at(1).params[0], focal, 0.01 * focal);
}

TEST(Mapper, PhotographsOfOneCameraAreFoundToBe) {
  const Reconstruction truth = Truth(0.1);
  const double focal = truth.cameras.at(1).params[0];
  const MappingProblem problem =
      MakeMappingProblem(WithOwnCameras(truth), {.focal_length_is_known = false});
  MapperOptions options;
  options.structure = MapperStructure::kNone;
  options.cameras.share_cameras = true;
  const MapResult shared = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(shared.models, SizeIs(1));
  const Reconstruction& model = shared.models[0].model;
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(model.images.size(), truth.images.size());
  std::set<camera_t> cameras;
  for (const auto& [id, image] : model.images) cameras.insert(image.camera_id);
  ASSERT_THAT(cameras, SizeIs(1));
  EXPECT_NEAR(model.cameras.at(*cameras.begin()).params[0], focal, 0.01 * focal);

  options.cameras.share_cameras = false;
  const MapResult apart = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(apart.models, SizeIs(1));
  EXPECT_EQ(apart.models[0].model.cameras.size(), truth.images.size());
}

TEST(Mapper, ImagesThatShareNothingAreTwoModels) {
  const Reconstruction truth = Truth(0.1);
  MappingProblemOptions options;
  for (image_t a = 1; a <= 8; ++a) {
    for (image_t b = a + 1; b <= 8; ++b) {
      if ((a <= 4) != (b <= 4)) options.unmatched.insert({a, b});
    }
  }
  const MappingProblem problem = MakeMappingProblem(truth, options);
  MapperOptions mapper = WithIntrinsicsHeld();
  mapper.min_model_size = 3;
  const MapResult result = MapImages(mapper, Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(result.models, SizeIs(2));
  for (const MappedModel& mapped : result.models) {
    EXPECT_EQ(mapped.model.images.size(), 4u);
    EXPECT_EQ(mapped.model.images.contains(1), mapped.model.images.contains(4));
    EXPECT_NE(mapped.model.images.contains(1), mapped.model.images.contains(5));
  }
  EXPECT_THAT(result.left_out, IsEmpty());
}

TEST(Mapper, AFurtherModelEndsWhereItHasComeIntoAnEarlierOne) {
  // Images 6 to 8 see too little of the model of 1 to 5; 4 and 5 see enough of theirs, and bring
  // the others with them: then the first model is a part of the second.
  const Reconstruction truth = Truth(0.1);
  MappingProblemOptions options;
  for (image_t b = 6; b <= 8; ++b) {
    for (image_t a = 1; a <= 3; ++a) options.unmatched.insert({a, b});
    for (image_t a = 4; a <= 5; ++a) options.max_num_matches[{a, b}] = 14;
  }
  const MappingProblem problem = MakeMappingProblem(truth, options);
  MapperOptions mapper = WithIntrinsicsHeld();
  mapper.min_model_size = 3;
  mapper.registration.structure_less = false;
  const auto sizes = [&](int max_model_overlap) {
    mapper.max_model_overlap = max_model_overlap;
    const MapResult result = MapImages(mapper, Threads(2), problem.input, problem.scene, nullptr);
    std::vector<size_t> images;
    for (const MappedModel& mapped : result.models) images.push_back(mapped.model.images.size());
    return images;
  };
  EXPECT_THAT(sizes(20), ElementsAre(8));
  EXPECT_THAT(sizes(1), ElementsAre(5, 4));
}

TEST(Mapper, AnImageWithoutMatchesIsLeftOutAndSaid) {
  const Reconstruction truth = Truth(0.1);
  MappingProblemOptions options;
  for (image_t a = 1; a < 8; ++a) options.unmatched.insert({a, 8});
  const MappingProblem problem = MakeMappingProblem(truth, options);
  const MapResult result =
      MapImages(WithIntrinsicsHeld(), Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(result.models, SizeIs(1));
  EXPECT_EQ(result.models[0].model.images.size(), 7u);
  ASSERT_TRUE(result.left_out.contains(8));
  EXPECT_THAT(result.left_out.at(8), ::testing::HasSubstr("has a verified match with another"));
}

// Matches of segments of one edge.
LineMatchMap RightMatches(const RefineScene& scene) {
  LineMatchMap right;
  for (const auto& [pair, matches] : scene.matches) {
    const auto &edges1 = scene.house.edge_of_segment.at(pair.first),
               &edges2 = scene.house.edge_of_segment.at(pair.second);
    for (const LineMatch& match : matches) {
      if (edges1[match.idx1] >= 0 && edges1[match.idx1] == edges2[match.idx2])
        right[pair].push_back(match);
    }
  }
  return right;
}

TEST(Mapper, LinesRegisterAnImageOfFewPointsAndAreWhereTheEdgesAre) {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.1, .num_clutter = 10});
  const Reconstruction& truth = scene.house.model;
  const MappingProblem problem = MakeMappingProblem(truth, {.poor = {4}, .num_matches_of_poor = 8},
                                                    scene.house.features, RightMatches(scene));
  MapperOptions options = WithIntrinsicsHeld();
  const MapResult points = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  ASSERT_THAT(points.models, SizeIs(1));
  EXPECT_FALSE(points.models[0].model.images.contains(4));

  options.structure = MapperStructure::kLines;
  const MapResult lines = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  const Reconstruction& model = lines.models[0].model;
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  ASSERT_EQ(model.images.size(), truth.images.size());
  EXPECT_LT(CompareRelativePoses(model, truth).rotation_deg, 0.1);
  // Every line is of one edge, and has most of its segments.
  size_t num_long = 0;
  for (const auto& [id, line] : model.lines3D) {
    std::set<int> edges;
    for (const LineObservation& observation : line.track)
      edges.insert(scene.house.edge_of_segment.at(observation.image_id)[observation.line2D_idx]);
    EXPECT_EQ(edges.size(), 1u);
    num_long += line.track.size() >= 6;
  }
  EXPECT_GE(num_long, scene.house.edges.size() / 2);
}

TEST(Mapper, GroupsFormWhileTheModelGrows) {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.1, .num_clutter = 10});
  const MappingProblem problem =
      MakeMappingProblem(scene.house.model, {}, scene.house.features, RightMatches(scene));
  MapperOptions options = WithIntrinsicsHeld();
  options.structure = MapperStructure::kHolistic;
  const MapResult result = MapImages(options, Threads(2), problem.input, problem.scene, nullptr);
  const Reconstruction& model = result.models.at(0).model;
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  size_t num_vps = 0, num_planes = 0;
  for (const auto& [id, group] : model.groups3D) {
    num_vps += IsVanishingPoint(*group.type);
    num_planes += IsPlane(*group.type);
  }
  EXPECT_EQ(num_vps, 3u);
  EXPECT_EQ(num_planes, 3u);
  EXPECT_LT(CompareRelativePoses(model, scene.house.model).rotation_deg, 0.05);
}

// Registers images at the truth and triangulates what they see.
void RegisterAtTruth(const Reconstruction& truth, image_t image_id, MapperState* state) {
  state->RegisterFrame(state->model().unregistered_images.at(image_id).frame_id,
                       truth.images.at(image_id).cam_from_world);
  TriangulateImage(MapperOptions().triangulation, image_id, state);
}

TEST(Mapper, VisibilityIsThatOfAFreshCount) {
  const Reconstruction truth = Truth(0.3);
  const MappingProblem problem = MakeMappingProblem(truth, {.share_of_wrong_matches = 0.3});
  MapperState state(problem.input, problem.scene);
  Random random(5);
  const auto expect_fresh = [&] {
    MapperState fresh(problem.input, state.model());
    for (const auto& [id, image] : state.model().unregistered_images) {
      const ImageVisibility &a = state.VisibilityOf(id), &b = fresh.VisibilityOf(id);
      ASSERT_EQ(a.num_points, b.num_points);
      ASSERT_EQ(a.score, b.score);
    }
  };
  for (const image_t id : {1, 2, 3, 4}) {
    RegisterAtTruth(truth, id, &state);
    expect_fresh();
  }
  for (int i = 0; i < 30; ++i) {
    const auto& points = state.model().points3D;
    const auto& [id, point] = points.begin()[random.Index(points.size())];
    if (i % 2 == 0) {
      state.DeletePoint(id);
    } else {
      state.Forget(point.track.front());
    }
    expect_fresh();
  }
  state.DeregisterFrame(2);
  expect_fresh();
  EXPECT_EQ(state.model().FindInconsistency(), std::nullopt);
}

TEST(Mapper, RegistrationWithoutStructureFindsThePose) {
  const Reconstruction truth = Truth(0.1);
  const MappingProblem problem = MakeMappingProblem(truth);
  MapperState state(problem.input, problem.scene);
  // Poses, and not a single point.
  for (const image_t id : {1, 2, 3, 5, 6, 7}) {
    state.RegisterFrame(state.model().unregistered_images.at(id).frame_id,
                        truth.images.at(id).cam_from_world);
  }
  EXPECT_FALSE(RegisterImage(WithIntrinsicsHeld(), 4, &state).accepted);
  const RegistrationReport report = RegisterWithoutStructure(WithIntrinsicsHeld(), 4, &state);
  ASSERT_TRUE(report.accepted) << report.failure;
  const Rigid3d &found = state.model().images.at(4).cam_from_world,
                &expected = truth.images.at(4).cam_from_world;
  EXPECT_LT(RadToDeg(found.rotation.angularDistance(expected.rotation)), 0.1);
  EXPECT_LT((found.OriginInA() - expected.OriginInA()).norm(), 0.1);  // of a scene 9 away
}

TEST(Mapper, FilterRemovesWhatDoesNotFitAndNothingElse) {
  const Reconstruction truth = Truth(0.0);
  const MappingProblem problem = MakeMappingProblem(truth);
  MapperState state(problem.input, problem.scene);
  for (const auto& [id, image] : truth.images) RegisterAtTruth(truth, id, &state);
  EXPECT_EQ(FilterAllPoints(MapperOptions().filter, &state), 0u);
  // A long track, one of whose keypoints is 5 px off: only this observation goes.
  const auto& points = state.model().points3D;
  const auto longest = std::max_element(
      points.begin(), points.end(),
      [](const auto& a, const auto& b) { return a.second.track.size() < b.second.track.size(); });
  const size_t length = longest->second.track.size();
  const PointObservation moved = longest->second.track[1];
  state.mutable_model()->images.at(moved.image_id).points2D[moved.point2D_idx].xy.x() += 5.0;
  const point3D_t id = longest->first;
  EXPECT_EQ(FilterAllPoints(MapperOptions().filter, &state), 1u);
  EXPECT_EQ(state.model().points3D.at(id).track.size(), length - 1);
  EXPECT_EQ(state.model().images.at(moved.image_id).points2D[moved.point2D_idx].point3D_id, kNoId);
}

}  // namespace
}  // namespace holba
