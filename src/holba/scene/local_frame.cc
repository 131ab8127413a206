// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/local_frame.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "holba/base/check.h"
#include "holba/group/group_type.h"

namespace holba {
namespace {

// So many points say where the middle is and how wide the scene is.
constexpr size_t kMaxPoints = 10000;
// Of the cameras' box in its normalised form.
constexpr double kExtent = 10.0;
// Cameras within this share of the width of the points are one camera that turns: how they scatter
// says nothing about the size of the scene.
constexpr double kMinShareOfPoints = 1e-3;

std::vector<Eigen::Vector3d> SomePoints(const Reconstruction& model) {
  const size_t step = model.points3D.size() / kMaxPoints + 1;
  std::vector<Eigen::Vector3d> points;
  size_t i = 0;
  for (const auto& [id, point] : model.points3D) {
    if (i++ % step == 0) points.push_back(point.xyz);
  }
  return points;
}

// Of some centres of cameras or points: those that are far from the others do not count.
struct Extent {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double diagonal = 0.0;
};

// Mean and box of the coordinates between the 10th and the 90th percentile along each axis.
Extent ExtentOf(const std::vector<Eigen::Vector3d>& points) {
  constexpr double kLowest = 0.1, kHighest = 0.9;
  Extent extent;
  const size_t n = points.size();
  if (n == 0) return extent;
  const size_t first = n > 3 ? static_cast<size_t>(kLowest * static_cast<double>(n - 1)) : 0;
  // Up, as COLMAP 4.2 has it; COLMAP 3.8 rounds it down.
  const size_t last =
      n > 3 ? static_cast<size_t>(std::ceil(kHighest * static_cast<double>(n - 1))) : n - 1;
  Eigen::Vector3d box;
  std::vector<double> values(n);
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < n; ++i) values[i] = points[i][axis];
    std::sort(values.begin(), values.end());
    box[axis] = values[last] - values[first];
    double sum = 0.0;
    for (size_t i = first; i <= last; ++i) sum += values[i];
    extent.middle[axis] = sum / static_cast<double>(last - first + 1);
  }
  extent.diagonal = box.norm();
  return extent;
}

std::vector<Eigen::Vector3d> CameraCentres(const Reconstruction& model) {
  std::vector<Eigen::Vector3d> centres;
  for (const auto& [id, image] : model.images) {
    centres.push_back(image.cam_from_world.OriginInA());
  }
  return centres;
}

// The middle at the origin, `unit` long as 1.
Sim3d To(const Eigen::Vector3d& middle, double unit) {
  Sim3d new_from_old;
  if (std::isnormal(unit)) new_from_old.scale = 1.0 / unit;
  new_from_old.translation = -new_from_old.scale * middle;
  return new_from_old;
}

// Not inlined: what is moved, and what is compared with it later, are to be the same bits on every
// platform, also where multiplications and additions are fused.
[[gnu::noinline]] Rigid3d Moved(const Sim3d& by, const Rigid3d& pose) {
  return by.TransformPose(pose);
}
[[gnu::noinline]] Eigen::Vector3d Moved(const Sim3d& by, const Eigen::Vector3d& X) {
  return by * X;
}
[[gnu::noinline]] PlueckerLine Moved(const Sim3d& by, const PlueckerLine& line) {
  return Transform(by, line);
}
[[gnu::noinline]] std::vector<double> Moved(const Sim3d& by, const GroupType& type,
                                            const std::vector<double>& params) {
  double old_params[kMaxGroupParams], new_params[kMaxGroupParams];
  HOLBA_CHECK_MSG(type.from_file(params.data(), old_params), "an invalid group");
  type.transform(by, old_params, new_params);
  std::vector<double> moved(params.size());
  type.to_file(new_params, moved.data());
  return moved;
}

bool Same(const Rigid3d& a, const Rigid3d& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}
bool Same(const PlueckerLine& a, const PlueckerLine& b) {
  return a.direction == b.direction && a.moment == b.moment;
}

}  // namespace

std::optional<Sim3d> NormalisedFromWorld(const Reconstruction& model) {
  if (model.images.empty()) return std::nullopt;
  const Extent extent = ExtentOf(CameraCentres(model));
  // Cameras at one place say nothing about the scale.
  return To(extent.middle, extent.diagonal > 1e-12 ? extent.diagonal / kExtent : 1.0);
}

Sim3d LocalFromWorld(const Reconstruction& model) {
  const Extent cameras = ExtentOf(CameraCentres(model)), points = ExtentOf(SomePoints(model));
  return To(model.images.empty() ? points.middle : cameras.middle,
            std::max(cameras.diagonal, kMinShareOfPoints * points.diagonal) / kExtent);
}

