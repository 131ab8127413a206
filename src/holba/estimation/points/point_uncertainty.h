// SPDX-License-Identifier: BSD-3-Clause
// How well a triangulated point is known with the cameras held: its covariance, its greatest
// triangulation angle, and the world length of one pixel (ground sampling distance, GSD) at it.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "holba/scene/reconstruction.h"
#include "holba/scene/views.h"

namespace holba {

// 3x3 covariance (model units squared) of a point seen by `observations` with independent noise of
// sigma_px in both coordinates of each, cameras held: inverse of the sum of J^T J / sigma^2, J the
// derivative of the ideal pixel. Empty: under two images in front of which it lies, or its rays are
// parallel.
std::optional<Eigen::Matrix3d> PointCovariance(const ViewMap& views, const Eigen::Vector3d& X,
                                               std::span<const PointObservation> observations,
                                               double sigma_px);

// Greatest angle between two of the observations' rays to X, radians; 0 below two images.
double MaxTriangulationAngleRad(const ViewMap& views, const Eigen::Vector3d& X,
                                std::span<const PointObservation> observations);

// World length of one pixel at X in the median one of the images (depth / focal length). Empty: in
// front of none of them.
std::optional<double> GroundSamplingDistance(const ViewMap& views, const Eigen::Vector3d& X,
                                             std::span<const image_t> images);

// Number of different images in a track.
size_t NumImages(std::span<const PointObservation> observations);

// A triangulated point as fitting sees it.
struct PointGeometry {
  double gsd = 0.0;        // model units of one pixel across the view
  double angle_rad = 0.0;  // greatest triangulation angle
  size_t num_images = 0;

  // Model units that one pixel of noise moves the point, along the view where that is longer: the
  // GSD, stretched where rays meet at less than 15 degrees, by 2.5 at most (a threshold that grew
  // without end would take in everything far away).
  double LengthPerPx() const;
};
// Empty: in front of none of its images.
std::optional<PointGeometry> GeometryOf(const ViewMap& views, const Point3D& point);

// Robust standard deviation of one coordinate of the points' observations, px: the median of the
// absolute residuals (ideal pixels) over 0.6745, corrected for the three unknowns of each point.
// Empty: no point in two images.
std::optional<double> MeasurePointSigmaPx(const Reconstruction& model, const ViewMap& views);

}  // namespace holba
