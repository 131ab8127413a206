// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/continue_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "holba/base/error.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

using ::testing::HasSubstr;

// Three images of one camera; points 7 (images 1, 2, 3) and 9 (images 1, 2).
Reconstruction Model() {
  Reconstruction model;
  model.cameras.Add(4, {FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {512.5, 320, 240}});
  for (image_t id = 1; id <= 3; ++id) {
    Image image{.name = std::to_string(id) + ".jpg", .camera_id = 4};
    image.cam_from_world.translation = {0.1 * id, 0, 0};
    image.points2D = {{{10.0 * id, 20}, kNoId}, {{30.0 * id, 40}, kNoId}};
    model.images.Add(id, image);
  }
  model.AddTrivialRigsAndFrames();
  Point3D seven{.xyz = {1, 2, 3}, .rgb = {1, 2, 3}};
  seven.track = {{1, 0}, {2, 0}, {3, 0}};
  Point3D nine{.xyz = {4, 5, 6}};
  nine.track = {{1, 1}, {2, 1}};
  for (const auto& [id, point] : {std::pair<point3D_t, Point3D>(7, seven), {9, nine}}) {
    for (const PointObservation& o : point.track)
      model.images.at(o.image_id).points2D[o.point2D_idx].point3D_id = id;
    model.points3D.Add(id, point);
  }
  return model;
}

// The same images under other ids with one more, another camera id and a keypoint before the
// others.
Reconstruction Scene() {
  Reconstruction scene;
  scene.cameras.Add(1, {FindCameraModel("SIMPLE_RADIAL"), 640, 480, {768, 320, 240, 0}});
  for (image_t id = 1; id <= 4; ++id) {
    Image image{.name = std::to_string(id) + ".jpg", .camera_id = 1};
    image.points2D = {{{10.0 * id, 20}, kNoId}, {{5, 5}, kNoId}, {{30.0 * id, 40}, kNoId}};
    scene.AddUnregisteredImage(10 + id, image);
  }
  return scene;
}

TEST(ContinueModel, PosesCamerasAndPointsAreTheModelsUnderTheIdsOfTheDatabase) {
  const Reconstruction model = Model();
  Reconstruction scene = Scene();
  const ContinueReport report = ContinueModel(model, "model", &scene);
  EXPECT_EQ(scene.FindInconsistency(), std::nullopt);
  EXPECT_EQ(report.num_images, 3u);
  EXPECT_EQ(report.num_points, 2u);
  EXPECT_EQ(report.num_observations, 5u);
  EXPECT_EQ(report.num_foreign_observations, 0u);
  ASSERT_EQ(scene.images.size(), 3u);
  ASSERT_EQ(scene.unregistered_images.size(), 1u);
  for (image_t id = 1; id <= 3; ++id) {
    EXPECT_EQ(scene.images.at(10 + id).cam_from_world.translation,
              model.images.at(id).cam_from_world.translation);
  }
  // Also of the image that is new.
  EXPECT_EQ(scene.cameras.at(scene.unregistered_images.at(14).camera_id).params,
            model.cameras.at(4).params);
  const Point3D& nine = scene.points3D.at(9);
  EXPECT_EQ(nine.xyz, model.points3D.at(9).xyz);
  const std::vector<PointObservation> track = {{11, 2}, {12, 2}};
  EXPECT_EQ(nine.track, track);
  EXPECT_EQ(scene.points3D.at(7).rgb, model.points3D.at(7).rgb);
}

TEST(ContinueModel, ObservationsThatAreNoKeypointsAreLeftOutAndPointsThatHaveNoOthers) {
  const Reconstruction model = Model();
  Reconstruction scene = Scene();
  scene.unregistered_images.at(12).points2D[0].xy.x() += 0.5;
  scene.unregistered_images.at(12).points2D[2].xy.x() += 0.5;
  const ContinueReport report = ContinueModel(model, "model", &scene);
  EXPECT_EQ(scene.FindInconsistency(), std::nullopt);
  EXPECT_EQ(report.num_foreign_observations, 2u);
  EXPECT_EQ(report.num_points_left_out, 1u);
  EXPECT_EQ(scene.points3D.at(7).track.size(), 2u);
  EXPECT_FALSE(scene.points3D.contains(9));
}

TEST(ContinueModel, SeveralCamerasOfOneOfTheDatabaseStaySeveral) {
  Reconstruction model = Model();
  model.cameras.Add(8, {FindCameraModel("SIMPLE_PINHOLE"), 640, 480, {600, 320, 240}});
  Rig rig;
  rig.ref_sensor = SensorId{SensorType::kCamera, 8};
  model.rigs.Add(8, rig);
  model.images.at(3).camera_id = 8;
  Frame& frame = model.frames.at(model.images.at(3).frame_id);
  frame.rig_id = 8;
  frame.data = {{*rig.ref_sensor, 3}};
  Reconstruction scene = Scene();
  ContinueModel(model, "model", &scene);
  EXPECT_EQ(scene.FindInconsistency(), std::nullopt);
  EXPECT_EQ(scene.cameras.at(scene.images.at(11).camera_id).params[0], 512.5);
  EXPECT_EQ(scene.cameras.at(scene.images.at(13).camera_id).params[0], 600);
}

TEST(ContinueModel, AModelOfOtherImagesOrSizesOrKeypointsIsRefused) {
  const auto message = [](const Reconstruction& model, Reconstruction scene) -> std::string {
    try {
      ContinueModel(model, "model", &scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  Reconstruction model = Model();
  model.images.at(2).name = "other.jpg";
  EXPECT_THAT(message(model, Scene()),
              HasSubstr("1 of its 3 images are not in the database (first 'other.jpg')"));
  Reconstruction scene = Scene();
  scene.cameras.at(1).width = 641;
  EXPECT_THAT(message(Model(), scene), HasSubstr("expected 641 x 480 pixels"));
  scene = Scene();
  for (auto& [id, image] : scene.unregistered_images) {
    for (Point2D& point : image.points2D) point.xy.y() += 100;
  }
  EXPECT_THAT(message(Model(), scene), HasSubstr("none of its 2D points is a keypoint"));
}

}  // namespace
}  // namespace holba
