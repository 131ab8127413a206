// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/filter_model.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "holba/bundle/reprojection.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

// Whether two of the rays meet at this angle or more.
bool HasAngle(const Reconstruction& model, const Point3D& point, double max_cos,
              std::vector<Eigen::Vector3d>* rays) {
  rays->clear();
  for (const PointObservation& observation : point.track) {
    const Image& image = model.images.at(observation.image_id);
    const Eigen::Vector3d ray = (point.xyz - image.cam_from_world.OriginInA()).normalized();
    for (const Eigen::Vector3d& other : *rays) {
      if (ray.dot(other) <= max_cos) return true;
    }
    rays->push_back(ray);
  }
  return false;
}

}  // namespace

size_t FilterPoints(const FilterOptions& options, std::span<const point3D_t> point_ids,
                    MapperState* state) {
  const Reconstruction& model = state->model();
  const double max_squared = options.max_error_px * options.max_error_px;
  const double max_cos = std::cos(DegToRad(options.min_angle_deg));
  size_t num_removed = 0;
  std::vector<Eigen::Vector3d> rays;
  for (const point3D_t id : point_ids) {
    const Point3D* point = model.points3D.Find(id);
    if (point == nullptr) continue;
    std::vector<PointObservation> wrong;
    for (const PointObservation& observation : point->track) {
      const Image& image = model.images.at(observation.image_id);
      const auto pixel = PixelOf(model, image, point->xyz);
      const bool fits =
          pixel &&
          (*pixel - image.points2D[observation.point2D_idx].xy).squaredNorm() <= max_squared;
      if (!fits) wrong.push_back(observation);
    }
    if (wrong.size() + 1 >= point->track.size()) {
      num_removed += point->track.size();
      state->DeletePoint(id);
      continue;
    }
    for (const PointObservation& observation : wrong) state->Forget(observation);
    num_removed += wrong.size();
    if (!HasAngle(model, *point, max_cos, &rays)) {
      num_removed += point->track.size();
      state->DeletePoint(id);
    }
  }
  return num_removed;
}

size_t FilterAllPoints(const FilterOptions& options, MapperState* state) {
  std::vector<point3D_t> ids;
  ids.reserve(state->model().points3D.size());
  for (const auto& [id, point] : state->model().points3D) ids.push_back(id);
  return FilterPoints(options, ids, state);
}

bool IsPlausible(const FilterOptions& options, const Camera& camera) {
  const double size = static_cast<double>(std::max(camera.width, camera.height));
  for (const int idx : camera.model->focal_idxs) {
    const double ratio = camera.params[idx] / size;
    if (!(ratio >= options.min_focal_length_ratio && ratio <= options.max_focal_length_ratio))
      return false;
  }
  for (const int idx : camera.model->extra_idxs) {
    if (!(std::abs(camera.params[idx]) <= options.max_extra_param)) return false;
  }
  const Eigen::Vector2d middle(0.5 * static_cast<double>(camera.width),
                               0.5 * static_cast<double>(camera.height));
  const auto xy = camera.model->principal_point_idxs;
  const Eigen::Vector2d shift(camera.params[xy[0]] - middle.x(), camera.params[xy[1]] - middle.y());
  return std::abs(shift.x()) <= middle.x() && std::abs(shift.y()) <= middle.y();
}

std::vector<image_t> FilterFrames(const FilterOptions& options, MapperState* state) {
  const Reconstruction& model = state->model();
  std::set<frame_t> frames_with_points, wrong;
  for (const auto& [id, image] : model.images) {
    const bool sees = std::any_of(image.points2D.begin(), image.points2D.end(),
                                  [](const Point2D& p) { return p.point3D_id != kNoId; }) ||
                      std::any_of(image.lines2D.begin(), image.lines2D.end(),
                                  [](const Line2D& l) { return l.line3D_id != kNoId; });
    if (sees) frames_with_points.insert(image.frame_id);
    if (!IsPlausible(options, model.cameras.at(image.camera_id))) wrong.insert(image.frame_id);
  }
  std::vector<image_t> removed;
  std::vector<frame_t> frames;
  for (const auto& [id, frame] : model.frames) {
    if (state->existing_frames.contains(id)) continue;
    if (wrong.contains(id) || !frames_with_points.contains(id)) frames.push_back(id);
  }
  for (const frame_t id : frames) {
    for (const Frame::Data& data : model.frames.at(id).data) {
      if (data.sensor.type == SensorType::kCamera &&
          model.images.contains(static_cast<image_t>(data.data_id)))
        removed.push_back(static_cast<image_t>(data.data_id));
    }
    state->DeregisterFrame(id);
  }
  return removed;
}

}  // namespace holba
