// SPDX-License-Identifier: BSD-3-Clause
// The photograph of a distorting camera as a pinhole would have taken it: where straight lines of
// the world are straight and segments can be found. Its pixels are ideal pixels but for an offset.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "holba/frontend/photographs/photograph.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class IdealCanvas {
 public:
  // Covers what the photograph shows, but at most twice its width and height around the middle:
  // towards 90 degrees from the axis a pinhole image grows without end.
  explicit IdealCanvas(const Camera& camera);

  // A pinhole camera: the canvas is the photograph.
  bool is_photograph() const { return camera_->model->is_pinhole; }
  int width() const { return width_; }
  int height() const { return height_; }

  // The photograph resampled, its mean brightness where it shows nothing. Must have the camera's
  // size.
  GreyImage Resample(const GreyImage& photograph) const;
  // Position on the canvas <-> pixel of the photograph. Empty: the photograph does not show it.
  std::optional<Eigen::Vector2d> ToPixel(const Eigen::Vector2d& on_canvas) const;
  std::optional<Eigen::Vector2d> FromPixel(const Eigen::Vector2d& pixel) const;
  // The longest part of a segment of the canvas around which the photograph shows margin_px to
  // either side. Empty: there is none.
  std::optional<LineSegment2d> ShownPart(const LineSegment2d& on_canvas, double margin_px) const;

 private:
  void MapPixels();
  // Pixel of a position, also outside the photograph; empty: the camera has none.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector2d& on_canvas) const;
  // Whether that pixel's ray leads back: a lens formula may fold far outside of the image.
  bool LeadsBack(const Eigen::Vector2d& on_canvas, const Eigen::Vector2d& pixel) const;
  bool IsShown(const Eigen::Vector2d& on_canvas) const;

  const Camera* camera_;
  Eigen::Vector2d offset_;  // ideal pixel = position on the canvas + offset
  int width_, height_;
  // Of each pixel of the canvas, unless it is the photograph: where its centre is seen in it, and
  // whether it is.
  std::vector<Eigen::Vector2f> pixels_;
  std::vector<uint8_t> is_shown_;
};

}  // namespace holba
