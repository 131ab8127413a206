// SPDX-License-Identifier: BSD-3-Clause
// The verbs of Reconstruction for images and frames and for the 2D features in them.
#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "holba/base/check.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

// Ids of the images of a frame.
std::vector<image_t> ImagesOf(const Frame& frame) {
  std::vector<image_t> ids;
  for (const Frame::Data& data : frame.data) {
    if (data.sensor.type == SensorType::kCamera && data.data_id < kInvalidId32)
      ids.push_back(static_cast<image_t>(data.data_id));
  }
  return ids;
}

// New index of each old one after the removal of those marked; kInvalidId32 for these.
std::vector<uint32_t> NewIndices(const std::vector<bool>& is_removed) {
  std::vector<uint32_t> indices(is_removed.size(), kInvalidId32);
  uint32_t next = 0;
  for (size_t i = 0; i < is_removed.size(); ++i) {
    if (!is_removed[i]) indices[i] = next++;
  }
  return indices;
}

template <typename T>
void EraseMarked(const std::vector<bool>& is_removed, std::vector<T>* list) {
  size_t next = 0;
  for (size_t i = 0; i < is_removed.size(); ++i) {
    if (is_removed[i]) continue;
    if (next != i) (*list)[next] = std::move((*list)[i]);
    ++next;
  }
  list->resize(next);
}

// Of the 2D features that a 2D group names.
void Renumber(const std::vector<uint32_t>& new_indices, std::vector<uint32_t>* idxs) {
  std::erase_if(*idxs, [&](uint32_t idx) { return new_indices[idx] == kInvalidId32; });
  for (uint32_t& idx : *idxs) idx = new_indices[idx];
}

bool HasNoFeature(const Group2D& group) { return group.point2D_idxs.empty() && group.line2D_idxs.empty(); }

}  // namespace

Image* Reconstruction::FindImage(image_t image_id) {
  Image* image = images.Find(image_id);
  return image != nullptr ? image : unregistered_images.Find(image_id);
}
const Image* Reconstruction::FindImage(image_t image_id) const {
  return const_cast<Reconstruction*>(this)->FindImage(image_id);
}

void Reconstruction::AddUnregisteredImage(image_t image_id, Image image) {
  HOLBA_CHECK_MSG(FindImage(image_id) == nullptr, "an image of this id exists");
  HOLBA_CHECK_MSG(cameras.contains(image.camera_id), "an image of no camera");
  image.frame_id = kInvalidId32;
  for (Point2D& point : image.points2D) point.point3D_id = kNoId;
  for (Line2D& line : image.lines2D) line.line3D_id = kNoId;
  for (Group2D& group : image.groups2D) group.group3D_id = kNoId;
  unregistered_images.Add(image_id, std::move(image));
  AddTrivialRigsAndFrames();
}

void Reconstruction::RegisterFrame(frame_t frame_id, const Rigid3d& rig_from_world) {
  const Frame* waiting = unregistered_frames.Find(frame_id);
  HOLBA_CHECK_MSG(waiting != nullptr, "frame " + std::to_string(frame_id) + " is not one that waits");
  HOLBA_CHECK_MSG(!frames.contains(frame_id), "a frame of this id is registered");
  for (const image_t id : ImagesOf(*waiting)) {
    // Fails, before anything is changed, where a sensor's pose in its rig is not known.
    if (const Image* image = unregistered_images.Find(id)) SensorFromRig(*image);
  }
  for (const image_t id : ImagesOf(*waiting)) {
    Image* image = unregistered_images.Find(id);
    if (image == nullptr) continue;  // a frame may name images that the model does not hold
    images.Add(id, std::move(*image));
    unregistered_images.Remove(id);
  }
  frames.Add(frame_id, *waiting);
  unregistered_frames.Remove(frame_id);
  SetFramePose(frame_id, rig_from_world);
}

void Reconstruction::DeregisterFrame(frame_t frame_id) {
  const Frame frame = frames.at(frame_id);
  for (const image_t id : ImagesOf(frame)) {
    Image* image = images.Find(id);
    if (image == nullptr) continue;
    for (point2D_t idx = 0; idx < image->points2D.size(); ++idx) {
      const point3D_t point3D_id = image->points2D[idx].point3D_id;
      if (point3D_id == kNoId) continue;
      DeleteObservation(PointObservation{id, idx});
      if (points3D.at(point3D_id).track.size() < 2) DeletePoint3D(point3D_id);
    }
    for (line2D_t idx = 0; idx < image->lines2D.size(); ++idx) {
      const line3D_t line3D_id = image->lines2D[idx].line3D_id;
      if (line3D_id == kNoId) continue;
      DeleteObservation(LineObservation{id, idx});
      if (lines3D.at(line3D_id).track.size() < 2) DeleteLine3D(line3D_id);
    }
    for (group2D_t idx = 0; idx < image->groups2D.size(); ++idx) {
      if (image->groups2D[idx].group3D_id != kNoId) DeleteObservation(GroupObservation{id, idx});
    }
    unregistered_images.Add(id, std::move(*image));
    images.Remove(id);
  }
  unregistered_frames.Add(frame_id, frame);
  frames.Remove(frame_id);
}

