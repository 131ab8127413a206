// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/reconstruction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

Sim3d RandomSimilarity(Random& random) {
  Sim3d sim;
  sim.scale = random.Uniform(0.2, 5.0);
  sim.rotation = random_model_internal::Pose(random).rotation;
  sim.translation = random_model_internal::Vector(random);
  return sim;
}

TEST(IdMap, KeepsTheOrderInWhichRecordsCame) {
  IdMap<uint32_t, int> map;
  EXPECT_TRUE(map.Add(9, 1));
  EXPECT_TRUE(map.Add(3, 2));
  EXPECT_TRUE(map.Add(5, 3));
  EXPECT_FALSE(map.Add(3, 4));
  EXPECT_EQ(map.at(3), 2);
  EXPECT_EQ(map.RemoveIf([](uint32_t id, int) { return id == 9; }), 1u);
  ASSERT_EQ(map.size(), 2u);
  EXPECT_EQ(map.begin()->first, 3u);
  EXPECT_EQ(map.IndexOf(5), 1u);
  EXPECT_EQ(map.Find(9), nullptr);
  EXPECT_THROW(map.at(9), CheckError);
}

TEST(Reconstruction, TrivialRigsAndFramesHaveTheIdsOfCamerasAndImages) {
  const Reconstruction model = RandomModel(1, {.with_rigs = false});
  EXPECT_FALSE(model.has_rig_files);
  for (const auto& [image_id, image] : model.images) {
    EXPECT_EQ(image.frame_id, image_id);
    const Frame& frame = model.frames.at(image_id);
    EXPECT_EQ(frame.rig_id, image.camera_id);
    EXPECT_EQ(frame.rig_from_world.translation, image.cam_from_world.translation);
    EXPECT_EQ(frame.rig_from_world.rotation.coeffs(), image.cam_from_world.rotation.coeffs());
    const SensorId sensor{SensorType::kCamera, image.camera_id};
    EXPECT_EQ(model.rigs.at(frame.rig_id).ref_sensor, sensor);
    ASSERT_EQ(frame.data.size(), 1u);
    EXPECT_EQ(frame.data[0].sensor, sensor);
    EXPECT_EQ(frame.data[0].data_id, image_id);
    EXPECT_EQ(model.SensorFromRig(image).translation, Eigen::Vector3d::Zero());
  }
}

TEST(Reconstruction, TrivialFramesAvoidIdsThatAreTaken) {
  Reconstruction model = RandomModel(2);
  const camera_t left = model.cameras.begin()->first;
  // A rig of two sensors under the camera's id, and a frame under the image's.
  const Rig taken = model.rigs.at(8);
  model.rigs.Add(left, taken);
  model.images.Add(40, {.name = "new", .camera_id = left});
  model.images.Add(41, {.name = "newer", .camera_id = left});
  model.AddTrivialRigsAndFrames();
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  const Frame& frame = model.frames.at(model.images.at(40).frame_id);
  EXPECT_NE(frame.rig_id, left);
  EXPECT_EQ(model.frames.at(model.images.at(41).frame_id).rig_id, frame.rig_id);
}

TEST(Reconstruction, SettingTheFramePoseMovesEverySensorOfIt) {
  Reconstruction model = RandomModel(3);
  Random random(7);
  const frame_t frame_id = model.frames.begin()->first;
  const Rigid3d pose = random_model_internal::Pose(random);
  model.SetFramePose(frame_id, pose);
  int num_moved = 0;
  for (const auto& [image_id, image] : model.images) {
    if (image.frame_id != frame_id) continue;
    ++num_moved;
    const Rigid3d expected = model.SensorFromRig(image) * pose;
    EXPECT_LT((image.cam_from_world.Inverse() * expected).translation.norm(), 1e-12);
    EXPECT_LT(LogRotation(image.cam_from_world.Inverse().rotation * expected.rotation).norm(),
              1e-12);
    EXPECT_LT((model.CameraCentre(image_id) - expected.Inverse().translation).norm(), 1e-12);
  }
  EXPECT_EQ(num_moved, 2);
  // The reference sensor has the bits of the frame.
  EXPECT_EQ(model.images.at(1).cam_from_world.rotation.coeffs(), pose.rotation.coeffs());
}

