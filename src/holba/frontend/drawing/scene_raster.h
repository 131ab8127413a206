// SPDX-License-Identifier: BSD-3-Clause
// Dots, lines and translucent triangles with depth, drawn as a picture without a graphics
// processor: what is nearer hides what is behind, whatever the order in which it is added;
// triangles may cut each other. The picture is the same for any number of threads.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "holba/frontend/drawing/pictures.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

// A place on a picture.
struct RasterPlace {
  Eigen::Vector2d pixel;  // COLMAP's: the centre of the first is 0.5
  // Greater is nearer, and linear on the picture along what is straight: 1/depth of a view in
  // perspective, -depth of an orthographic one.
  double nearness = 0.0;
};

class SceneRaster {
 public:
  // `slack`: two things whose nearness differs by at most slack_share * |nearness| + slack are
  // taken as equally near: a line in a plane is not hidden by it.
  SceneRaster(const ColourImage& background, double slack_share, double slack);

  void AddDot(const RasterPlace& centre, double radius_px, const Rgb& colour);
  // With round ends. `halo_px`: breadth of a white border on each side, which is cut out of what is
  // farther away, so that one sees which of two lines passes in front.
  void AddLine(const RasterPlace& a, const RasterPlace& b, double width_px, const Rgb& colour,
               double halo_px = 0.0);
  void AddTriangle(const RasterPlace& a, const RasterPlace& b, const RasterPlace& c,
                   const Rgb& colour, double opacity);

  // Antialiased: each pixel is the mean of kFineness^2 samples.
  ColourImage Render(int num_threads) const;
  static constexpr int kFineness = 3;

 private:
  struct Dot {
    RasterPlace centre;
    double radius_px;
    Rgb colour;
  };
  struct Line {
    RasterPlace a, b;
    double width_px, halo_px;
    Rgb colour;
  };
  struct Triangle {
    RasterPlace corners[3];
    Rgb colour;
    double opacity;
  };
  class Band;
  double Slack(double nearness) const { return slack_share_ * std::abs(nearness) + slack_; }
  // Rows of the picture that something covers, cut to it; false: none.
  bool Rows(double low_px, double high_px, int* first, int* last) const;

  ColourImage background_;
  double slack_share_, slack_;
  std::vector<Dot> dots_;
  std::vector<Line> lines_;
  std::vector<Triangle> triangles_;
};

}  // namespace holba
