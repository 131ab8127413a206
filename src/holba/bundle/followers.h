// SPDX-License-Identifier: BSD-3-Clause
// Points and lines that a single image sees: they have no depth of their own and say nothing about
// the cameras, so that they take no part in an adjustment; they follow the image that sees them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// A feature, and the one image where its residual is defined; kInvalidId32: none.
template <typename Id>
struct SeenOnce {
  Id id;
  image_t image_id = kInvalidId32;
};

// The points and lines of a model whose residuals are defined in fewer than two images (behind the
// camera they are not).
std::vector<SeenOnce<point3D_t>> PointsSeenOnce(const Reconstruction& model);
std::vector<SeenOnce<line3D_t>> LinesSeenOnce(const Reconstruction& model);

// Remembers where features are in their images. Place puts them there again, at their distance from
// the camera: their residuals are what they were, whatever poses and intrinsics have become. What
// belongs to a camera that is as it was keeps its bits.
class Followers {
 public:
  Followers(const Reconstruction& model, std::span<const SeenOnce<point3D_t>> points,
            std::span<const SeenOnce<line3D_t>> lines);
  void Place(Reconstruction* model) const;

 private:
  // A position as its image has it.
  struct Seen {
    Eigen::Vector3d in_cam;
    std::optional<Eigen::Vector2d> pixel;  // empty: the position moves with the pose alone
  };
  struct View {
    Rigid3d cam_from_world;
    std::vector<double> params;
  };
  template <typename Id, size_t kPositions>
  struct Follower {
    Id id;
    image_t image_id;
    View view;
    std::array<Seen, kPositions> seen;
  };
  static View ViewOf(const Reconstruction& model, image_t image_id);
  static Seen SeenIn(const Reconstruction& model, image_t image_id, const Eigen::Vector3d& X);
  static Eigen::Vector3d PositionNow(const Reconstruction& model, image_t image_id,
                                     const View& before, const Seen& seen);
  static bool IsAsItWas(const Reconstruction& model, image_t image_id, const View& before);

  std::vector<Follower<point3D_t, 1>> points_;
  std::vector<Follower<line3D_t, 2>> lines_;
};

}  // namespace holba