TEST(Reconstruction, ASimilarityKeepsWhatCamerasSee) {
  for (const bool with_rigs : {false, true}) {
    const Reconstruction before = RandomModel(4, {.with_rigs = with_rigs, .extreme_reals = false});
    Reconstruction after = before;
    Random random(5);
    const Sim3d sim = RandomSimilarity(random);
    after.Transform(sim);
    EXPECT_EQ(after.FindInconsistency(), std::nullopt);
    for (const auto& [image_id, image] : before.images) {
      const Rigid3d& moved = after.images.at(image_id).cam_from_world;
      for (const auto& [id, point] : before.points3D) {
        const Eigen::Vector3d in_cam = image.cam_from_world * point.xyz;
        const Eigen::Vector3d moved_in_cam = moved * after.points3D.at(id).xyz;
        EXPECT_LT((sim.scale * in_cam - moved_in_cam).norm(), 1e-9 * (1.0 + moved_in_cam.norm()));
      }
      for (const auto& [id, line] : before.lines3D) {
        const PlueckerLine in_cam = Transform(image.cam_from_world, line.line);
        const PlueckerLine moved_in_cam = Transform(moved, after.lines3D.at(id).line);
        EXPECT_LT((in_cam.direction - moved_in_cam.direction).norm(), 1e-12);
        EXPECT_LT((sim.scale * in_cam.moment - moved_in_cam.moment).norm(), 1e-10);
      }
    }
    for (const auto& [id, line] : before.lines3D) {
      EXPECT_EQ(after.lines3D.at(id).start, sim * line.start);
      EXPECT_EQ(after.lines3D.at(id).end, sim * line.end);
    }
    for (const auto& [rig_id, rig] : before.rigs) {
      for (size_t i = 0; i < rig.sensors.size(); ++i) {
        if (!rig.sensors[i].sensor_from_rig) continue;
        EXPECT_EQ(after.rigs.at(rig_id).sensors[i].sensor_from_rig->translation,
                  sim.scale * rig.sensors[i].sensor_from_rig->translation);
      }
    }
  }
}

TEST(Reconstruction, ASimilarityCarriesGroupsWithTheirPoints) {
  const Reconstruction before = RandomModel(6, {.extreme_reals = false});
  Reconstruction after = before;
  Random random(8);
  const Sim3d sim = RandomSimilarity(random);
  after.Transform(sim);
  int num_projected = 0;
  for (const auto& [id, group] : before.groups3D) {
    double g[kMaxGroupParams], moved[kMaxGroupParams];
    ASSERT_TRUE(group.type->from_file(group.params.data(), g));
    ASSERT_TRUE(group.type->from_file(after.groups3D.at(id).params.data(), moved));
    if (group.type->HasDirection()) {
      Eigen::Vector3d a, b;
      group.type->direction(g, &a, nullptr);
      group.type->direction(moved, &b, nullptr);
      EXPECT_LT((sim.rotation * a - b).norm(), 1e-12) << group.type->name;
    }
    if (!group.type->TakesPoints()) continue;
    for (int i = 0; i < 5; ++i) {
      const Eigen::Vector3d X = random_model_internal::Vector(random);
      Eigen::Vector3d projected, moved_projected;
      ASSERT_TRUE(group.type->project_point(g, X, &projected));
      ASSERT_TRUE(group.type->project_point(moved, sim * X, &moved_projected));
      EXPECT_LT((sim * projected - moved_projected).norm(), 1e-9) << group.type->name;
      ++num_projected;
    }
  }
  EXPECT_GE(num_projected, 60);
}

TEST(Reconstruction, ASimilarityAndItsInverseUndoEachOther) {
  const Reconstruction before = RandomModel(9, {.extreme_reals = false});
  Reconstruction after = before;
  Random random(10);
  const Sim3d sim = RandomSimilarity(random);
  after.Transform(sim);
  after.Transform(sim.Inverse());
  for (const auto& [image_id, image] : before.images) {
    EXPECT_LT((after.CameraCentre(image_id) - before.CameraCentre(image_id)).norm(), 1e-10);
  }
  for (const auto& [id, group] : before.groups3D) {
    double g[kMaxGroupParams], back[kMaxGroupParams], delta[kMaxGroupParams];
    ASSERT_TRUE(group.type->from_file(group.params.data(), g));
    ASSERT_TRUE(group.type->from_file(after.groups3D.at(id).params.data(), back));
    group.type->manifold->minus(back, g, delta);
    for (int i = 0; i < group.type->manifold->tangent; ++i) {
      EXPECT_NEAR(delta[i], 0.0, 1e-9) << group.type->name;
    }
  }
}

}  // namespace
}  // namespace holba
