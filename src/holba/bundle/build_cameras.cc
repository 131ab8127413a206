// SPDX-License-Identifier: BSD-3-Clause
// Blocks of poses and intrinsics, and what an image's residuals need of it.
#include <algorithm>

#include "holba/bundle/problem_builder.h"
#include "holba/residual/principal_point_prior.h"

namespace holba {

void ProblemBuilder::AddPosesAndCameras() {
  const auto images = ImagesOf(model_, selection_);
  image_idx_ = FlatIndex(images.size());
  images_.reserve(images.size());
  FlatIndex frame_idx(selection_.frames.size()), camera_idx(selection_.cameras.size());
  for (const auto& frame : selection_.frames) frame_idx.Add(frame.id);
  for (const auto& camera : selection_.cameras) camera_idx.Add(camera.id);
  FlatIndex pose_idx(selection_.frames.size()), intrinsics_idx(selection_.cameras.size());
  for (const SelectedSensor& sensor : selection_.sensors)
    variable_sensor_idx_.Add(SensorKey(sensor.rig_id, sensor.camera_id));
  sensor_blocks_.assign(selection_.sensors.size(), kNoBlock);
  for (const auto& [image_id, image] : images) {
    const Frame& frame = model_.frames.at(image->frame_id);
    const auto [pose, new_pose] = pose_idx.Add(image->frame_id);
    if (new_pose) {
      const BlockId block = AddPoseBlock("pose", BlockRole::kPose, frame.rig_from_world);
      problem_.block(block).constant = selection_.frames[frame_idx.Find(image->frame_id)].constant;
      out_.poses.emplace_back(image->frame_id, block);
    }
    const Camera& camera = model_.cameras.at(image->camera_id);
    const auto [intrinsics, new_camera] = intrinsics_idx.Add(image->camera_id);
    if (new_camera) {
      const BlockId block = problem_.AddBlock("camera", EuclideanOps(camera.model->num_params),
                                              BlockRole::kIntrinsics, camera.params);
      const uint32_t idx = camera_idx.Find(image->camera_id);
      HoldIntrinsics(*camera.model, idx == FlatIndex::kNone || selection_.cameras[idx].constant,
                     &problem_.block(block));
      out_.cameras.emplace_back(image->camera_id, block);
    }
    const BlockId camera_block = out_.cameras[intrinsics].second;
    const BlockId sensor_block = AddSensorBlock(frame, *image);
    image_idx_.Add(image_id);
    images_.push_back({image_id, out_.poses[pose].second, camera_block, sensor_block,
                       sensor_block == kNoBlock ? AddSensorPose(frame, *image) : nullptr,
                       camera.model, camera.params.data(),
                       !camera.model->is_pinhole && problem_.block(camera_block).FreeTangent() > 0,
                       image});
  }
  HoldGauge();
}

BlockId ProblemBuilder::AddPoseBlock(std::string_view kind, BlockRole role, const Rigid3d& pose) {
  const Eigen::Quaterniond q = pose.rotation.normalized();
  const Eigen::Vector3d& t = pose.translation;
  const double values[7] = {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
  return problem_.AddBlock(kind, OpsOf<PoseManifold>(), role, values);
}

// kNoBlock: the pose of the image's sensor is not among those that are adjusted.
BlockId ProblemBuilder::AddSensorBlock(const Frame& frame, const Image& image) {
  if (selection_.sensors.empty()) return kNoBlock;
  const uint32_t idx = variable_sensor_idx_.Find(SensorKey(frame.rig_id, image.camera_id));
  if (idx == FlatIndex::kNone) return kNoBlock;
  BlockId& block = sensor_blocks_[idx];
  if (block == kNoBlock) {
    block = AddPoseBlock("sensor", BlockRole::kSensorPose, model_.SensorFromRig(image));
    problem_.block(block).constant = selection_.sensors[idx].constant;
    out_.sensors.push_back({{frame.rig_id, image.camera_id}, block});
  }
  return block;
}

// Null for the reference sensor of a rig.
const SensorPose* ProblemBuilder::AddSensorPose(const Frame& frame, const Image& image) {
  const Rig& rig = model_.rigs.at(frame.rig_id);
  if (rig.ref_sensor && *rig.ref_sensor == SensorId{SensorType::kCamera, image.camera_id})
    return nullptr;
  const auto [number, is_new] = sensor_idx_.Add(SensorKey(frame.rig_id, image.camera_id));
  if (is_new) {
    const Rigid3d& pose_in_rig = model_.SensorFromRig(image);
    out_.sensor_poses.push_back(std::make_unique<SensorPose>(
        SensorPose{pose_in_rig.RotationMatrix(), pose_in_rig.translation}));
  }
  return out_.sensor_poses[number].get();
}

void ProblemBuilder::HoldIntrinsics(const CameraModel& model, bool constant,
                                    ParameterBlock* block) const {
  const uint32_t free = constant ? 0 : FreeIntrinsics(model, options_);
  block->held = ~free & ((uint32_t{1} << model.num_params) - 1);
  block->constant = free == 0;
}

// Of principal points that move.
void ProblemBuilder::AddPriors() {
  if (!(options_.principal_point_sigma > 0.0)) return;
  for (const auto& [id, block] : out_.cameras) {
    const Camera& camera = model_.cameras.at(id);
    const CameraModel& model = *camera.model;
    const uint32_t held = problem_.block(block).held;
    const auto idxs = model.principal_point_idxs;
    if (problem_.block(block).constant ||
        std::all_of(idxs.begin(), idxs.end(), [&](int idx) { return held >> idx & 1; }))
      continue;
    const auto known = options_.known_principal_points_px.find(id);
    const Eigen::Vector2d known_px =
        known != options_.known_principal_points_px.end()
            ? known->second
            : Eigen::Vector2d(camera.params[idxs[0]], camera.params[idxs[1]]);
    const Eigen::Vector2d size_px(static_cast<double>(camera.width),
                                  static_cast<double>(camera.height));
    BatchOf<PrincipalPointPrior>("principal_point_prior", {model.num_params}, {model.id, -1, 0},
                                 [&] { return PrincipalPointPrior{&model}; })
        .Add(std::array{block}, {known_px, options_.principal_point_sigma * size_px});
  }
}

void ProblemBuilder::HoldGauge() {
  const auto hold = [&](frame_t frame_id, uint32_t held) {
    if (frame_id == kInvalidId32 || held == 0) return;
    for (const auto& [id, block_id] : out_.poses) {
      if (id != frame_id) continue;
      ParameterBlock& block = problem_.block(block_id);
      if (held == FixedGauge::kWholePose) block.constant = true;
      if (!block.constant) block.held |= held;
    }
  };
  const auto hold_gauge = [&](const FixedGauge& gauge) {
    hold(gauge.origin_frame, gauge.origin_held);
    hold(gauge.scale_frame, gauge.scale_held);
    for (const auto& [sensor, block_id] : out_.sensors) {
      ParameterBlock& block = problem_.block(block_id);
      if (sensor.rig_id == gauge.scale_rig && sensor.camera_id == gauge.scale_camera &&
          !block.constant)
        block.held |= gauge.scale_held;
    }
  };
  hold_gauge(selection_.gauge);
  for (const FixedGauge& gauge : selection_.gauges_of_other_parts) hold_gauge(gauge);
}

}  // namespace holba
