// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <optional>
#include <set>

#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/reprojection.h"

namespace holba {
namespace {

bool Moves(const BundleProblem& bundle, BlockId id) {
  return bundle.problem.block(id).FreeTangent() > 0;
}

Eigen::Vector3d VectorAt(const double* values) { return Eigen::Map<const Eigen::Vector3d>(values); }

Rigid3d PoseAt(const double* v) {
  return {Eigen::Quaterniond(v[3], v[0], v[1], v[2]), VectorAt(v + 4)};
}

// Returns the rigs whose sensors moved; the poses of their images have to follow.
std::set<rig_t> WriteSensors(const BundleProblem& bundle, Reconstruction* model) {
  std::set<rig_t> rigs;
  for (const auto& [id, block] : bundle.sensors) {
    if (!Moves(bundle, block)) continue;
    for (Rig::Sensor& sensor : model->rigs.at(id.rig_id).sensors) {
      if (sensor.id == SensorId{SensorType::kCamera, id.camera_id})
        sensor.sensor_from_rig = PoseAt(bundle.problem.values(block));
    }
    rigs.insert(id.rig_id);
  }
  return rigs;
}

void UpdateError(const Reconstruction& model, Point3D* point) {
  double sum = 0.0;
  size_t count = 0;
  for (const PointObservation& observation : point->track) {
    const Image& image = model.images.at(observation.image_id);
    const std::optional<Eigen::Vector2d> pixel = PixelOf(model, image, point->xyz);
    if (!pixel) continue;
    sum += (*pixel - image.points2D[observation.point2D_idx].xy).norm();
    ++count;
  }
  point->error = count ? sum / static_cast<double>(count) : -1.0;
}

void UpdateError(const Reconstruction& model, Line3D* line) {
  double sum = 0.0;
  size_t count = 0;
  for (const LineObservation& observation : line->track) {
    const std::optional<Eigen::Vector4d> rho =
        EndOffsets(model, model.images.at(observation.image_id), line->line, observation);
    if (!rho) continue;
    sum += std::sqrt(0.5) * rho->norm();
    ++count;
  }
  line->error = count ? sum / static_cast<double>(count) : -1.0;
}

}  // namespace

void WriteBack(const BundleProblem& bundle, Reconstruction* model) {
  const std::set<rig_t> rigs = WriteSensors(bundle, model);
  for (const auto& [id, block] : bundle.poses) {
    if (Moves(bundle, block)) model->SetFramePose(id, PoseAt(bundle.problem.values(block)));
  }
  if (!rigs.empty()) {
    for (const auto& [id, frame] : model->frames) {
      if (rigs.contains(frame.rig_id)) model->SetFramePose(id, Rigid3d(frame.rig_from_world));
    }
  }
  for (const auto& [id, block] : bundle.cameras) {
    if (!Moves(bundle, block)) continue;
    Camera& camera = model->cameras.at(id);
    const double* v = bundle.problem.values(block);
    camera.params.assign(v, v + camera.model->num_params);
  }
  for (const auto& [id, block] : bundle.points) {
    if (Moves(bundle, block)) model->points3D.at(id).xyz = VectorAt(bundle.problem.values(block));
  }
  for (const auto& [id, block] : bundle.lines) {
    if (!Moves(bundle, block)) continue;
    Line3D& line = model->lines3D.at(id);
    const double* v = bundle.problem.values(block);
    line.line = PlueckerLine::FromPointDirection(VectorAt(v + 3), VectorAt(v));
    line.start = line.line.ClosestPoint(line.start);
    line.end = line.line.ClosestPoint(line.end);
  }
  for (const auto& [id, block] : bundle.groups) {
    if (!Moves(bundle, block)) continue;
    Group3D& group = model->groups3D.at(id);
    group.type->to_file(bundle.problem.values(block), group.params.data());
  }
}

void UpdateErrors(Reconstruction* model) {
  for (auto& [id, point] : model->points3D) UpdateError(*model, &point);
  for (auto& [id, line] : model->lines3D) UpdateError(*model, &line);
}

void UpdateErrors(const BundleSelection& selection, Reconstruction* model) {
  for (const auto& point : selection.points) UpdateError(*model, &model->points3D.at(point.id));
  for (const auto& line : selection.lines) UpdateError(*model, &model->lines3D.at(line.id));
  for (const auto& point : selection.points_seen_once)
    UpdateError(*model, &model->points3D.at(point.id));
  for (const auto& line : selection.lines_seen_once)
    UpdateError(*model, &model->lines3D.at(line.id));
}

}  // namespace holba
