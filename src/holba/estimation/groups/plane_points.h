// SPDX-License-Identifier: BSD-3-Clause
// The points that planes are searched among, with their neighbours, and what a plane explains of
// them: a part of plane_detection.h.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "holba/estimation/groups/plane_detection.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/views.h"

namespace holba {

struct PlanePoint {
  point3D_t id;
  Eigen::Vector3d X;
  double gsd;
  double limit;  // farthest from a plane, model units
  Eigen::Matrix3d covariance;
};

// n.x + w = 0.
struct PlaneParams {
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();
  double w = 0.0;
  double Signed(const Eigen::Vector3d& X) const { return n.dot(X) + w; }
};

struct FoundPlane {
  PlaneParams params;
  std::vector<uint32_t> members;  // in PlanePoints
  double gain = 0.0;
};

// Of two lines: at most a right angle.
inline double AngleRad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b)));
}

// Of which points: those that are on no plane yet, or those that are.
enum class WhichPoints { kOnNoPlane, kOnPlanes };

// Points of enough images and angle, with the uncertainty that noise of `sigma_px` gives them.
// Counts what was dropped by reason (null: not).
std::vector<PlanePoint> EligiblePoints(const PlaneOptions& options, const Reconstruction& model,
                                       const ViewMap& views, WhichPoints which, double sigma_px,
                                       std::map<std::string, size_t>* dropped);

class PlanePoints {
 public:
  PlanePoints(const PlaneOptions& options, std::vector<PlanePoint> points);

  size_t size() const { return points_.size(); }
  const PlanePoint& operator[](size_t i) const { return points_[i]; }

  static constexpr size_t kNumNearest = 60, kNumBeside = 12;
  // The 60 points nearest to it, nearest first.
  std::span<const uint32_t> Nearest(size_t i) const { return nearest_[i]; }
  // The first 12 of them.
  std::span<const uint32_t> Beside(size_t i) const {
    return Nearest(i).first(std::min(kNumBeside, nearest_[i].size()));
  }
  // Whether two points are near enough to each other to lie on one plane side by side.
  bool AreNeighbours(size_t i, size_t j) const {
    return (points_[i].X - points_[j].X).norm() <
           options_.max_neighbour_px * std::max(points_[i].gsd, points_[j].gsd);
  }
  // Neighbours of a point, one of the two among the 10 nearest of the other; ascending.
  std::span<const uint32_t> Connected(size_t i) const { return graph_[i]; }

  double Distance(const PlaneParams& plane, size_t i) const {
    return std::abs(plane.Signed(points_[i].X));
  }
  bool IsWithinLimit(const PlaneParams& plane, size_t i) const {
    return Distance(plane, i) < points_[i].limit;
  }
  // 1 on the plane, 0 from the limit on (MSAC).
  double Gain(const PlaneParams& plane, size_t i) const {
    const double ratio = plane.Signed(points_[i].X) / points_[i].limit;
    return std::max(0.0, 1.0 - ratio * ratio);
  }

  // Least squares in units of the limits. With an earlier estimate, points near their limit from it
  // have small weights.
  PlaneParams Fit(std::span<const uint32_t> members, const PlaneParams* earlier = nullptr) const;

  // Mean share of the points beside a member that are members too.
  double ShareOf(std::span<const uint32_t> members) const;

 private:
  const PlaneOptions& options_;
  const std::vector<PlanePoint> points_;
  std::vector<std::vector<uint32_t>> nearest_, graph_;
};

}  // namespace holba
