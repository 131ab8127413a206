// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <optional>
#include <unordered_set>
#include <utility>

#include "holba/base/threads.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/robust/kd_tree.h"

namespace holba {
namespace {

constexpr size_t kGraphNeighbours = 10;

}  // namespace

std::vector<PlanePoint> EligiblePoints(const PlaneOptions& options, const Reconstruction& model,
                                       const ViewMap& views, WhichPoints which, double sigma_px,
                                       std::map<std::string, size_t>* dropped) {
  const auto drop = [dropped](const char* reason) {
    if (dropped != nullptr) ++(*dropped)[reason];
  };
  std::unordered_set<point3D_t> taken;
  for (const auto& [id, group] : model.groups3D) {
    if (IsPlane(*group.type)) taken.insert(group.point3D_ids.begin(), group.point3D_ids.end());
  }
  std::vector<PlanePoint> points;
  for (const auto& [id, point] : model.points3D) {
    if (taken.contains(id) != (which == WhichPoints::kOnPlanes)) continue;
    const std::optional<PointGeometry> geometry = GeometryOf(views, point);
    if (!geometry || geometry->num_images < static_cast<size_t>(options.min_images)) {
      drop("point: few images");
      continue;
    }
    if (geometry->angle_rad < DegToRad(options.min_angle_deg)) {
      drop("point: small angle");
      continue;
    }
    const auto covariance = PointCovariance(views, point.xyz, point.track, sigma_px);
    if (!covariance) {
      drop("point: unknown depth");
      continue;
    }
    points.push_back({id, point.xyz, geometry->gsd,
                      options.max_distance_px * geometry->LengthPerPx(), *covariance});
  }
  return points;
}

PlanePoints::PlanePoints(const PlaneOptions& options, std::vector<PlanePoint> points)
    : options_(options), points_(std::move(points)) {
  std::vector<Eigen::Vector3d> xs;
  for (const PlanePoint& p : points_) xs.push_back(p.X);
  const KdTree tree(xs);
  nearest_.resize(points_.size());
  ParallelFor(options_.num_threads, points_.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      for (const KdTree::Neighbour& n : tree.Nearest(xs[i], kNumNearest + 1)) {
        if (n.index != i) nearest_[i].push_back(n.index);
      }
    }
  });
  graph_.resize(points_.size());
  for (uint32_t i = 0; i < points_.size(); ++i) {
    const size_t num = std::min(kGraphNeighbours, nearest_[i].size());
    for (size_t k = 0; k < num; ++k) {
      const uint32_t j = nearest_[i][k];
      if (!AreNeighbours(i, j)) continue;
      graph_[i].push_back(j);
      graph_[j].push_back(i);
    }
  }
  for (std::vector<uint32_t>& edges : graph_) {
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  }
}

PlaneParams PlanePoints::Fit(std::span<const uint32_t> members, const PlaneParams* earlier) const {
  const auto weight_of = [&](uint32_t i) { return earlier ? Gain(*earlier, i) + 1e-3 : 1.0; };
  double sum = 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (uint32_t i : members) {
    const double weight = weight_of(i) / (points_[i].limit * points_[i].limit);
    sum += weight;
    centre += weight * points_[i].X;
  }
  centre /= sum;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (uint32_t i : members) {
    const Eigen::Vector3d u = (points_[i].X - centre) / points_[i].limit;
    scatter += weight_of(i) * u * u.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  PlaneParams plane;
  plane.n = eigen.eigenvectors().col(0);
  plane.w = -plane.n.dot(centre);
  return plane;
}

double PlanePoints::ShareOf(std::span<const uint32_t> members) const {
  std::vector<uint8_t> is_member(points_.size(), 0);
  for (uint32_t i : members) is_member[i] = 1;
  double sum = 0.0;
  for (uint32_t i : members) {
    const std::span<const uint32_t> beside = Beside(i);
    size_t same = 0;
    for (uint32_t j : beside) same += is_member[j];
    sum += beside.empty() ? 0.0 : static_cast<double>(same) / static_cast<double>(beside.size());
  }
  return sum / static_cast<double>(members.size());
}

}  // namespace holba
