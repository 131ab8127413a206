// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/image_pairing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/evaluation/ground_truth.h"
#include "holba/evaluation/test_scenes.h"

namespace holba {
namespace {

using testing::HasSubstr;

// Cameras that see points at 2D features of the points' ids.
Reconstruction SceneWithTracks(Random* random) {
  Reconstruction scene = RandomCameras(6, random);
  for (point3D_t id = 1; id <= 10; ++id) {
    Point3D point;
    point.xyz = RandomVector(random);
    for (const image_t image_id : {1, 2, 3})
      point.track.push_back({image_id, static_cast<point2D_t>(id)});
    scene.points3D.Add(id, point);
  }
  return scene;
}

// The same scene with images and tracks of other ids.
Reconstruction Renumbered(const Reconstruction& scene) {
  Reconstruction renumbered;
  const auto new_id = [](image_t id) { return 20 - id; };
  for (const auto& [id, image] : scene.images) renumbered.images.Add(new_id(id), image);
  for (const auto& [id, point] : scene.points3D) {
    Point3D other = point;
    for (PointObservation& observation : other.track)
      observation.image_id = new_id(observation.image_id);
    renumbered.points3D.Add(id, other);
  }
  return renumbered;
}

TEST(PairImages, PairsByNameWhateverTheIds) {
  Random random(1);
  const Reconstruction truth = SceneWithTracks(&random);
  const ImagePairing pairing = PairImages(Renumbered(truth), truth);
  EXPECT_EQ(pairing.num_whole, 6u);
  for (const auto& [true_id, model_id] : pairing.model_id_of_truth)
    EXPECT_EQ(model_id, 20 - true_id);
  EXPECT_TRUE(pairing.features_have_same_ids);
  const auto errors = CompareToTruth(Renumbered(truth), truth);
  EXPECT_LT(errors->rotation_deg->max, 1e-6);
  EXPECT_LT(errors->point->max, 1e-9);
}

TEST(PairImages, FeaturesThatAreSeenElsewhereAreOthers) {
  Random random(2);
  const Reconstruction truth = SceneWithTracks(&random);
  Reconstruction model = truth;
  // Points of another run: the ids are there, and mean others.
  for (auto& [id, point] : model.points3D) {
    point.xyz = RandomVector(&random);
    for (PointObservation& observation : point.track) observation.point2D_idx += 100;
  }
  EXPECT_FALSE(PairImages(model, truth).features_have_same_ids);
  const auto errors = CompareToTruth(model, truth);
  EXPECT_LT(errors->rotation_deg->max, 1e-6);
  EXPECT_LT(errors->position->max, 1e-9);
  EXPECT_FALSE(errors->point);
  EXPECT_EQ(errors->alignment.num_positions, 6u);
}

TEST(ReportPairing, RefusesNamesOfAnotherSetWithOneOfEach) {
  Random random(3);
  const Reconstruction truth = RandomCameras(4, &random);
  Reconstruction model = truth;
  for (auto& [id, image] : model.images) image.name = "other" + image.name;
  try {
    ReportPairing(PairImages(model, truth), "truth");
    FAIL() << "names of another set were accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("truth: only 0 of the 4 images of the model"));
    EXPECT_THAT(error.what(), HasSubstr("'otherimage0.jpg'"));
    EXPECT_THAT(error.what(), HasSubstr("'image0.jpg'"));
  }
  // Half of them is enough, and so is a model that has little of the truth.
  model.images.at(1).name = "image0.png";
  model.images.at(2).name = "folder/image1.jpg";
  EXPECT_NO_THROW(ReportPairing(PairImages(model, truth), "truth"));
  model.images.RemoveIf([](image_t id, const Image&) { return id > 1; });
  EXPECT_NO_THROW(ReportPairing(PairImages(model, truth), "truth"));
  EXPECT_NO_THROW(ReportPairing(PairImages(Reconstruction(), truth), "truth"));
}

}  // namespace
}  // namespace holba
