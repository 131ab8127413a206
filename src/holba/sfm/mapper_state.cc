// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/mapper_state.h"

#include <algorithm>
#include <array>
#include <utility>

#include "holba/base/check.h"

namespace holba {
namespace {

// Cells of a grid on each of several levels; each cell that is seen for the first time adds the
// number of cells of its level (COLMAP's VisibilityPyramid).
class VisibilityPyramid {
 public:
  VisibilityPyramid(uint64_t width, uint64_t height)
      : width_(static_cast<double>(width)), height_(static_cast<double>(height)) {
    for (int level = 0; level < kNumLevels; ++level)
      cells_[level].resize(size_t{1} << (2 * (level + 1)));
  }
  void Add(const Eigen::Vector2d& pixel) {
    for (int level = 0; level < kNumLevels; ++level) {
      const int size = 2 << level;
      const int x = std::clamp(static_cast<int>(size * pixel.x() / width_), 0, size - 1);
      const int y = std::clamp(static_cast<int>(size * pixel.y() / height_), 0, size - 1);
      const size_t cell = static_cast<size_t>(y) * size + x;
      if (cells_[level][cell]) continue;
      cells_[level][cell] = true;
      score_ += cells_[level].size();
    }
  }
  size_t score() const { return score_; }

 private:
  static constexpr int kNumLevels = 6;
  double width_, height_;
  std::array<std::vector<bool>, kNumLevels> cells_;
  size_t score_ = 0;
};

}  // namespace

MapperState::MapperState(const MappingInput& input, Reconstruction scene)
    : input_(&input), model_(std::move(scene)) {
  for (const auto& [id, camera] : model_.cameras) given_params[id] = camera.params;
  for (const auto& [id, frame] : model_.frames) existing_frames.insert(id);
  ForgetCounts();
}

void MapperState::ForgetCounts() {
  visibility_.clear();
  touched_.clear();
  stale_.clear();
  num_registered_.clear();
  for (const auto& [id, image] : model_.images) ++num_registered_[image.camera_id];
}

void MapperState::TakeCameras(Reconstruction model) {
  // An image that is registered again begins with the lens that is known.
  for (const auto& [id, camera] : model.cameras) {
    if (NumRegistered(id) > 0 || camera.model != model_.cameras.at(id).model)
      given_params[id] = camera.params;
  }
  model_ = std::move(model);
  num_registered_.clear();
  for (const auto& [id, image] : model_.images) ++num_registered_[image.camera_id];
}

std::vector<image_t> MapperState::ImagesOfFrame(image_t image_id) const {
  const frame_t frame_id = model_.FindImage(image_id)->frame_id;
  const Frame* frame = model_.frames.Find(frame_id);
  if (frame == nullptr) frame = &model_.unregistered_frames.at(frame_id);
  std::vector<image_t> ids;
  for (const Frame::Data& data : frame->data) {
    if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
    const auto id = static_cast<image_t>(data.data_id);
    if (model_.FindImage(id) != nullptr) ids.push_back(id);
  }
  return ids;
}

bool MapperState::IsFocalLengthKnown(camera_t camera_id) const {
  return input_->cameras_of_known_focal_length.contains(camera_id);
}

size_t MapperState::NumRegistered(camera_t camera_id) const {
  const auto found = num_registered_.find(camera_id);
  return found != num_registered_.end() ? found->second : 0;
}

void MapperState::RegisterFrame(frame_t frame_id, const Rigid3d& rig_from_world) {
  model_.RegisterFrame(frame_id, rig_from_world);
  for (const Frame::Data& data : model_.frames.at(frame_id).data) {
    if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
    const Image* image = model_.images.Find(static_cast<image_t>(data.data_id));
    if (image == nullptr) continue;
    ++num_registered_[image->camera_id];
    visibility_.erase(static_cast<image_t>(data.data_id));
  }
}

void MapperState::DeregisterFrame(frame_t frame_id) {
  for (const Frame::Data& data : model_.frames.at(frame_id).data) {
    if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
    const auto image_id = static_cast<image_t>(data.data_id);
    const Image* image = model_.images.Find(image_id);
    if (image == nullptr) continue;
    --num_registered_[image->camera_id];
    for (const Point2D& point : image->points2D) {
      if (point.point3D_id == kNoId) continue;
      TouchTrack(model_.points3D.at(point.point3D_id));
      modified_points_.insert(point.point3D_id);
    }
    for (const Line2D& line : image->lines2D) {
      if (line.line3D_id != kNoId) TouchTrack(model_.lines3D.at(line.line3D_id));
    }
    Touch(image_id);
  }
  model_.DeregisterFrame(frame_id);
}

point3D_t MapperState::AddPoint(const Eigen::Vector3d& xyz,
                                std::span<const PointObservation> track) {
  const point3D_t id = model_.AddPoint3D(xyz, track);
  TouchTrack(model_.points3D.at(id));
  modified_points_.insert(id);
  return id;
}

void MapperState::Observe(point3D_t point3D_id, const PointObservation& observation) {
  model_.AddObservation(point3D_id, observation);
  Touch(observation.image_id);
  modified_points_.insert(point3D_id);
}

bool MapperState::Forget(const PointObservation& observation) {
  const point3D_t id =
      model_.images.at(observation.image_id).points2D[observation.point2D_idx].point3D_id;
  Touch(observation.image_id);
  if (model_.points3D.at(id).track.size() <= 2) {
    DeletePoint(id);
    return false;
  }
  model_.DeleteObservation(observation);
  modified_points_.insert(id);
  return true;
}

void MapperState::DeletePoint(point3D_t point3D_id) {
  TouchTrack(model_.points3D.at(point3D_id));
  model_.DeletePoint3D(point3D_id);
  modified_points_.erase(point3D_id);
}

void MapperState::MergePoints(point3D_t id, point3D_t other) {
  TouchTrack(model_.points3D.at(other));
  model_.MergePoints3D(id, other);
  modified_points_.erase(other);
  modified_points_.insert(id);
}

line3D_t MapperState::AddLine(const PlueckerLine& line, const Eigen::Vector3d& start,
                              const Eigen::Vector3d& end, std::span<const LineObservation> track) {
  const line3D_t id = model_.AddLine3D(line, start, end, track);
  TouchTrack(model_.lines3D.at(id));
  return id;
}

void MapperState::Observe(line3D_t line3D_id, const LineObservation& observation) {
  model_.AddObservation(line3D_id, observation);
  Touch(observation.image_id);
}

bool MapperState::Forget(const LineObservation& observation) {
  const line3D_t id =
      model_.images.at(observation.image_id).lines2D[observation.line2D_idx].line3D_id;
  Touch(observation.image_id);
  if (model_.lines3D.at(id).track.size() <= 2) {
    DeleteLine(id);
    return false;
  }
  model_.DeleteObservation(observation);
  return true;
}

void MapperState::DeleteLine(line3D_t line3D_id) {
  TouchTrack(model_.lines3D.at(line3D_id));
  model_.DeleteLine3D(line3D_id);
}

void MapperState::MergeLines(line3D_t id, line3D_t other) {
  TouchTrack(model_.lines3D.at(other));
  model_.MergeLines3D(id, other);
}

std::vector<point3D_t> MapperState::TakeModifiedPoints() {
  std::vector<point3D_t> ids(modified_points_.begin(), modified_points_.end());
  modified_points_.clear();
  return ids;
}

void MapperState::Touch(image_t image_id) { touched_.insert(image_id); }

void MapperState::TouchTrack(const Point3D& point) {
  for (const PointObservation& observation : point.track) Touch(observation.image_id);
}

void MapperState::TouchTrack(const Line3D& line) {
  for (const LineObservation& observation : line.track) Touch(observation.image_id);
}

const ImageVisibility& MapperState::VisibilityOf(image_t image_id) {
  for (const image_t touched : touched_) {
    for (const MatchedImage& matched : graph().MatchedImages(touched))
      stale_.insert(matched.image_id);
  }
  touched_.clear();
  const auto [entry, is_new] = visibility_.try_emplace(image_id);
  if (is_new || stale_.contains(image_id)) {
    entry->second = Count(image_id);
    stale_.erase(image_id);
  }
  return entry->second;
}

ImageVisibility MapperState::Count(image_t image_id) const {
  const Image& image = model_.unregistered_images.at(image_id);
  const Camera& camera = model_.cameras.at(image.camera_id);
  VisibilityPyramid pyramid(camera.width, camera.height);
  ImageVisibility visibility;
  for (point2D_t idx = 0; idx < image.points2D.size(); ++idx) {
    for (const Correspondence& other : graph().CorrespondencesOf(image_id, idx)) {
      const Image* seen = model_.images.Find(other.image_id);
      if (seen == nullptr || seen->points2D[other.point2D_idx].point3D_id == kNoId) continue;
      ++visibility.num_points;
      pyramid.Add(image.points2D[idx].xy);
      break;
    }
  }
  for (line2D_t idx = 0; idx < image.lines2D.size() && idx < graph().NumSegments(image_id); ++idx) {
    for (const LineCorrespondence& other : graph().LineCorrespondencesOf(image_id, idx)) {
      const Image* seen = model_.images.Find(other.image_id);
      if (seen == nullptr || seen->lines2D[other.line2D_idx].line3D_id == kNoId) continue;
      ++visibility.num_lines;
      pyramid.Add(0.5 * (image.lines2D[idx].segment.start + image.lines2D[idx].segment.end));
      break;
    }
  }
  visibility.score = pyramid.score();
  return visibility;
}

}  // namespace holba
