// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/local_frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

constexpr RandomModelOptions kFinite{.extreme_reals = false};

// All numbers that a similarity changes, in the order of the model.
std::vector<double> GeometryOf(const Reconstruction& model) {
  std::vector<double> all;
  const auto add = [&all](const Eigen::Vector3d& x) { all.insert(all.end(), x.begin(), x.end()); };
  const auto add_pose = [&](const Rigid3d& pose) {
    const Eigen::Vector4d& q = pose.rotation.coeffs();
    all.insert(all.end(), q.begin(), q.end());
    add(pose.translation);
  };
  for (const auto& [id, rig] : model.rigs) {
    for (const Rig::Sensor& sensor : rig.sensors) {
      if (sensor.sensor_from_rig) add_pose(*sensor.sensor_from_rig);
    }
  }
  for (const auto& [id, frame] : model.frames) add_pose(frame.rig_from_world);
  for (const auto& [id, image] : model.images) add_pose(image.cam_from_world);
  for (const auto& [id, point] : model.points3D) add(point.xyz);
  for (const auto& [id, line] : model.lines3D) {
    add(line.line.direction);
    add(line.line.moment);
    add(line.start);
    add(line.end);
  }
  for (const auto& [id, group] : model.groups3D) {
    all.insert(all.end(), group.params.begin(), group.params.end());
  }
  return all;
}

TEST(LocalFrame, GivesBackBitForBitWhatHasNotChanged) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Reconstruction model = RandomModel(seed, kFinite);
    const std::vector<double> before = GeometryOf(model);
    for (const auto unit : {LocalFrame::Unit::kOfTheScene, LocalFrame::Unit::kUnchanged}) {
      {
        const LocalFrame local(&model, unit);
        EXPECT_NE(GeometryOf(model), before) << seed;
      }
      EXPECT_EQ(GeometryOf(model), before) << seed;
    }
  }
}

// Cameras that look along z from given places.
Reconstruction ModelOfCameras(const std::vector<Eigen::Vector3d>& centres) {
  Reconstruction model;
  for (const Eigen::Vector3d& centre : centres) {
    const image_t id = model.images.NextId();
    model.images.Add(id, {.cam_from_world = {Eigen::Quaterniond::Identity(), -centre}});
  }
  return model;
}

TEST(NormalisedFromWorld, LeavesTheOutermostCamerasOut) {
  std::vector<Eigen::Vector3d> centres;
  for (int i = 0; i < 11; ++i) centres.push_back({double(i), 0.0, 5.0});
  centres.front().x() = -1e9;
  centres.back().x() = 1e6;
  const auto normalised = NormalisedFromWorld(ModelOfCameras(centres));
  ASSERT_TRUE(normalised);
  // x of 1 to 9 are left.
  EXPECT_NEAR(normalised->scale, 10.0 / 8.0, 1e-12);
  EXPECT_LT((*normalised * Eigen::Vector3d(5.0, 0.0, 5.0)).norm(), 1e-12);
  const Sim3d local = LocalFromWorld(ModelOfCameras(centres));
  EXPECT_NEAR(local.scale, 10.0 / 8.0, 1e-12);
  EXPECT_LT((local * Eigen::Vector3d(5.0, 0.0, 5.0)).norm(), 1e-12);
  EXPECT_FALSE(NormalisedFromWorld(Reconstruction()));
}

TEST(LocalFrame, IsTheSameWhereverTheSceneLiesAndWhateverItsUnitIs) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    for (const double unit : {1e-3, 1.0, 1e6}) {
      Reconstruction model = RandomModel(seed, kFinite), moved = model;
      Sim3d moved_from_model;
      moved_from_model.scale = unit;
      moved_from_model.translation = unit * Eigen::Vector3d(5e5, 5.4e6, 300.0);
      moved.Transform(moved_from_model);
      const LocalFrame local(&model), local_of_moved(&moved);
      const std::vector<double> a = GeometryOf(model), b = GeometryOf(moved);
      ASSERT_EQ(a.size(), b.size());
      // What the origin 5e6 away has rounded off.
      for (size_t i = 0; i < a.size(); ++i) {
        ASSERT_NEAR(a[i], b[i], 1e-7 * (1.0 + std::abs(a[i]))) << seed << " " << unit << " " << i;
      }
    }
  }
}

TEST(LocalFrame, BringsBackWhatHasMovedAndWhatIsNew) {
  Reconstruction model = RandomModel(3, kFinite);
  const Reconstruction before = model;
  const point3D_t moved_id = model.points3D.begin()->first;
  const frame_t frame_id = model.frames.begin()->first;
  const Eigen::Vector3d step(0.5, -1.0, 2.0);
  point3D_t new_id = kNoId;
  Sim3d world_from_local;
  {
    const LocalFrame local(&model);
    world_from_local = local.local_from_world().Inverse();
    model.points3D.at(moved_id).xyz += step;
    Rigid3d pose = model.frames.at(frame_id).rig_from_world;
    pose.translation += step;
    model.SetFramePose(frame_id, pose);
    new_id = model.points3D.NextId();
    model.points3D.Add(new_id, {.xyz = step});
  }
  EXPECT_LT((model.points3D.at(moved_id).xyz - before.points3D.at(moved_id).xyz -
             world_from_local.scale * step)
                .norm(),
            1e-12);
  EXPECT_LT((model.points3D.at(new_id).xyz - world_from_local * step).norm(), 1e-12);
  const Rigid3d& pose = model.frames.at(frame_id).rig_from_world;
  const Rigid3d& old = before.frames.at(frame_id).rig_from_world;
  EXPECT_LT((pose.translation - old.translation - world_from_local.scale * step).norm(), 1e-12);
  for (const auto& [id, point] : before.points3D) {
    if (id == moved_id) continue;
    EXPECT_EQ(model.points3D.at(id).xyz, point.xyz) << id;
  }
  for (const auto& [id, frame] : before.frames) {
    if (id == frame_id) continue;
    EXPECT_EQ(model.frames.at(id).rig_from_world.translation, frame.rig_from_world.translation);
  }
}

TEST(LocalFromWorld, TakesTheUnitFromThePointsWhereTheCamerasOnlyTurn) {
  Reconstruction model = ModelOfCameras({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}});
  for (int i = 0; i < 11; ++i) {
    model.points3D.Add(model.points3D.NextId(), {.xyz = Eigen::Vector3d(0.0, i, 100.0)});
  }
  EXPECT_NEAR(LocalFromWorld(model).scale, 1e4 / 8.0, 1e-8);
}

}  // namespace
}  // namespace holba
