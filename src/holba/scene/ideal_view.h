// SPDX-License-Identifier: BSD-3-Clause
// An image as a pinhole view in ideal pixels (FORMAT.md: K applied to undistorted normalised
// coordinates), in which straight lines of the world are straight: what the geometry of lines works
// in. For a pinhole camera ideal pixels are pixels.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "holba/geometry/line.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class IdealView {
 public:
  IdealView(const Reconstruction& model, image_t image_id);

  const Camera& camera() const { return *camera_; }
  const Eigen::Matrix3d& K() const { return K_; }  // upper triangular
  const Eigen::Matrix3d& InverseK() const { return inverse_K_; }
  const Eigen::Matrix3d& R() const { return R_; }  // x_cam = R x + t
  const Eigen::Vector3d& t() const { return t_; }
  const Eigen::Vector3d& centre() const { return centre_; }  // world
  double focal() const { return focal_; }                    // px, geometric mean

  // Pixel of the photograph <-> ideal pixel. Empty: it has none.
  std::optional<Eigen::Vector2d> ToIdeal(const Eigen::Vector2d& pixel) const;
  std::optional<Eigen::Vector2d> ToPixel(const Eigen::Vector2d& ideal) const;
  std::optional<LineSegment2d> ToIdeal(const LineSegment2d& segment) const;

  // Unit ray of an ideal pixel, in the camera and in the world frame.
  Eigen::Vector3d RayInCam(const Eigen::Vector2d& ideal) const {
    return (inverse_K_ * ideal.homogeneous()).normalized();
  }
  Eigen::Vector3d Ray(const Eigen::Vector2d& ideal) const {
    return R_.transpose() * RayInCam(ideal);
  }
  double Depth(const Eigen::Vector3d& X) const { return R_.row(2).dot(X) + t_.z(); }
  // Ideal pixel of a world point. Empty: not in front of the camera.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& X) const;
  // Image l of a world line, l.(x, y, 1) = 0 in ideal pixels, with unit normal (distances in px).
  // Empty: it passes through the camera centre or lies at infinity of the image.
  std::optional<Eigen::Vector3d> Project(const PlueckerLine& line) const;
  // Unit normal, world frame, of the plane through the camera centre and an ideal segment.
  Eigen::Vector3d NormalOfSegment(const LineSegment2d& ideal) const;
  // Distance in pixels that a length at this world point has in the image, at best: length times
  // focal over depth. The world length of one pixel there is its inverse (GSD).
  double PixelsPerLength(const Eigen::Vector3d& X) const { return focal_ / Depth(X); }

 private:
  const Camera* camera_;
  Eigen::Matrix3d K_, inverse_K_, line_K_;  // line_K_: cofactors, l = line_K m
  Eigen::Matrix3d R_;
  Eigen::Vector3d t_, centre_;
  double focal_;
};

// F with x2' F x1 = 0 in ideal pixels of two views.
Eigen::Matrix3d FundamentalMatrix(const IdealView& view1, const IdealView& view2);

}  // namespace holba
