// SPDX-License-Identifier: BSD-3-Clause
// Reconstruction::FindInconsistency: every record by itself, then every reference in both
// directions. Linear in the size of the model. What real COLMAP models hold is no error: tracks of
// one element or none, points observed twice in one image, frames that name images which the model
// does not hold.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>

#include "holba/scene/association_index.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/validity.h"

namespace holba {
namespace {

// How far an image's pose may be from its frame's, relative to the pose: rounding, not a
// difference.
constexpr double kMaxPoseDifference = 1e-6;

struct PairHash {
  size_t operator()(const std::pair<uint64_t, uint64_t>& pair) const {
    uint64_t h = pair.first * 0x9e3779b97f4a7c15ULL;
    h = (h ^ (h >> 32)) + pair.second * 0xbf58476d1ce4e5b9ULL;
    return h ^ (h >> 29);
  }
};
using PairSet = std::unordered_set<std::pair<uint64_t, uint64_t>, PairHash>;

std::pair<uint64_t, uint64_t> Key(const SensorId& sensor) {
  return {static_cast<uint64_t>(static_cast<int64_t>(sensor.type)), sensor.id};
}

bool Differ(const Rigid3d& a, const Rigid3d& b) {
  const Eigen::Vector4d p = a.rotation.coeffs().normalized(), q = b.rotation.coeffs().normalized();
  const double rotation = std::min((p - q).norm(), (p + q).norm());
  const double scale = 1.0 + std::max(a.translation.norm(), b.translation.norm());
  return !(rotation <= kMaxPoseDifference) ||
         !((a.translation - b.translation).norm() <= kMaxPoseDifference * scale);
}

class Inspector {
 public:
  explicit Inspector(const Reconstruction& model) : model_(model) {
    image_positions_.reserve(model.images.size());
    for (const auto& [image_id, image] : model.images) {
      image_positions_.emplace(image_id, image_positions_.size());
    }
  }

  Fault Run() {
    using Check = Fault (Inspector::*)();
    for (const Check check : {&Inspector::Cameras, &Inspector::Rigs, &Inspector::Frames,
                              &Inspector::Images, &Inspector::Unregistered, &Inspector::Points, &Inspector::Lines,
                              &Inspector::Groups, &Inspector::Wireframe, &Inspector::Relations}) {
      if (Fault fault = (this->*check)()) return fault;
    }
    return std::nullopt;
  }

 private:
  Fault Cameras() {
    for (const auto& [camera_id, camera] : model_.cameras) {
      if (const Fault fault = FindFault(camera))
        return fmt::format("camera {} {}", camera_id, *fault);
    }
    return std::nullopt;
  }

  Fault Rigs() {
    for (const auto& [rig_id, rig] : model_.rigs) {
      auto& sensors = sensors_[rig_id];
      if (!rig.ref_sensor && !rig.sensors.empty()) {
        return fmt::format("rig {} has sensors but no reference sensor", rig_id);
      }
      if (rig.ref_sensor) {
        sensors.emplace(Key(*rig.ref_sensor), &kIdentity);
        if (Fault fault = SensorFault(rig_id, *rig.ref_sensor)) return fault;
      }
      for (const Rig::Sensor& sensor : rig.sensors) {
        if (Fault fault = SensorFault(rig_id, sensor.id)) return fault;
        const Rigid3d* pose = sensor.sensor_from_rig ? &*sensor.sensor_from_rig : nullptr;
        if (!sensors.emplace(Key(sensor.id), pose).second) {
          return fmt::format("rig {} has {} twice", rig_id, ToString(sensor.id));
        }
        if (pose == nullptr) continue;
        if (const Fault fault = FindFault(*pose)) {
          return fmt::format("rig {}: the pose of {} {}", rig_id, ToString(sensor.id), *fault);
        }
      }
    }
    return std::nullopt;
  }

  Fault SensorFault(rig_t rig_id, const SensorId& sensor) const {
    if (sensor.type == SensorType::kInvalid) {
      return fmt::format("rig {} has a {}", rig_id, ToString(sensor));
    }
    if (sensor.type == SensorType::kCamera && !model_.cameras.contains(sensor.id)) {
      return fmt::format("rig {} names {}, which is not in the model", rig_id, ToString(sensor));
    }
    return std::nullopt;
  }

