// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "holba/sfm/mapper.h"
#include "holba/sfm/mapper_testing.h"
#include "holba/sfm/refine_testing.h"
#include "holba/sfm/snapshot_archive.h"

namespace holba {
namespace {

using ::testing::SizeIs;

class KeepsSnapshots : public MapObserver {
 public:
  bool WantsSnapshot() override { return true; }
  void OnSnapshot(const std::string& bytes) override { snapshots.push_back(bytes); }

  std::vector<std::string> snapshots;
};

// All of the models, to the last bit.
std::string BytesOf(const MapResult& result, const Reconstruction& scene) {
  SnapshotWriter writer(scene);
  for (const MappedModel& model : result.models) writer(model.model);
  writer(result.left_out);
  return writer.bytes();
}

// Two parts that share no matches, so that there are two models, with segments.
MappingProblem TwoHouses() {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.3, .num_clutter = 5});
  MappingProblemOptions options{.share_of_wrong_matches = 0.1};
  for (image_t a = 1; a <= 8; ++a) {
    for (image_t b = a + 1; b <= 8; ++b) {
      if ((a <= 4) != (b <= 4)) options.unmatched.insert({a, b});
    }
  }
  LineMatchMap matches;
  for (const auto& [pair, of_pair] : scene.matches) {
    if (!options.unmatched.contains(pair)) matches[pair] = of_pair;
  }
  return MakeMappingProblem(scene.house.model, options, scene.house.features, matches);
}

MapperOptions SmallModels() {
  MapperOptions options;
  options.min_model_size = 3;
  options.local.num_images = 2;  // small models are adjusted as a whole, too
  return options;
}

TEST(Snapshot, ARunThatGoesOnFromAnyEndsAtTheSameBits) {
  const MappingProblem problem = TwoHouses();
  const MapperOptions options = SmallModels();
  SolverOptions solver;
  solver.num_threads = 2;
  KeepsSnapshots kept;
  const MapResult whole = MapImages(options, solver, problem.input, problem.scene, &kept);
  ASSERT_THAT(whole.models, SizeIs(2));
  ASSERT_GE(kept.snapshots.size(), 4u);
  // Snapshots change nothing.
  const std::string expected = BytesOf(whole, problem.scene);
  EXPECT_EQ(BytesOf(MapImages(options, solver, problem.input, problem.scene, nullptr),
                    problem.scene) == expected,
            true);
  for (size_t i = 0; i < kept.snapshots.size(); ++i) {
    KeepsSnapshots later;
    const MapResult resumed =
        MapImages(options, solver, problem.input, problem.scene, &later, kept.snapshots[i]);
    EXPECT_EQ(BytesOf(resumed, problem.scene) == expected, true) << "snapshot " << i;
    // The last one is that of the end, after which nothing is done.
    EXPECT_THAT(later.snapshots,
                SizeIs(i + 1 == kept.snapshots.size() ? 1 : kept.snapshots.size() - i - 1));
    for (const MappedModel& model : resumed.models)
      EXPECT_EQ(model.model.FindInconsistency(), std::nullopt);
    EXPECT_EQ(resumed.models[0].report.num_registered, whole.models[0].report.num_registered);
  }
}

TEST(Snapshot, CamerasThatBecameOneAreReadBackAsOne) {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.3, .num_clutter = 5});
  const MappingProblem problem =
      MakeMappingProblem(WithOwnCameras(scene.house.model), {.focal_length_is_known = false},
                         scene.house.features, scene.matches);
  MapperOptions options = SmallModels();
  options.cameras.share_cameras = true;
  options.cameras.camera_model = CameraModelSource::kAuto;
  options.global.min_images_for_cameras = 5;
  SolverOptions solver;
  solver.num_threads = 2;
  KeepsSnapshots kept;
  const MapResult whole = MapImages(options, solver, problem.input, problem.scene, &kept);
  ASSERT_THAT(whole.models, SizeIs(1));
  EXPECT_LT(whole.models[0].model.cameras.size(), problem.scene.cameras.size());
  ASSERT_GE(kept.snapshots.size(), 2u);
  const std::string expected = BytesOf(whole, problem.scene);
  for (size_t i = 0; i < kept.snapshots.size(); ++i) {
    const MapResult resumed =
        MapImages(options, solver, problem.input, problem.scene, nullptr, kept.snapshots[i]);
    EXPECT_EQ(BytesOf(resumed, problem.scene) == expected, true) << "snapshot " << i;
    EXPECT_EQ(resumed.models[0].model.FindInconsistency(), std::nullopt);
  }
}

TEST(Snapshot, AModelIsReadBackAsItWasWithItsOrderAndItsIds) {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.3});
  Reconstruction model = scene.house.model;
  const Reconstruction begin = model;
  // Ids that were given and are gone, records in another order, features that came and structure.
  const point3D_t gone = model.AddPoint3D({1, 2, 3});
  model.DeletePoint3D(gone);
  model.DeletePoint3D(model.points3D.begin()->first);
  model.DeregisterImage(3);
  model.AddPoint2D(2, {1.25, 2.5});
  SnapshotWriter writer(begin);
  writer(model);
  Reconstruction read;
  SnapshotReader reader(writer.bytes(), begin);
  reader(read);
  EXPECT_TRUE(reader.AtEnd());
  EXPECT_EQ(read.FindInconsistency(), std::nullopt);
  EXPECT_EQ(read.points3D.NextId(), model.points3D.NextId());
  EXPECT_EQ(read.images.at(2).points2D.size(), model.images.at(2).points2D.size());
  ASSERT_EQ(read.points3D.size(), model.points3D.size());
  for (size_t i = 0; i < read.points3D.size(); ++i)
    EXPECT_EQ((read.points3D.begin() + i)->first, (model.points3D.begin() + i)->first);
  SnapshotWriter again(begin);
  again(read);
  EXPECT_EQ(again.bytes() == writer.bytes(), true);
}

TEST(Snapshot, OtherMatchesOrImagesHaveAnotherFingerprint) {
  const RefineScene scene = MakeRefineScene({});
  const MappingProblem problem = MakeMappingProblem(scene.house.model);
  const MappingProblem other = MakeMappingProblem(scene.house.model, {.unmatched = {{1, 2}}});
  EXPECT_EQ(FingerprintOf(problem.input.graph, problem.scene),
            FingerprintOf(MakeMappingProblem(scene.house.model).input.graph, problem.scene));
  EXPECT_NE(FingerprintOf(problem.input.graph, problem.scene),
            FingerprintOf(other.input.graph, other.scene));
  Reconstruction moved = problem.scene;
  moved.unregistered_images.at(1).points2D[0].xy.x() += 1e-9;
  EXPECT_NE(FingerprintOf(problem.input.graph, problem.scene),
            FingerprintOf(problem.input.graph, moved));
}

}  // namespace
}  // namespace holba
