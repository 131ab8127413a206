// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/sensor_selection.h"

#include <algorithm>
#include <vector>

#include "holba/base/union_find.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/flat_index.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

// Two equations each: enough for the six unknowns of a pose.
constexpr size_t kMinObservationsOfImage = 3;
// Five times the unknowns, as for intrinsics: what fewer say is mostly their noise.
constexpr size_t kMinObservationsOfSensor = 15;

// The sensors that see something of a selection, those that are references among them.
class SensorSelector {
 public:
  SensorSelector(const Reconstruction& model, const BundleOptions& options,
                 const BundleSelection& selection)
      : frame_idx_(selection.frames.size()) {
    for (const auto& frame : selection.frames) {
      frame_idx_.Add(frame.id);
      frames_.push_back({frame.constant, {}});
    }
    for (const auto& [id, image] : ImagesOf(model, selection)) {
      image_idx_.Add(id);
      images_.push_back(AddImage(model, *image));
    }
    for (const auto& point : selection.points) Count(model.points3D.at(point.id).track);
    if (options.config >= BundleConfig::kPointLine) {
      for (const auto& line : selection.lines) Count(model.lines3D.at(line.id).track);
    }
    for (const SeenImage& image : images_) {
      if (image.num_observations >= kMinObservationsOfImage)
        frames_[image.frame].sensors.push_back(image.sensor);
    }
    for (const SeenImage& image : images_) {
      Sensor& sensor = sensors_[image.sensor];
      sensor.num_seen += image.num_observations;
      if (IsKnownWithout(image)) sensor.num_observations += image.num_observations;
    }
  }

  void Select(BundleSelection* selection) {
    const auto hold = [&](const Sensor& sensor, HeldSensor::Why why) {
      selection->held_sensors.push_back(
          {sensor.rig_id, sensor.camera_id, sensor.num_observations, why});
    };
    const std::vector<uint32_t> stand_ins = StandIns();
    for (uint32_t s = 0; s < sensors_.size(); ++s) {
      const Sensor& sensor = sensors_[s];
      // Without any, nothing moves them.
      if (sensor.is_reference || sensor.num_seen == 0) continue;
      if (!HasEnough(sensor)) {
        hold(sensor, HeldSensor::Why::kTooFewObservations);
      } else if (std::find(stand_ins.begin(), stand_ins.end(), s) != stand_ins.end()) {
        hold(sensor, HeldSensor::Why::kStandsForReference);
      } else {
        selection->sensors.push_back({sensor.rig_id, sensor.camera_id});
      }
    }
  }

 private:
  struct Sensor {
    rig_t rig_id;
    camera_t camera_id;
    bool is_reference;
    size_t num_observations = 0;  // that say something about its pose in the rig
    size_t num_seen = 0;          // all
  };
  struct SeenImage {
    uint32_t frame, sensor;
    size_t num_observations = 0;
  };
  struct SeenFrame {
    bool constant;
    std::vector<uint32_t> sensors;  // that see enough to say where the rig is
  };

  SeenImage AddImage(const Reconstruction& model, const Image& image) {
    const rig_t rig_id = model.frames.at(image.frame_id).rig_id;
    const auto [sensor, is_new] = sensor_idx_.Add(SensorKey(rig_id, image.camera_id));
    if (is_new) {
      const bool is_reference =
          model.rigs.at(rig_id).ref_sensor == SensorId{SensorType::kCamera, image.camera_id};
      sensors_.push_back({rig_id, image.camera_id, is_reference});
    }
    return {frame_idx_.Find(image.frame_id), sensor};
  }

  template <typename Track>
  void Count(const Track& track) {
    for (const auto& observation : track) {
      const uint32_t image = image_idx_.Find(observation.image_id);
      if (image != FlatIndex::kNone) ++images_[image].num_observations;
    }
  }

  // Whether something else than an image says where its rig is.
  bool IsKnownWithout(const SeenImage& image) const {
    const SeenFrame& frame = frames_[image.frame];
    return frame.constant || std::any_of(frame.sensors.begin(), frame.sensors.end(),
                                         [&](uint32_t other) { return other != image.sensor; });
  }

  static bool HasEnough(const Sensor& sensor) {
    return sensor.num_observations >= kMinObservationsOfSensor;
  }

  // Of each set of sensors that frames tie to each other but to no reference: the one that sees
  // most.
  std::vector<uint32_t> StandIns() const {
    const auto num_sensors = static_cast<uint32_t>(sensors_.size());
    const uint32_t known = num_sensors;
    UnionFind sets(num_sensors + 1);
    for (uint32_t s = 0; s < num_sensors; ++s) {
      if (sensors_[s].is_reference && HasEnough(sensors_[s])) sets.Join(known, s);
    }
    for (const SeenFrame& frame : frames_) {
      uint32_t first = frame.constant ? known : FlatIndex::kNone;
      for (const uint32_t sensor : frame.sensors) {
        if (!HasEnough(sensors_[sensor])) continue;
        if (first == FlatIndex::kNone) first = sensor;
        sets.Join(first, sensor);
      }
    }
    std::vector<uint32_t> best(num_sensors + 1, FlatIndex::kNone), stand_ins;
    for (uint32_t s = 0; s < num_sensors; ++s) {
      if (!HasEnough(sensors_[s]) || sets.Root(s) == sets.Root(known)) continue;
      uint32_t& of_set = best[sets.Root(s)];
      if (of_set == FlatIndex::kNone ||
          sensors_[s].num_observations > sensors_[of_set].num_observations)
        of_set = s;
    }
    for (const uint32_t s : best) {
      if (s != FlatIndex::kNone) stand_ins.push_back(s);
    }
    return stand_ins;
  }

  FlatIndex frame_idx_, image_idx_, sensor_idx_;
  std::vector<SeenFrame> frames_;
  std::vector<SeenImage> images_;
  std::vector<Sensor> sensors_;
};

}  // namespace

void SelectSensors(const Reconstruction& model, const BundleOptions& options,
                   BundleSelection* selection) {
  if (!options.refine_sensor_from_rig || options.fix_poses) return;
  const bool any_sensor =
      std::any_of(selection->frames.begin(), selection->frames.end(), [&](const auto& frame) {
        return !model.rigs.at(model.frames.at(frame.id).rig_id).sensors.empty();
      });
  if (any_sensor) SensorSelector(model, options, *selection).Select(selection);
}

}  // namespace holba
