// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/reconstruction.h"

#include <algorithm>
#include <string>

#include "holba/base/check.h"

namespace holba {
namespace {

SensorId CameraSensor(camera_t camera_id) { return {SensorType::kCamera, camera_id}; }

const Rigid3d& SensorPose(const Rig& rig, const SensorId& sensor) {
  static const Rigid3d kIdentity;
  if (rig.ref_sensor == sensor) return kIdentity;
  for (const Rig::Sensor& other : rig.sensors) {
    if (other.id != sensor) continue;
    HOLBA_CHECK_MSG(other.sensor_from_rig.has_value(),
                    "sensor " + std::to_string(sensor.id) + " has no known pose in its rig");
    return *other.sensor_from_rig;
  }
  HOLBA_CHECK_MSG(false, "sensor " + std::to_string(sensor.id) + " is not in the rig");
  return kIdentity;
}

}  // namespace

void Reconstruction::AddTrivialRigsAndFrames() {
  const auto add = [&](IdMap<image_t, Image>* of_images, IdMap<frame_t, Frame>* of_frames) {
    for (auto& [image_id, image] : *of_images) {
      if (image.frame_id != kInvalidId32 && of_frames->contains(image.frame_id)) continue;
      const SensorId sensor = CameraSensor(image.camera_id);
      rig_t rig_id = image.camera_id;
      const Rig* rig = rigs.Find(rig_id);
      if (rig != nullptr && (rig->ref_sensor != sensor || !rig->sensors.empty())) {
        // The camera's own id is taken by another rig: any rig of this camera alone will do.
        const auto own = std::find_if(rigs.begin(), rigs.end(), [&](const auto& entry) {
          return entry.second.ref_sensor == sensor && entry.second.sensors.empty();
        });
        rig_id = own != rigs.end() ? own->first : rigs.NextId();
      }
      if (!rigs.contains(rig_id)) rigs.Add(rig_id, {.ref_sensor = sensor, .sensors = {}});
      const bool is_taken = frames.contains(image_id) || unregistered_frames.contains(image_id);
      image.frame_id = is_taken ? std::max(frames.NextId(), unregistered_frames.NextId()) : image_id;
      of_frames->Add(image.frame_id, {.rig_id = rig_id,
                                      .rig_from_world = image.cam_from_world,
                                      .data = {{.sensor = sensor, .data_id = image_id}}});
    }
  };
  add(&images, &frames);
  add(&unregistered_images, &unregistered_frames);
}

const Rigid3d& Reconstruction::SensorFromRig(const Image& image) const {
  const Frame* frame = frames.Find(image.frame_id);
  if (frame == nullptr) frame = &unregistered_frames.at(image.frame_id);
  return SensorPose(rigs.at(frame->rig_id), CameraSensor(image.camera_id));
}

void Reconstruction::SetFramePose(frame_t frame_id, const Rigid3d& rig_from_world) {
  Frame& frame = frames.at(frame_id);
  frame.rig_from_world = rig_from_world;
  const Rig& rig = rigs.at(frame.rig_id);
  for (const Frame::Data& data : frame.data) {
    if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
    Image* image = images.Find(static_cast<image_t>(data.data_id));
    if (image == nullptr) continue;  // a frame may name images that the model does not hold
    // Not a product with the identity: the reference sensor has the bits of the frame's pose.
    image->cam_from_world = rig.ref_sensor == data.sensor
                                ? rig_from_world
                                : SensorPose(rig, data.sensor) * rig_from_world;
  }
}

Eigen::Vector3d Reconstruction::CameraCentre(image_t image_id) const {
  return images.at(image_id).cam_from_world.OriginInA();
}

void Reconstruction::Transform(const Sim3d& new_from_old) {
  for (auto& [rig_id, rig] : rigs) {
    for (Rig::Sensor& sensor : rig.sensors) {
      if (sensor.sensor_from_rig) sensor.sensor_from_rig->translation *= new_from_old.scale;
    }
  }
  for (auto& [frame_id, frame] : frames) {
    SetFramePose(frame_id, new_from_old.TransformPose(frame.rig_from_world));
  }
  for (auto& [image_id, image] : images) {
    if (frames.contains(image.frame_id)) continue;
    image.cam_from_world = new_from_old.TransformPose(image.cam_from_world);
  }
  for (auto& [point3D_id, point] : points3D) point.xyz = new_from_old * point.xyz;
  for (auto& [line3D_id, line] : lines3D) {
    line.line = holba::Transform(new_from_old, line.line);
    line.start = new_from_old * line.start;
    line.end = new_from_old * line.end;
  }
  for (auto& [group3D_id, group] : groups3D) {
    double old_params[kMaxGroupParams], new_params[kMaxGroupParams];
    HOLBA_CHECK_MSG(group.type != nullptr && group.type->from_file(group.params.data(), old_params),
                    "group " + std::to_string(group3D_id) + " is invalid");
    group.type->transform(new_from_old, old_params, new_params);
    group.type->to_file(new_params, group.params.data());
  }
}

}  // namespace holba