LocalFrame::LocalFrame(Reconstruction* model, Unit unit)
    : model_(*model), local_from_world_(LocalFromWorld(*model)) {
  if (unit == Unit::kUnchanged) {
    local_from_world_.translation /= local_from_world_.scale;
    local_from_world_.scale = 1.0;
  }
  const Sim3d& by = local_from_world_;
  for (auto& [id, rig] : model_.rigs) {
    std::vector<std::optional<Rigid3d>> poses;
    for (Rig::Sensor& sensor : rig.sensors) {
      poses.push_back(sensor.sensor_from_rig);
      if (sensor.sensor_from_rig) sensor.sensor_from_rig->translation *= by.scale;
    }
    sensors_.Add(id, std::move(poses));
  }
  for (const auto& [id, image] : model_.images) images_.Add(id, image.cam_from_world);
  for (const auto& [id, frame] : model_.frames) frames_.Add(id, frame.rig_from_world);
  for (const auto& [id, pose] : frames_) model_.SetFramePose(id, Moved(by, pose));
  for (auto& [id, image] : model_.images) {
    if (!model_.frames.contains(image.frame_id))
      image.cam_from_world = Moved(by, image.cam_from_world);
  }
  for (auto& [id, point] : model_.points3D) {
    points_.Add(id, point.xyz);
    point.xyz = Moved(by, point.xyz);
  }
  for (auto& [id, line] : model_.lines3D) {
    lines_.Add(id, LineGeometry{line.line, line.start, line.end});
    line.line = Moved(by, line.line);
    line.start = Moved(by, line.start);
    line.end = Moved(by, line.end);
  }
  for (auto& [id, group] : model_.groups3D) {
    groups_.Add(id, group.params);
    group.params = Moved(by, *group.type, group.params);
  }
}

LocalFrame::~LocalFrame() {
  const Sim3d& by = local_from_world_;
  const Sim3d world_from_local = by.Inverse();
  const auto restore = [&](const Eigen::Vector3d* world, Eigen::Vector3d* X) {
    *X = world && Moved(by, *world) == *X ? *world : world_from_local * *X;
  };
  std::set<rig_t> changed_rigs;
  for (auto& [id, rig] : model_.rigs) {
    const std::vector<std::optional<Rigid3d>>* world = sensors_.Find(id);
    for (size_t i = 0; i < rig.sensors.size(); ++i) {
      if (!rig.sensors[i].sensor_from_rig) continue;
      Rigid3d& pose = *rig.sensors[i].sensor_from_rig;
      const Rigid3d* old = world && i < world->size() && (*world)[i] ? &*(*world)[i] : nullptr;
      const bool is_old = old && by.scale * old->translation == pose.translation;
      if (!is_old || old->rotation.coeffs() != pose.rotation.coeffs()) changed_rigs.insert(id);
      pose.translation =
          is_old ? old->translation : Eigen::Vector3d(world_from_local.scale * pose.translation);
    }
  }
  for (auto& [id, frame] : model_.frames) {
    const Rigid3d* world = frames_.Find(id);
    const bool is_old = world && Same(Moved(by, *world), frame.rig_from_world);
    model_.SetFramePose(id, is_old ? *world : Moved(world_from_local, frame.rig_from_world));
    if (!is_old || changed_rigs.contains(frame.rig_id)) continue;
    // A file may hold poses of images that differ from that of their frame in the last bit.
    for (const Frame::Data& data : frame.data) {
      if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
      const auto image_id = static_cast<image_t>(data.data_id);
      Image* image = model_.images.Find(image_id);
      const Rigid3d* old = images_.Find(image_id);
      if (image && old) image->cam_from_world = *old;
    }
  }
  for (auto& [id, image] : model_.images) {
    if (model_.frames.contains(image.frame_id)) continue;
    const Rigid3d* world = images_.Find(id);
    const bool is_old = world && Same(Moved(by, *world), image.cam_from_world);
    image.cam_from_world = is_old ? *world : Moved(world_from_local, image.cam_from_world);
  }
  for (auto& [id, point] : model_.points3D) restore(points_.Find(id), &point.xyz);
  for (auto& [id, line] : model_.lines3D) {
    const LineGeometry* world = lines_.Find(id);
    const bool is_old = world && Same(Moved(by, world->line), line.line);
    line.line = is_old ? world->line : Moved(world_from_local, line.line);
    restore(world ? &world->start : nullptr, &line.start);
    restore(world ? &world->end : nullptr, &line.end);
  }
  for (auto& [id, group] : model_.groups3D) {
    const std::vector<double>* world = groups_.Find(id);
    const bool is_old = world && world->size() == group.params.size() &&
                        Moved(by, *group.type, *world) == group.params;
    group.params = is_old ? *world : Moved(world_from_local, *group.type, group.params);
  }
}

}  // namespace holba