  Fault Frames() {
    for (const auto& [frame_id, frame] : model_.frames) {
      const auto sensors = sensors_.find(frame.rig_id);
      if (sensors == sensors_.end()) {
        return fmt::format("frame {} names rig {}, which is not in the model", frame_id,
                           frame.rig_id);
      }
      if (const Fault fault = FindFault(frame.rig_from_world)) {
        return fmt::format("frame {} {}", frame_id, *fault);
      }
      for (const Frame::Data& data : frame.data) {
        const auto sensor = sensors->second.find(Key(data.sensor));
        if (sensor == sensors->second.end()) {
          return fmt::format("frame {} has data of {}, which is not in its rig {}", frame_id,
                             ToString(data.sensor), frame.rig_id);
        }
        if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
        const auto image_id = static_cast<image_t>(data.data_id);
        const Image* image = model_.images.Find(image_id);
        if (image == nullptr) continue;
        if (!frame_data_.emplace(image_id, FrameData{frame_id, data.sensor, sensor->second})
                 .second) {
          return fmt::format("image {} is in frame {} and again in frame {}", image_id,
                             frame_data_.at(image_id).frame_id, frame_id);
        }
      }
    }
    return std::nullopt;
  }

  Fault Images() {
    for (const auto& [image_id, image] : model_.images) {
      if (image.name.empty()) return fmt::format("image {} has no name", image_id);
      if (image.name.find('\0') != std::string::npos) {
        return fmt::format("image {} has a zero byte in its name", image_id);
      }
      if (!model_.cameras.contains(image.camera_id)) {
        return fmt::format("image {} names camera {}, which is not in the model", image_id,
                           image.camera_id);
      }
      if (const Fault fault = FindFault(image.cam_from_world)) {
        return fmt::format("image {} {}", image_id, *fault);
      }
      if (Fault fault = ImageFrameFault(image_id, image)) return fault;
      if (Fault fault = FeatureFault(image_id, image)) return fault;
    }
    return std::nullopt;
  }

  // What has no pose names nothing in 3D, and its frame is not registered either.
  Fault Unregistered() {
    std::unordered_map<image_t, frame_t> frame_of_image;
    for (const auto& [frame_id, frame] : model_.unregistered_frames) {
      if (model_.frames.contains(frame_id))
        return fmt::format("frame {} is there twice, with a pose and without one", frame_id);
      const auto sensors = sensors_.find(frame.rig_id);
      if (sensors == sensors_.end())
        return fmt::format("frame {} names rig {}, which is not in the model", frame_id,
                           frame.rig_id);
      for (const Frame::Data& data : frame.data) {
        if (!sensors->second.contains(Key(data.sensor))) {
          return fmt::format("frame {} has data of {}, which is not in its rig {}", frame_id,
                             ToString(data.sensor), frame.rig_id);
        }
        if (data.sensor.type != SensorType::kCamera || data.data_id >= kInvalidId32) continue;
        const auto image_id = static_cast<image_t>(data.data_id);
        if (model_.images.contains(image_id)) {
          return fmt::format("image {} has a pose, its frame {} has none", image_id, frame_id);
        }
        if (!model_.unregistered_images.contains(image_id)) continue;
        if (!frame_of_image.emplace(image_id, frame_id).second)
          return fmt::format("image {} is in two frames without poses", image_id);
      }
    }
    for (const auto& [image_id, image] : model_.unregistered_images) {
      if (model_.images.contains(image_id))
        return fmt::format("image {} is there twice, with a pose and without one", image_id);
      if (image.name.empty()) return fmt::format("image {} has no name", image_id);
      if (!model_.cameras.contains(image.camera_id)) {
        return fmt::format("image {} names camera {}, which is not in the model", image_id,
                           image.camera_id);
      }
      const auto frame = frame_of_image.find(image_id);
      if (frame == frame_of_image.end() || frame->second != image.frame_id)
        return fmt::format("image {} names frame {}, which does not name the image", image_id, image.frame_id);
      const auto names = [](const auto& features, const auto& id_of) {
        return std::any_of(features.begin(), features.end(), [&](const auto& f) { return id_of(f) != kNoId; });
      };
      if (names(image.points2D, [](const Point2D& p) { return p.point3D_id; }) ||
          names(image.lines2D, [](const Line2D& l) { return l.line3D_id; }) ||
          names(image.groups2D, [](const Group2D& g) { return g.group3D_id; })) {
        return fmt::format("image {} has no pose and observes 3D features", image_id);
      }
      if (Fault fault = FeatureFault(image_id, image)) return fault;
      if (Fault fault = Groups2DFault(image_id, image)) return fault;
    }
    return std::nullopt;
  }

  static Fault FeatureFault(image_t image_id, const Image& image) {
    for (size_t k = 0; k < image.points2D.size(); ++k) {
      if (!image.points2D[k].xy.allFinite()) {
        return fmt::format("point {} of image {} is not finite", k, image_id);
      }
    }
    for (size_t k = 0; k < image.lines2D.size(); ++k) {
      const LineSegment2d& segment = image.lines2D[k].segment;
      if (!segment.start.allFinite() || !segment.end.allFinite()) {
        return fmt::format("line {} of image {} is not finite", k, image_id);
      }
    }
    return std::nullopt;
  }