void Reconstruction::RegisterImage(image_t image_id, const Rigid3d& cam_from_world) {
  const Image* image = unregistered_images.Find(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "image " + std::to_string(image_id) + " is not one that waits");
  RegisterFrame(image->frame_id, SensorFromRig(*image).Inverse() * cam_from_world);
}

point2D_t Reconstruction::AddPoint2D(image_t image_id, const Eigen::Vector2d& xy) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  image->points2D.push_back({xy, kNoId});
  return static_cast<point2D_t>(image->points2D.size() - 1);
}
line2D_t Reconstruction::AddLine2D(image_t image_id, const LineSegment2d& segment) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  image->lines2D.push_back({segment, kNoId});
  return static_cast<line2D_t>(image->lines2D.size() - 1);
}
group2D_t Reconstruction::AddGroup2D(image_t image_id, Group2D group) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  HOLBA_CHECK_MSG(group.type != nullptr && !HasNoFeature(group), "a 2D group without type or features");
  for (const point2D_t idx : group.point2D_idxs) HOLBA_CHECK_MSG(idx < image->points2D.size(), "no such 2D point");
  for (const line2D_t idx : group.line2D_idxs) HOLBA_CHECK_MSG(idx < image->lines2D.size(), "no such 2D line");
  group.group3D_id = kNoId;
  image->groups2D.push_back(std::move(group));
  return static_cast<group2D_t>(image->groups2D.size() - 1);
}

void Reconstruction::RemovePoints2D(image_t image_id, const std::function<bool(point2D_t)>& remove) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  std::vector<bool> is_removed(image->points2D.size());
  for (point2D_t idx = 0; idx < is_removed.size(); ++idx) {
    is_removed[idx] = remove(idx);
    if (is_removed[idx] && image->points2D[idx].point3D_id != kNoId)
      DeleteObservation(PointObservation{image_id, idx});
  }
  const std::vector<uint32_t> new_indices = NewIndices(is_removed);
  for (point2D_t idx = 0; idx < is_removed.size(); ++idx) {
    const point3D_t id = image->points2D[idx].point3D_id;
    if (id == kNoId || new_indices[idx] == idx) continue;
    // A track may hold several points of the image; each is met at its old index, before any other moves there.
    std::vector<PointObservation>& track = points3D.at(id).track;
    *std::find(track.begin(), track.end(), PointObservation{image_id, idx}) = {image_id, new_indices[idx]};
  }
  EraseMarked(is_removed, &image->points2D);
  for (Group2D& group : image->groups2D) Renumber(new_indices, &group.point2D_idxs);
  RemoveGroups2D(image_id, [&](group2D_t idx) { return HasNoFeature(image->groups2D[idx]); });
}

void Reconstruction::RemoveLines2D(image_t image_id, const std::function<bool(line2D_t)>& remove) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  std::vector<bool> is_removed(image->lines2D.size());
  for (line2D_t idx = 0; idx < is_removed.size(); ++idx) {
    is_removed[idx] = remove(idx);
    if (is_removed[idx] && image->lines2D[idx].line3D_id != kNoId)
      DeleteObservation(LineObservation{image_id, idx});
  }
  const std::vector<uint32_t> new_indices = NewIndices(is_removed);
  for (line2D_t idx = 0; idx < is_removed.size(); ++idx) {
    const line3D_t id = image->lines2D[idx].line3D_id;
    if (id == kNoId || new_indices[idx] == idx) continue;
    std::vector<LineObservation>& track = lines3D.at(id).track;
    *std::find(track.begin(), track.end(), LineObservation{image_id, idx}) = {image_id, new_indices[idx]};
  }
  EraseMarked(is_removed, &image->lines2D);
  for (Group2D& group : image->groups2D) Renumber(new_indices, &group.line2D_idxs);
  RemoveGroups2D(image_id, [&](group2D_t idx) { return HasNoFeature(image->groups2D[idx]); });
}

void Reconstruction::RemoveGroups2D(image_t image_id, const std::function<bool(group2D_t)>& remove) {
  Image* image = FindImage(image_id);
  HOLBA_CHECK_MSG(image != nullptr, "no such image");
  std::vector<bool> is_removed(image->groups2D.size());
  for (group2D_t idx = 0; idx < is_removed.size(); ++idx) {
    is_removed[idx] = remove(idx);
    if (is_removed[idx] && image->groups2D[idx].group3D_id != kNoId)
      DeleteObservation(GroupObservation{image_id, idx});
  }
  const std::vector<uint32_t> new_indices = NewIndices(is_removed);
  for (group2D_t idx = 0; idx < is_removed.size(); ++idx) {
    const group3D_t id = image->groups2D[idx].group3D_id;
    if (id == kNoId || new_indices[idx] == idx) continue;
    std::vector<GroupObservation>& observations = groups3D.at(id).observations;
    *std::find(observations.begin(), observations.end(), GroupObservation{image_id, idx}) = {image_id,
                                                                                             new_indices[idx]};
  }
  EraseMarked(is_removed, &image->groups2D);
}

}  // namespace holba
