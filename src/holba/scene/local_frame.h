// SPDX-License-Identifier: BSD-3-Clause
// A frame in which numbers are small, wherever a scene lies and whatever its unit of length is.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// COLMAP's normalisation: between the 10th and 90th percentiles of the camera centres along each
// axis, their mean moves to the origin and the diagonal of their box becomes 10. Empty: no image
// has a pose.
std::optional<Sim3d> NormalisedFromWorld(const Reconstruction& model);

// The same for models of any kind: without images it follows from the points, and where the cameras
// are at one place (one of them, pure rotation) its unit does. In map coordinates (an origin 1e6
// units away) a rotation about the origin moves every camera by far more than the scene is wide, so
// that no step of an adjustment, no tolerance and no covariance means what it should.
Sim3d LocalFromWorld(const Reconstruction& model);

// Moves a model to its local frame, and back when it is destroyed. What has not changed in between
// comes back bit for bit.
class LocalFrame {
 public:
  enum class Unit { kOfTheScene, kUnchanged };
  explicit LocalFrame(Reconstruction* model, Unit unit = Unit::kOfTheScene);
  ~LocalFrame();
  LocalFrame(const LocalFrame&) = delete;
  LocalFrame& operator=(const LocalFrame&) = delete;

  const Sim3d& local_from_world() const { return local_from_world_; }

 private:
  struct LineGeometry {
    PlueckerLine line;
    Eigen::Vector3d start, end;
  };

  Reconstruction& model_;
  Sim3d local_from_world_;
  // As they were in the world.
  IdMap<rig_t, std::vector<std::optional<Rigid3d>>> sensors_;  // of rigs, their poses
  IdMap<frame_t, Rigid3d> frames_;
  IdMap<image_t, Rigid3d> images_;
  IdMap<point3D_t, Eigen::Vector3d> points_;
  IdMap<line3D_t, LineGeometry> lines_;
  IdMap<group3D_t, std::vector<double>> groups_;
};

}  // namespace holba
