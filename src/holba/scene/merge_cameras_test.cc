// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/merge_cameras.h"

#include <gmock/gmock.h>

namespace holba {
namespace {

using testing::ElementsAre;

// Five images of cameras 1 to 5, the last without a pose; cameras 6 and 7 in a rig of two.
Reconstruction Model() {
  Reconstruction model;
  const CameraModel* pinhole = FindCameraModel("SIMPLE_PINHOLE");
  for (camera_t id = 1; id <= 7; ++id)
    model.cameras.Add(id, {pinhole, 640, 480, {500.0 + id, 320.0, 240.0}});
  for (image_t id = 1; id <= 4; ++id) {
    Image image;
    image.name = std::string("photo") + static_cast<char>('0' + id);
    image.camera_id = id;
    image.cam_from_world.translation.x() = id;
    image.points2D.resize(2);
    model.images.Add(id, image);
  }
  Rig rig;
  rig.ref_sensor = SensorId{SensorType::kCamera, 6};
  rig.sensors.push_back({{SensorType::kCamera, 7}, Rigid3d()});
  model.rigs.Add(90, rig);
  model.AddTrivialRigsAndFrames();
  Image waiting;
  waiting.name = "waiting";
  waiting.camera_id = 5;
  model.AddUnregisteredImage(9, waiting);
  return model;
}

TEST(MergeCameras, OnlyThoseAloneInTheirRigsCanBe) {
  EXPECT_THAT(CamerasOfTrivialRigs(Model()), ElementsAre(1, 2, 3, 4, 5));
}

TEST(MergeCameras, ImagesAreOfTheKeptCameraAndPosesStay) {
  Reconstruction model = Model();
  ASSERT_EQ(model.FindInconsistency(), std::nullopt);
  MergeCameras(2, {1, 2, 4, 5}, &model);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(model.cameras.size(), 4u);  // 2, 3, 6, 7
  EXPECT_EQ(model.cameras.at(2).params[0], 502.0);
  for (const auto& [id, camera] : {std::pair{1, 2}, {2, 2}, {3, 3}, {4, 2}, {9, 2}})
    EXPECT_EQ(model.FindImage(id)->camera_id, static_cast<camera_t>(camera)) << id;
  for (image_t id = 1; id <= 4; ++id)
    EXPECT_EQ(model.images.at(id).cam_from_world.translation.x(), id);
  EXPECT_FALSE(model.IsRegistered(9));
}

}  // namespace
}  // namespace holba
