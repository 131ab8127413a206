// SPDX-License-Identifier: BSD-3-Clause
// Cameras of synthetic scenes: poses on a sphere or in a row, optionally in rigs.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

inline constexpr double kSyntheticFocalLengthPx = 700.0;
inline constexpr int kSyntheticImageSizePx = 1000;
inline constexpr double kSphereRadius = 10.0;
inline constexpr double kCubeHalfExtent = 3.0;
inline constexpr double kCorridorSpacing = 0.5;
// Features of a corridor are seen from this far away (distance along the corridor).
inline constexpr double kCorridorMinDepth = 4.0;
inline constexpr double kCorridorMaxDepth = 12.0;

// Camera at `centre` looking at `target`, turned by `roll_rad` about its axis.
Rigid3d LookAt(const Eigen::Vector3d& centre, const Eigen::Vector3d& target, double roll_rad);

// f 700, principal point in the middle, mild distortion of the model's kind. Throws InputError for
// an unknown model.
Camera MakeSyntheticCamera(const std::string& model_name);

struct SyntheticCameras {
  Camera camera;                         // intrinsics, of every sensor
  std::vector<Rigid3d> sensor_from_rig;  // the first is the reference: identity
  std::vector<Rigid3d> rig_from_world;   // of each frame
  std::vector<Rigid3d> cam_from_world;   // image i: frame i / rig size, sensor i % rig size

  // Pixel of a world point. Empty: behind the camera or outside the image.
  std::optional<Eigen::Vector2d> Project(size_t image, const Eigen::Vector3d& X) const;
};

// num_images must be a multiple of rig_size.
SyntheticCameras MakeCamerasOnSphere(int num_images, int rig_size, const Camera& camera,
                                     Random* random);
SyntheticCameras MakeCamerasInCorridor(int num_images, int rig_size, const Camera& camera,
                                       Random* random);

// For each camera its `count` nearest (itself first, then by distance of the centres; all if
// fewer).
std::vector<std::vector<uint32_t>> NearestCameras(std::span<const Rigid3d> cam_from_world,
                                                  size_t count);

}  // namespace holba
