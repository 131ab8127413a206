// SPDX-License-Identifier: BSD-3-Clause
// One 3D line and the segments that see it, with cameras held: robust fit, covariance, extent.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/scene/ideal_view.h"

namespace holba {

// A line as unit direction and a point on it, best near what is seen of it: the form of the fit
// (4 dof, LineManifold).
struct AnchoredLine {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();

  PlueckerLine Pluecker() const { return PlueckerLine::FromPointDirection(point, direction); }
  Eigen::Vector3d At(double t) const { return point + t * direction; }
};

// A segment in one image, ideal pixels.
struct LineSupport {
  Eigen::Matrix3d line_from_moment;  // l = line_from_moment ((p - centre) x d)
  Eigen::Matrix3d ray_from_pixel;    // world, not unit: R^T K^-1
  Eigen::Vector3d centre;
  Eigen::Vector3d depth_axis;  // world: depth is depth_axis . (X - centre)
  double focal = 1.0;
  Eigen::Vector2d start, end;
  uint32_t view = 0;  // supports of one image share it

  LineSupport() = default;
  LineSupport(const IdealView& view, const LineSegment2d& ideal, uint32_t view_idx);

  // Image of a line with unit normal, directed as the line: along the line's image, the positive
  // side of l is that of LineSegment2d::Line() for a segment of that direction. Empty: a point.
  std::optional<Eigen::Vector3d> Image(const AnchoredLine& line) const;
  double Depth(const Eigen::Vector3d& X) const { return depth_axis.dot(X - centre); }
  // Where on the line, as parameter of At, a pixel's ray comes nearest to it. Empty: parallel.
  std::optional<double> ParameterNearRay(const AnchoredLine& line,
                                         const Eigen::Vector2d& ideal) const;
  // Parameters of the points whose images are the feet of the segment's ends, in the line's sense.
  // Empty: one is behind the camera, or the line's image is a point.
  std::optional<std::pair<double, double>> Extent(const AnchoredLine& line) const;
};

// Beside the pixels.
struct LinePrior {
  std::optional<Eigen::Vector3d> direction;  // unit; of either sign
  double direction_weight = 0.0;             // px per radian
  std::optional<Eigen::Vector4d> plane;      // n.x + w = 0, unit n
  double plane_weight = 0.0;                 // of the distance in pixels of the two ends below
  double t_start = 0.0, t_end = 0.0;         // as parameters of the line that is given
};

// Scale of the robust loss of a segment's distances to the image of its line, px.
inline constexpr double kSegmentCauchyPx = 1.0;

// Minimises the distances of the supports' ends to the image of the line, px, with Cauchy loss of
// the scale per support, beside the prior. Starts at `line`. False: it cannot be improved because
// it has no image, or less than two supports.
bool FitLine(std::span<const LineSupport> supports, const LinePrior& prior, double cauchy_px,
             AnchoredLine* line);

// Root mean square of the supports' ends' distances, px. Empty: no image in one of them.
std::optional<double> RmsOfLine(std::span<const LineSupport> supports, const AnchoredLine& line);
// Squares of the distances of both ends, px^2; infinite: no image.
double SquaredDistance(const LineSupport& support, const AnchoredLine& line);

// Interval of the line that its supports show, robust: pieces of one image are joined, and of the
// images' lower ends the lowest are dropped as outliers (two of 6 or more images, one of 4 or 5,
// none of fewer), upper ends likewise; where that leaves nothing, for images show pieces apart,
// none is dropped. Empty: no support has an extent.
std::optional<std::pair<double, double>> ExtentOfLine(std::span<const LineSupport> supports,
                                                      const AnchoredLine& line);

// What the pixels (and a prior) say of a line. Distances to the line's image do not see it move
// within the plane through a camera: where all cameras lie in one plane with the line, its depth is
// free, and residuals never show it; this does.
struct LineUncertainty {
  // Standard deviation of the two ends of the extent across the line, in the worst direction,
  // relative to their mean depth in the images. Very large where nothing holds the line.
  double relative_sigma_start = 0.0;
  double relative_sigma_end = 0.0;
  // Covariance in the tangent of LineManifold at (direction, centre of the extent).
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  AnchoredLine line;  // that tangent's
  double RelativeSigma() const { return std::max(relative_sigma_start, relative_sigma_end); }
};
// The ends are those of t_start, t_end; residuals have standard deviation sigma_px, those of the
// prior too. Empty: no support.
std::optional<LineUncertainty> UncertaintyOfFit(std::span<const LineSupport> supports,
                                                const LinePrior& prior, double sigma_px,
                                                const AnchoredLine& line, double t_start,
                                                double t_end);

}  // namespace holba
