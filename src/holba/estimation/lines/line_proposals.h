// SPDX-License-Identifier: BSD-3-Clause
// Where in 3D a segment may lie: each proposal gives the lengths along the rays of its two ends, by
// what else is known: a second view's plane, points, a direction, a plane of the scene (Liu et al.,
// "3D line mapping revisited", 2023; the forms here are derived anew).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace holba {

// The plane through a camera centre and a segment: unit rays of the ends and unit normal, world.
struct SegmentPlane {
  Eigen::Vector3d centre, ray_start, ray_end, normal;
};

// Along the unit rays; both positive.
struct RayLengths {
  double start = 0.0, end = 0.0;
};

// Rays meet plane n.x + w = 0. Empty: behind, or a ray is nearer to the plane than the sine.
std::optional<RayLengths> ProposeOnPlane(const SegmentPlane& segment, const Eigen::Vector4d& plane,
                                         double min_sine);

// The line projected on the segment's plane, where the rays meet it.
std::optional<RayLengths> ProposeOnLine(const SegmentPlane& segment, const Eigen::Vector3d& point,
                                        const Eigen::Vector3d& direction);

// Total least squares line through two or more points.
std::optional<RayLengths> ProposeThroughPoints(const SegmentPlane& segment,
                                               std::span<const Eigen::Vector3d> points);

// Line through the projection of a point on the segment's plane, its two ends nearest to the plane
// of the other segment.
std::optional<RayLengths> ProposeThroughPoint(const SegmentPlane& segment,
                                              const Eigen::Vector3d& point,
                                              const SegmentPlane& other);

// Line of a direction (projected on the segment's plane), its two ends nearest to the plane of the
// other segment.
std::optional<RayLengths> ProposeAlong(const SegmentPlane& segment,
                                       const Eigen::Vector3d& direction, const SegmentPlane& other);

}  // namespace holba
