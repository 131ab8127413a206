// SPDX-License-Identifier: BSD-3-Clause
// Which poses of sensors in their rigs are adjusted.
#pragma once

#include <cstddef>

#include "holba/scene/types.h"

namespace holba {

class Reconstruction;
struct BundleOptions;
struct BundleSelection;

// A sensor of a rig, not its reference, whose pose in the rig takes part.
struct SelectedSensor {
  rig_t rig_id;
  camera_t camera_id;
  bool constant = false;
};

// One whose pose stays although poses of sensors are adjusted.
struct HeldSensor {
  enum class Why {
    kTooFewObservations,
    kStandsForReference,  // the reference sensor sees too little to say where the rig is
  };
  rig_t rig_id;
  camera_t camera_id;
  size_t num_observations;  // that say something about the pose
  Why why;
};

// Fills selection->sensors and held_sensors, if the options adjust poses of sensors, from the
// frames and features of the selection. What moves with a sensor alone says nothing about its place
// in the rig: an image counts where another image of its frame (or the frame being held) says where
// the rig is. A sensor with too few observations in such images is held. Of the sensors that are
// tied to no reference sensor, the one with most observations is held in its place.
void SelectSensors(const Reconstruction& model, const BundleOptions& options,
                   BundleSelection* selection);

// Number of a sensor in a FlatIndex.
constexpr uint64_t SensorKey(rig_t rig_id, camera_t camera_id) {
  return uint64_t{rig_id} << 32 | uint64_t{camera_id};
}

}  // namespace holba
