// SPDX-License-Identifier: BSD-3-Clause
// The surfaces that places are made of, as equations: depth, normals and the truth of primitives
// come from these and not from a mesh. World frame, metres.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace holba {

enum class Shape {
  kRectangle,  // origin: a corner; size: lengths along axes 0 and 1; axis 2 is its normal
  kDisc,       // origin: the centre; size: outer and inner radius; axis 2 is its normal
  kEllipsoid,  // origin: the centre; size: semi-axes
  kFrustum,    // side of a cylinder or cut cone: origin: centre of the base; axis 2 points to the
             // top; size: radius of the base, of the top, height
};

struct Surface {
  Shape shape = Shape::kRectangle;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // columns, a rotation
  Eigen::Vector3d size = Eigen::Vector3d::Ones();
  int material = 0;
  int entity = -1;  // the thing that a label names; -1: none
  // Where on its texture the upper left corner of the chart below is, metres. Textures run
  // downwards.
  Eigen::Vector2d texture_origin = Eigen::Vector2d::Zero();
  bool turn_texture = false;  // by 90 degrees
};

// Smallest distance along the unit `ray` in (near, far) at which it meets the surface from either
// side.
std::optional<double> Intersect(const Surface& surface, const Eigen::Vector3d& from,
                                const Eigen::Vector3d& ray, double near, double far);

// Outward unit normal at a point of the surface.
Eigen::Vector3d NormalAt(const Surface& surface, const Eigen::Vector3d& point);

// The chart: coordinates in metres, between 0 and ChartSize. Lengths are true for rectangles, discs
// and cylinders, near to true for the others. A frustum's and an ellipsoid's chart closes along the
// first.
Eigen::Vector2d ChartSize(const Surface& surface);
Eigen::Vector2d ChartOf(const Surface& surface, const Eigen::Vector3d& point);
Eigen::Vector3d PointOfChart(const Surface& surface, const Eigen::Vector2d& chart);
inline bool ChartCloses(const Surface& surface) {
  return surface.shape == Shape::kEllipsoid || surface.shape == Shape::kFrustum;
}

// A box around it.
void Bounds(const Surface& surface, Eigen::Vector3d* low, Eigen::Vector3d* high);

// Triangles, counter-clockwise from outside. Flat ones are exact, curved ones have corners on the
// surface and are at most `max_deviation` (metres) away from it.
struct SurfaceMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
};
SurfaceMesh Tessellate(const Surface& surface, double max_deviation);

// Unit vectors across `normal`, a right-handed frame (columns) with it as the last.
Eigen::Matrix3d FrameAround(const Eigen::Vector3d& normal);

}  // namespace holba
