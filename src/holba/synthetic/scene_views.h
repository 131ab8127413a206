// SPDX-License-Identifier: BSD-3-Clause
// Which views of a PhotoScene see which of its features, and where, without noise.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/line.h"
#include "holba/synthetic/photo_scene.h"

namespace holba {

// A view sees a feature that is turned towards it, inside of its image, not hidden, and of the
// right size there. Detectors then find it in views that look alike: a track has the view that is
// nearest to where the feature is seen best, and those that are nearest to this one in direction
// and scale.
struct VisibilityOptions {
  double max_view_angle_deg = 75.0;  // between the ray and the normal of the feature's side
  double min_size_px = 1.5, max_size_px = 40.0;
  double mean_track_length = 8.0;  // of features that enough views see; geometric above 2
  int max_track_length = 60;
  double detection_rate = 0.8;  // share of the views of a track in which the feature is found

  void Describe(OptionTable* table) const;
};

struct SeenPixel {
  uint32_t view;
  Eigen::Vector2d pixel;
};
struct SeenSegment {
  uint32_t view;
  LineSegment2d segment;  // of the part that is inside of the image; from start to end of the line
};
// By feature, ascending by view; empty: not seen.
struct SceneViews {
  std::vector<std::vector<SeenPixel>> points;
  std::vector<std::vector<SeenSegment>> lines;

  size_t NumPointSightings() const;
};

// Does not depend on num_threads.
SceneViews See(const PhotoScene& scene, const VisibilityOptions& options, uint64_t seed,
               int num_threads);

// Two views look alike at X: directions within max_angle_deg, sizes within a factor of max_scale.
class Likeness {
 public:
  Likeness(const PhotoScene& scene, double max_angle_deg, double max_scale);
  bool LookAlike(uint32_t view1, const Eigen::Vector3d& X1, uint32_t view2,
                 const Eigen::Vector3d& X2, const Eigen::Matrix3d& turn2_from_1) const;

 private:
  double min_cosine_, max_scale_;
  std::vector<Eigen::Vector3d> centres_;
  std::vector<double> focal_px_;
};

}  // namespace holba
