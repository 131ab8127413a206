// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "holba/scene/random_model.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(FindInconsistency, RandomModelsAreConsistent) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const RandomModelOptions options{.with_rigs = seed % 2 == 0, .with_structure = seed % 3 != 0};
    EXPECT_EQ(RandomModel(seed, options).FindInconsistency(), std::nullopt);
  }
  EXPECT_EQ(Reconstruction().FindInconsistency(), std::nullopt);
}

TEST(FindInconsistency, WhatColmapModelsHoldIsNoError) {
  Reconstruction model = RandomModel(1);
  // A frame names an image that was not registered.
  model.frames.begin()->second.data[1].data_id = 4711;
  const image_t image_id = 2;
  model.images.RemoveIf([&](image_t id, const Image&) { return id == image_id; });
  for (auto& [id, point] : model.points3D) {
    std::erase_if(point.track, [&](const auto& o) { return o.image_id == image_id; });
  }
  for (auto& [id, line] : model.lines3D) {
    std::erase_if(line.track, [&](const auto& o) { return o.image_id == image_id; });
  }
  for (auto& [id, group] : model.groups3D) {
    std::erase_if(group.observations, [&](const auto& o) { return o.image_id == image_id; });
  }
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

struct Fault {
  const char* message;
  std::function<void(Reconstruction&)> make;
};

template <typename Map>
auto& First(Map& map) {
  return map.begin()->second;
}
Image& FirstImage(Reconstruction& m) { return First(m.images); }
Point3D& TrackedPoint(Reconstruction& m) {
  for (auto& [id, point] : m.points3D) {
    if (point.track.size() >= 2) return point;
  }
  ADD_FAILURE() << "no point with a track";
  return First(m.points3D);
}
Line3D& TrackedLine(Reconstruction& m) {
  for (auto& [id, line] : m.lines3D) {
    if (line.track.size() >= 2) return line;
  }
  ADD_FAILURE() << "no line with a track";
  return First(m.lines3D);
}
Group3D& ObservedGroup(Reconstruction& m, std::string_view type) {
  for (auto& [id, group] : m.groups3D) {
    if (group.type->name == type && !group.observations.empty()) return group;
  }
  ADD_FAILURE() << "no observed group of type " << type;
  return First(m.groups3D);
}
Group2D& FirstObservation(Reconstruction& m, const Group3D& group) {
  const GroupObservation& observation = group.observations.front();
  return m.images.at(observation.image_id).groups2D.at(observation.group2D_idx);
}

TEST(FindInconsistency, NamesEveryFault) {
  const std::vector<Fault> faults = {
      {"has 1 parameters, but", [](auto& m) { First(m.cameras).params.resize(1); }},
      {"has a parameter that is not finite", [](auto& m) { First(m.cameras).params[0] = kNan; }},
      {"has a focal length of 0",
       [](auto& m) {
         Camera& camera = First(m.cameras);
         camera.params[camera.model->focal_idxs[0]] = 0.0;
       }},
      {"has no camera model", [](auto& m) { First(m.cameras).model = nullptr; }},
      {"rig 8 names camera 999, which is not in the model",
       [](auto& m) { m.rigs.at(8).sensors[0].id.id = 999; }},
      {"rig 8 has sensors but no reference sensor",
       [](auto& m) { m.rigs.at(8).ref_sensor = std::nullopt; }},
      {"rig 8 has IMU 5 twice",
       [](auto& m) { m.rigs.at(8).sensors.push_back(m.rigs.at(8).sensors[1]); }},
      {"has a rotation quaternion of norm 2, expected 1",
       [](auto& m) { m.rigs.at(8).sensors[0].sensor_from_rig->rotation.coeffs() *= 2.0; }},
      {"frame 40 names rig 77, which is not in the model",
       [](auto& m) { m.frames.at(40).rig_id = 77; }},
      {"frame 40 has data of IMU 6, which is not in its rig 8",
       [](auto& m) { m.frames.at(40).data[2].sensor.id = 6; }},
      {"frame 40 has a translation that is not finite",
       [](auto& m) { m.frames.at(40).rig_from_world.translation[1] = INFINITY; }},
      {"image 1 is in frame 40 and again in frame 37",
       [](auto& m) { m.frames.at(37).data[0].data_id = 1; }},
      {"whose pose in its rig is unknown",
       [](auto& m) { m.rigs.at(8).sensors[0].sensor_from_rig = std::nullopt; }},
      {"image 2 has no name", [](auto& m) { FirstImage(m).name.clear(); }},
      {"image 2 names camera 999, which is not in the model",
       [](auto& m) { FirstImage(m).camera_id = 999; }},
      {"image 2 is in no frame", [](auto& m) { FirstImage(m).frame_id = kInvalidId32; }},
      {"image 2 names frame 12345, which is not in the model",
       [](auto& m) { FirstImage(m).frame_id = 12345; }},
      {"image 2 names frame 37, which does not name the image",
       [](auto& m) { FirstImage(m).frame_id = 37; }},
      {"but frame 40 has it as data of camera",
       [](auto& m) { FirstImage(m).camera_id = m.images.at(1).camera_id; }},
      {"the pose of image 2 is not that of frame 40 and its rig",
       [](auto& m) { FirstImage(m).cam_from_world.translation[0] += 0.01; }},
      {"image 2 has a rotation quaternion of norm 0, expected 1",
       [](auto& m) { FirstImage(m).cam_from_world.rotation.coeffs().setZero(); }},
      {"image 2 has a rotation that is not finite",
       [](auto& m) { FirstImage(m).cam_from_world.rotation.x() = kNan; }},
      {"point 3 of image 2 is not finite", [](auto& m) { FirstImage(m).points2D[3].xy[1] = kNan; }},
      {"line 2 of image 2 is not finite",
       [](auto& m) { FirstImage(m).lines2D[2].segment.end[0] = kNan; }},
      {"has a position that is not finite", [](auto& m) { First(m.points3D).xyz[2] = kNan; }},
      {"names image 12345, which is not in the model",
       [](auto& m) { TrackedPoint(m).track[0].image_id = 12345; }},
      {"which has", [](auto& m) { TrackedPoint(m).track[0].point2D_idx = 1000; }},
      {"which names no 3D point",
       [](auto& m) {
         const PointObservation& o = TrackedPoint(m).track[0];
         m.images.at(o.image_id).points2D[o.point2D_idx].point3D_id = kNoId;
       }},
      {"twice", [](auto& m) { TrackedPoint(m).track.push_back(TrackedPoint(m).track[0]); }},
      {"which does not name it back", [](auto& m) { TrackedPoint(m).track.pop_back(); }},
      {"names 3D point 4711, which is not in the model",
       [](auto& m) {
         for (Point2D& point : FirstImage(m).points2D) {
           if (point.point3D_id == kNoId) point.point3D_id = 4711;
         }
       }},
      {"has a direction of length", [](auto& m) { First(m.lines3D).line.direction *= 1.001; }},
      {"has a moment that is not perpendicular to its direction",
       [](auto& m) { First(m.lines3D).line.moment += 0.001 * First(m.lines3D).line.direction; }},
      {"has an end that is not finite", [](auto& m) { First(m.lines3D).end[0] = kNan; }},
      {"which names 3D line",
       [](auto& m) {
         const LineObservation& o = TrackedLine(m).track[0];
         uint64_t& id = m.images.at(o.image_id).lines2D[o.line2D_idx].line3D_id;
         id = id == 6 ? 14 : 6;
       }},
      {"which does not name it back", [](auto& m) { TrackedLine(m).track.pop_back(); }},
      {"is a VP, which takes no points",
       [](auto& m) { ObservedGroup(m, "VP").point3D_ids.push_back(2); }},
      {"is a SPHERE, which takes no lines",
       [](auto& m) { FirstObservation(m, ObservedGroup(m, "SPHERE")).line2D_idxs.push_back(0); }},
      {"is a PLANE without members",
       [](auto& m) {
         FirstObservation(m, ObservedGroup(m, "PLANE")).point2D_idxs.clear();
         FirstObservation(m, ObservedGroup(m, "PLANE")).line2D_idxs.clear();
       }},
      {"has no type", [](auto& m) { First(m.groups3D).type = nullptr; }},
      {"has point 2 twice among its members",
       [](auto& m) { ObservedGroup(m, "PLANE").point3D_ids = {2, 4, 2}; }},
      {"names 3D point 4711, which is not in the model",
       [](auto& m) { ObservedGroup(m, "PLANE").point3D_ids.push_back(4711); }},
      {"names 3D line 4711, which is not in the model",
       [](auto& m) { ObservedGroup(m, "VP").line3D_ids.push_back(4711); }},
      {"names point 1000, but its image has",
       [](auto& m) {
         FirstObservation(m, ObservedGroup(m, "PLANE")).point2D_idxs.push_back(1000);
       }},
      {"names line 1000, but its image has",
       [](auto& m) { FirstObservation(m, ObservedGroup(m, "PLANE")).line2D_idxs.push_back(1000); }},
      {"has 3 parameters, but a PLANE has 4",
       [](auto& m) { ObservedGroup(m, "PLANE").params.pop_back(); }},
      {"has parameters that are no SPHERE",
       [](auto& m) { ObservedGroup(m, "SPHERE").params[3] = -1.0; }},
      {"has a parameter that is not finite",
       [](auto& m) { ObservedGroup(m, "SPHERE").params[0] = kNan; }},
      {"which names no 3D group",
       [](auto& m) { FirstObservation(m, ObservedGroup(m, "CONE")).group3D_id = kNoId; }},
      {"which does not name it back",
       [](auto& m) { ObservedGroup(m, "CONE").observations.pop_back(); }},
      {"is a PLANE, but its observation",
       [](auto& m) {
         FirstObservation(m, ObservedGroup(m, "PLANE")).type = FindGroupType("CUBOID");
       }},
      {"the wireframe names 3D point 4711", [](auto& m) { m.wireframe.push_back({4711, 2, 1}); }},
      {"the wireframe names 3D line 4711", [](auto& m) { m.wireframe.push_back({2, 4711, 1}); }},
      {"the wireframe has point", [](auto& m) { m.wireframe.push_back(m.wireframe[0]); }},
      {"a relation names group 4711", [](auto& m) { m.relations[0].group3D_id1 = 4711; }},
      {"but a SPHERE has no direction",
       [](auto& m) {
         for (auto& [id, group] : m.groups3D) {
           if (group.type->name == "SPHERE") m.relations[0].group3D_id2 = id;
         }
       }},
      {"and itself", [](auto& m) { m.relations[0].group3D_id1 = m.relations[0].group3D_id2; }},
      {"have two relations",
       [](auto& m) {
         m.relations.push_back(
             {m.relations[0].group3D_id2, m.relations[0].group3D_id1, RelationType::kParallel});
       }},
  };
  const Reconstruction model = RandomModel(1);
  ASSERT_EQ(model.FindInconsistency(), std::nullopt);
  for (size_t i = 0; i < faults.size(); ++i) {
    Reconstruction broken = model;
    faults[i].make(broken);
    const std::optional<std::string> found = broken.FindInconsistency();
    ASSERT_TRUE(found.has_value()) << "fault " << i << ": " << faults[i].message;
    EXPECT_THAT(*found, testing::HasSubstr(faults[i].message));
  }
}

}  // namespace
}  // namespace holba
