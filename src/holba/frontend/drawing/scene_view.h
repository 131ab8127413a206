// SPDX-License-Identifier: BSD-3-Clause
// From where a model is looked at for a picture: from aside in perspective, along a direction, or
// through the lens of one of its images.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct SceneView {
  std::string name;         // of the picture's file, without its ending
  Rigid3d view_from_world;  // looks along +z, +y is down
  bool is_orthographic = false;
  double scale = 1.0;  // orthographic: pixels of a model unit; else focal length, px
  // Nothing nearer is drawn in perspective; model units.
  double near = 0.0;
  int width = 0, height = 0;  // px
  // What is drawn lies in this box of the world: a little more than where most of the model is.
  Eigen::Vector3d low, high;

  bool Holds(const Eigen::Vector3d& X) const {
    return (X.array() >= low.array()).all() && (X.array() <= high.array()).all();
  }
  Eigen::Vector2d ToPixel(const Eigen::Vector3d& in_view) const {
    const Eigen::Vector2d xy = in_view.head<2>();
    return scale * (is_orthographic ? xy : Eigen::Vector2d(xy / in_view.z())) +
           0.5 * Eigen::Vector2d(width, height);
  }
};

// "overview": from where those who took the photographs look, a little aside and from above;
// "plan": from above; "front" and "side": level, along and across the level direction of most
// lines; "along_ID": along the vanishing point ID, for those that hold many lines and are none of
// these directions. Empty: there is nothing to see. `longer_side_px`: of each picture.
std::vector<SceneView> MakeSceneViews(const Reconstruction& model, int longer_side_px);

}  // namespace holba
