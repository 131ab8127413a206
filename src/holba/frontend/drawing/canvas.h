// SPDX-License-Identifier: BSD-3-Clause
// What pictures are drawn on: a photograph, pale, or white, with lines, dots and words over it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "holba/frontend/drawing/pictures.h"

namespace holba {

// Of what has no colour of its own.
inline constexpr Rgb kGrey = {100, 100, 100}, kBlack = {30, 30, 30};
// Told apart also beside each other and on grey. Later rounds through the palette are darker.
Rgb PaletteColour(size_t index);

// A picture that is drawn on, with antialiasing, in units of its pixels (COLMAP's: the centre of
// the first is 0.5). Kept at a multiple of its size, so that thin lines and small dots are smooth;
// where nothing is drawn a photograph stays exactly as it is.
class Canvas {
 public:
  Canvas(int width, int height);  // white
  explicit Canvas(const ColourImage& photograph);

  double Diagonal() const;
  // Not so far outside that it cannot be meant.
  bool IsNear(const Eigen::Vector2d& p) const;

  // Widths, radii and heights are those on a picture of 1000 pixels' diagonal.
  void Line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Rgb& colour, double width);
  void Dot(const Eigen::Vector2d& centre, const Rgb& colour, double radius);
  void Ring(const Eigen::Vector2d& centre, const Rgb& colour, double radius, double width);
  void Fill(const std::vector<Eigen::Vector2d>& polygon, const Rgb& colour);
  // Letters of ASCII, others as '?'. `left`: where their base line begins. Not wider than the
  // picture: then smaller.
  void Text(const std::string& text, const Eigen::Vector2d& left, const Rgb& colour, double height);
  // Pixels that it takes with capitals of this height in pixels.
  static double TextWidth(const std::string& text, double height_px);
  // What `draw` draws shows by `opacity`.
  template <typename Draw>
  void Translucent(double opacity, Draw draw) {
    const cv::Mat before = pixels_.clone();
    draw();
    cv::addWeighted(pixels_, opacity, before, 1.0 - opacity, 0.0, pixels_);
  }

  ColourImage ToImage() const;

 private:
  // Far outside, where fixed-point positions would overflow, there is nothing to see.
  bool Drawable(const Eigen::Vector2d& p) const;
  int Width(double width) const;
  int Radius(double radius) const;

  int width_, height_;
  cv::Mat pixels_;
};

}  // namespace holba