  static Fault Groups2DFault(image_t image_id, const Image& image) {
    for (size_t k = 0; k < image.groups2D.size(); ++k) {
      if (const Fault fault = Group2DFault(image, image.groups2D[k])) {
        return fmt::format("group {} of image {} {}", k, image_id, *fault);
      }
    }
    return std::nullopt;
  }

  Fault ImageFrameFault(image_t image_id, const Image& image) const {
    if (!model_.frames.contains(image.frame_id)) {
      return image.frame_id == kInvalidId32
                 ? fmt::format("image {} is in no frame", image_id)
                 : fmt::format("image {} names frame {}, which is not in the model", image_id,
                               image.frame_id);
    }
    const auto data = frame_data_.find(image_id);
    if (data == frame_data_.end() || data->second.frame_id != image.frame_id) {
      return fmt::format("image {} names frame {}, which does not name the image", image_id,
                         image.frame_id);
    }
    const SensorId& sensor = data->second.sensor;
    if (sensor.id != image.camera_id) {
      return fmt::format("image {} is of camera {}, but frame {} has it as data of {}", image_id,
                         image.camera_id, image.frame_id, ToString(sensor));
    }
    if (data->second.sensor_from_rig == nullptr) {
      return fmt::format("image {} is of {}, whose pose in its rig is unknown", image_id,
                         ToString(sensor));
    }
    const Rigid3d& rig_from_world = model_.frames.at(image.frame_id).rig_from_world;
    if (Differ(image.cam_from_world, *data->second.sensor_from_rig * rig_from_world)) {
      return fmt::format("the pose of image {} is not that of frame {} and its rig", image_id,
                         image.frame_id);
    }
    return std::nullopt;
  }

  // Both directions of "3D feature `id` has a track" and "2D feature names 3D feature".
  // `Features(image)`: the image's 2D features; `id_of(feature)`: the 3D feature that it names;
  // `has_id`: whether that exists.
  template <typename Map, typename Track, typename Features, typename IdOf>
  Fault References(const Map& map, const char* kind3d, const char* kind2d, Track track_of,
                   Features features_of, IdOf id_of) const {
    std::vector<std::vector<bool>> seen(model_.images.size());
    for (size_t i = 0; i < seen.size(); ++i) {
      seen[i].resize(features_of((model_.images.begin() + i)->second).size());
    }
    for (const auto& [id, value] : map) {
      for (const auto& [image_id, idx] : track_of(value)) {
        const auto position = image_positions_.find(image_id);
        if (position == image_positions_.end()) {
          return fmt::format("{} {} names image {}, which is not in the model", kind3d, id,
                             image_id);
        }
        const auto& features = features_of((model_.images.begin() + position->second)->second);
        if (idx >= features.size()) {
          return fmt::format("{} {} names {} {} of image {}, which has {} of them", kind3d, id,
                             kind2d, idx, image_id, features.size());
        }
        const uint64_t named = id_of(features[idx]);
        if (named != id) {
          return fmt::format("{} {} names {} {} of image {}, which {}", kind3d, id, kind2d, idx,
                             image_id,
                             named == kNoId ? fmt::format("names no {}", kind3d)
                                            : fmt::format("names {} {}", kind3d, named));
        }
        if (seen[position->second][idx]) {
          return fmt::format("{} {} names {} {} of image {} twice", kind3d, id, kind2d, idx,
                             image_id);
        }
        seen[position->second][idx] = true;
      }
    }
    for (size_t i = 0; i < seen.size(); ++i) {
      const auto& [image_id, image] = *(model_.images.begin() + i);
      const auto& features = features_of(image);
      for (size_t idx = 0; idx < features.size(); ++idx) {
        const uint64_t id = id_of(features[idx]);
        if (id == kNoId || seen[i][idx]) continue;
        return fmt::format("{} {} of image {} names {} {}, which {}", kind2d, idx, image_id, kind3d,
                           id, map.contains(id) ? "does not name it back" : "is not in the model");
      }
    }
    return std::nullopt;
  }

  Fault Points() {
    for (const auto& [point3D_id, point] : model_.points3D) {
      if (const Fault fault = FindFault(point))
        return fmt::format("3D point {} {}", point3D_id, *fault);
    }
    return References(
        model_.points3D, "3D point", "point", [](const Point3D& p) -> auto& { return p.track; },
        [](const Image& image) -> auto& { return image.points2D; },
        [](const Point2D& p) { return p.point3D_id; });
  }

  Fault Lines() {
    for (const auto& [line3D_id, line] : model_.lines3D) {
      if (const Fault fault = FindFault(line))
        return fmt::format("3D line {} {}", line3D_id, *fault);
    }
    return References(
        model_.lines3D, "3D line", "line", [](const Line3D& l) -> auto& { return l.track; },
        [](const Image& image) -> auto& { return image.lines2D; },
        [](const Line2D& l) { return l.line3D_id; });
  }

