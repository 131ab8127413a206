// SPDX-License-Identifier: BSD-3-Clause
// Which part of a model takes part in an adjustment, and what of it is held. Chosen once and passed
// to everything that builds a problem: all rounds of an adjustment have the same part and gauge.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "holba/bundle/flat_index.h"
#include "holba/bundle/followers.h"
#include "holba/bundle/gauge.h"
#include "holba/bundle/sensor_selection.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct BundleOptions;

template <typename Id>
struct Selected {
  Id id;
  bool constant = false;
};

// A group with those of its members that take part.
struct SelectedGroup {
  group3D_t id = kNoId;
  bool constant = false;
  std::vector<point3D_t> point3D_ids;
  std::vector<line3D_t> line3D_ids;
};

// Intrinsics that stay because the camera has too few observations.
struct HeldIntrinsics {
  camera_t camera_id;
  size_t num_observations;
};

struct AroundOptions {
  // Frames that see a selected point or line from outside of the list take part, held.
  bool surroundings = true;
  // Intrinsics and poses of sensors in their rigs stay: other images have them, too.
  bool hold_cameras = true;
};

// A point or line that is not held takes part only where two images of the selection see it.
// Observations in images of frames that are not named take no part; members, incidences and
// relations neither, unless both of their ends are named. The order of points, lines, groups,
// incidences and relations is that of blocks and residuals; poses and intrinsics follow the order
// of the model's images.
struct BundleSelection {
  std::vector<Selected<frame_t>> frames;    // with all their images
  std::vector<Selected<camera_t>> cameras;  // those of the images that are not here are held
  std::vector<SelectedSensor> sensors;      // alike, of rigs and without their references
  std::vector<HeldSensor> held_sensors;     // that are not among the sensors for want of sight
  std::vector<Selected<point3D_t>> points;
  std::vector<Selected<line3D_t>> lines;
  std::vector<SelectedGroup> groups;
  std::vector<WireframeEdge> wireframe;
  std::vector<Relation> relations;
  FixedGauge gauge;
  std::vector<FixedGauge> gauges_of_other_parts;  // that share nothing with the first one
  // Everything's variable points and lines that fewer than two images see: not in the lists above.
  std::vector<SeenOnce<point3D_t>> points_seen_once;
  std::vector<SeenOnce<line3D_t>> lines_seen_once;

  // The whole model, with what the options hold. Points and lines that are not held and whose
  // residuals are defined in fewer than two images are left out: they say nothing about the
  // cameras. The model must be consistent.
  static BundleSelection Everything(const Reconstruction& model, const BundleOptions& options);

  // All cameras, the points and lines that the functions keep, and of the structure what these are
  // members or ends of; a group only with so many members at least.
  static BundleSelection OfFeatures(const Reconstruction& model, const BundleOptions& options,
                                    const std::function<bool(point3D_t)>& keep_point,
                                    const std::function<bool(line3D_t)>& keep_line,
                                    size_t min_members);

  // The frames of a list of images with the points and lines that they see, where at least two
  // images of the selection see these (fewer say nothing about the cameras), their groups,
  // incidences and relations. A group is variable only if all of its members are selected. Costs
  // what the part costs, with all members of its groups and one look at each relation of the model;
  // the first time, the model makes its index of associations. Elements stand in the order of the
  // model.
  static BundleSelection Around(const Reconstruction& model, const BundleOptions& options,
                                std::span<const image_t> image_ids, const AroundOptions& around);

  // Poses and intrinsics stay as they are; nothing else has to fix the gauge.
  void HoldCameras();
  // At least one; the first is that of the first part.
  void SetGauges(std::vector<FixedGauge> gauges);
  void HoldPoints();
  // Holds the intrinsics of cameras whose observations are too few for them beside the poses, and
  // says which those are: a focal length fits four points however wrong it is.
  std::vector<HeldIntrinsics> HoldUncertainIntrinsics(const Reconstruction& model,
                                                      const BundleOptions& options);
  void HoldLines();
  bool HasVariableFrame() const;
};

// Whether two images of an index see a feature. One that a single image sees has no depth of its
// own.
template <typename Track>
bool SeenInTwoImages(const Track& track, const FlatIndex& image_idx) {
  image_t first = kInvalidId32;
  for (const auto& observation : track) {
    if (observation.image_id == first || !image_idx.contains(observation.image_id)) continue;
    if (first != kInvalidId32) return true;
    first = observation.image_id;
  }
  return false;
}

// Without the points that were made from structure: what points alone say.
BundleSelection WithoutPointsOfStructure(const Reconstruction& model, BundleSelection selection);

// Images of the frames of a selection, in the order of the model.
std::vector<std::pair<image_t, const Image*>> ImagesOf(const Reconstruction& model,
                                                       const BundleSelection& selection);

}  // namespace holba
