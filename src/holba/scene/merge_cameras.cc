// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/merge_cameras.h"

#include <map>

#include "holba/base/check.h"

namespace holba {
namespace {

// The camera that is all of a rig.
std::map<rig_t, camera_t> CamerasAlone(const Reconstruction& model) {
  std::map<rig_t, camera_t> alone;
  std::map<camera_t, int> num_rigs;
  for (const auto& [id, rig] : model.rigs) {
    if (rig.ref_sensor && rig.ref_sensor->type == SensorType::kCamera) {
      ++num_rigs[rig.ref_sensor->id];
      if (rig.sensors.empty()) alone[id] = rig.ref_sensor->id;
    }
    for (const Rig::Sensor& sensor : rig.sensors)
      if (sensor.id.type == SensorType::kCamera) ++num_rigs[sensor.id.id];
  }
  std::erase_if(alone, [&](const auto& entry) { return num_rigs.at(entry.second) > 1; });
  return alone;
}

}  // namespace

std::set<camera_t> CamerasOfTrivialRigs(const Reconstruction& model) {
  std::set<camera_t> cameras;
  for (const auto& [rig, camera] : CamerasAlone(model)) cameras.insert(camera);
  const auto check_frames = [&](const IdMap<frame_t, Frame>& frames) {
    for (const auto& [id, frame] : frames) {
      if (frame.data.size() == 1) continue;
      // GPS or inertial data beside the image.
      for (const Frame::Data& data : frame.data)
        if (data.sensor.type == SensorType::kCamera) cameras.erase(data.sensor.id);
    }
  };
  check_frames(model.frames);
  check_frames(model.unregistered_frames);
  return cameras;
}

void MergeCameras(camera_t kept, const std::set<camera_t>& others, Reconstruction* model) {
  const std::map<rig_t, camera_t> alone = CamerasAlone(*model);
  rig_t kept_rig = kInvalidId32;
  std::set<rig_t> other_rigs;
  for (const auto& [rig, camera] : alone) {
    if (camera == kept) kept_rig = rig;
    if (camera != kept && others.contains(camera)) other_rigs.insert(rig);
  }
  HOLBA_CHECK(kept_rig != kInvalidId32);
  HOLBA_CHECK(other_rigs.size() == others.size() - others.count(kept));

  const auto move_images = [&](IdMap<image_t, Image>* images) {
    for (auto& [id, image] : *images)
      if (others.contains(image.camera_id)) image.camera_id = kept;
  };
  move_images(&model->images);
  move_images(&model->unregistered_images);
  const auto move_frames = [&](IdMap<frame_t, Frame>* frames) {
    for (auto& [id, frame] : *frames) {
      if (!other_rigs.contains(frame.rig_id)) continue;
      frame.rig_id = kept_rig;
      for (Frame::Data& data : frame.data) data.sensor.id = kept;
    }
  };
  move_frames(&model->frames);
  move_frames(&model->unregistered_frames);
  model->rigs.RemoveIf([&](rig_t id, const Rig&) { return other_rigs.contains(id); });
  model->cameras.RemoveIf(
      [&](camera_t id, const Camera&) { return id != kept && others.contains(id); });
}

}  // namespace holba