  Fault Groups() {
    for (const auto& [image_id, image] : model_.images) {
      if (Fault fault = Groups2DFault(image_id, image)) return fault;
    }
    for (const auto& [group3D_id, group] : model_.groups3D) {
      if (const Fault fault = Group3DFault(group))
        return fmt::format("group {} {}", group3D_id, *fault);
    }
    if (Fault fault = References(
            model_.groups3D, "3D group", "group",
            [](const Group3D& g) -> auto& { return g.observations; },
            [](const Image& image) -> auto& { return image.groups2D; },
            [](const Group2D& g) { return g.group3D_id; })) {
      return fault;
    }
    for (const auto& [group3D_id, group] : model_.groups3D) {
      for (const GroupObservation& observation : group.observations) {
        const GroupType* type =
            model_.images.at(observation.image_id).groups2D[observation.group2D_idx].type;
        if (type != group.type) {
          return fmt::format(
              "3D group {} is a {}, but its observation, group {} of image {}, is a {}", group3D_id,
              group.type->name, observation.group2D_idx, observation.image_id, type->name);
        }
      }
    }
    return std::nullopt;
  }

  static Fault Group2DFault(const Image& image, const Group2D& group) {
    if (Fault fault = FindFault(group)) return fault;
    for (const point2D_t idx : group.point2D_idxs) {
      if (idx >= image.points2D.size()) {
        return fmt::format("names point {}, but its image has {}", idx, image.points2D.size());
      }
    }
    for (const line2D_t idx : group.line2D_idxs) {
      if (idx >= image.lines2D.size()) {
        return fmt::format("names line {}, but its image has {}", idx, image.lines2D.size());
      }
    }
    return std::nullopt;
  }

  Fault Group3DFault(const Group3D& group) const {
    if (Fault fault = FindFault(group)) return fault;
    for (const point3D_t id : group.point3D_ids) {
      if (!model_.points3D.contains(id)) {
        return fmt::format("names 3D point {}, which is not in the model", id);
      }
    }
    for (const line3D_t id : group.line3D_ids) {
      if (!model_.lines3D.contains(id)) {
        return fmt::format("names 3D line {}, which is not in the model", id);
      }
    }
    return std::nullopt;
  }

  Fault Wireframe() {
    PairSet seen;
    seen.reserve(model_.wireframe.size());
    for (const WireframeEdge& edge : model_.wireframe) {
      if (!model_.points3D.contains(edge.point3D_id)) {
        return fmt::format("the wireframe names 3D point {}, which is not in the model",
                           edge.point3D_id);
      }
      if (!model_.lines3D.contains(edge.line3D_id)) {
        return fmt::format("the wireframe names 3D line {}, which is not in the model",
                           edge.line3D_id);
      }
      if (!seen.emplace(edge.point3D_id, edge.line3D_id).second) {
        return fmt::format("the wireframe has point {} on line {} twice", edge.point3D_id,
                           edge.line3D_id);
      }
    }
    return std::nullopt;
  }

  Fault Relations() {
    PairSet seen;
    for (const Relation& relation : model_.relations) {
      for (const group3D_t id : {relation.group3D_id1, relation.group3D_id2}) {
        const Group3D* group = model_.groups3D.Find(id);
        if (group == nullptr) {
          return fmt::format("a relation names group {}, which is not in the model", id);
        }
        if (!group->type->HasDirection()) {
          return fmt::format("a relation names group {}, but a {} has no direction", id,
                             group->type->name);
        }
      }
      const auto [low, high] = std::minmax(relation.group3D_id1, relation.group3D_id2);
      if (low == high) return fmt::format("a relation is between group {} and itself", low);
      if (!seen.emplace(low, high).second) {
        return fmt::format("groups {} and {} have two relations", low, high);
      }
    }
    return std::nullopt;
  }

  struct FrameData {
    frame_t frame_id;
    SensorId sensor;
    const Rigid3d* sensor_from_rig;  // null: unknown
  };

  static inline const Rigid3d kIdentity;

  const Reconstruction& model_;
  std::unordered_map<image_t, size_t> image_positions_;
  std::unordered_map<rig_t,
                     std::unordered_map<std::pair<uint64_t, uint64_t>, const Rigid3d*, PairHash>>
      sensors_;
  std::unordered_map<image_t, FrameData> frame_data_;
};

}  // namespace

std::optional<std::string> Reconstruction::FindInconsistency() const {
  if (Fault fault = Inspector(*this).Run()) return fault;
  return associations_ ? associations_->FindDifference(*this) : std::nullopt;
}

}  // namespace holba
