// SPDX-License-Identifier: BSD-3-Clause
#include "holba/group/mesh.h"

#include <cmath>
#include <numbers>

#include "holba/geometry/manifold.h"

namespace holba {
namespace {

constexpr uint32_t kNumSegments = 48;  // around an axis
constexpr uint32_t kNumRings = 24;     // from pole to pole

double SegmentAngle(uint32_t i) { return 2.0 * std::numbers::pi * i / kNumSegments; }

}  // namespace

GroupMesh UnitSphereMesh() {
  GroupMesh mesh;
  mesh.vertices.emplace_back(0.0, 0.0, 1.0);
  for (uint32_t ring = 1; ring < kNumRings; ++ring) {
    const double polar = std::numbers::pi * ring / kNumRings;
    for (uint32_t i = 0; i < kNumSegments; ++i) {
      mesh.vertices.emplace_back(std::sin(polar) * std::cos(SegmentAngle(i)),
                                 std::sin(polar) * std::sin(SegmentAngle(i)), std::cos(polar));
    }
  }
  mesh.vertices.emplace_back(0.0, 0.0, -1.0);
  const uint32_t last = static_cast<uint32_t>(mesh.vertices.size()) - 1;
  const auto at = [](uint32_t ring, uint32_t i) {
    return 1 + (ring - 1) * kNumSegments + i % kNumSegments;
  };
  for (uint32_t i = 0; i < kNumSegments; ++i) {
    mesh.triangles.push_back({0, at(1, i), at(1, i + 1)});
    for (uint32_t ring = 1; ring + 1 < kNumRings; ++ring) {
      mesh.triangles.push_back({at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)});
      mesh.triangles.push_back({at(ring, i), at(ring + 1, i + 1), at(ring, i + 1)});
    }
    mesh.triangles.push_back({at(kNumRings - 1, i), last, at(kNumRings - 1, i + 1)});
  }
  return mesh;
}

GroupMesh FrustumMesh(const Eigen::Vector3d& axis, const Eigen::Vector3d& low, double radius_low,
                      const Eigen::Vector3d& high, double radius_high) {
  const Eigen::Vector3d x = TangentBasis(axis).col(0), y = axis.cross(x);
  GroupMesh mesh;
  const auto add_end = [&](const Eigen::Vector3d& centre, double radius) {
    if (radius <= 0.0) {
      mesh.vertices.push_back(centre);
      return;
    }
    for (uint32_t i = 0; i < kNumSegments; ++i) {
      mesh.vertices.push_back(
          centre + radius * (std::cos(SegmentAngle(i)) * x + std::sin(SegmentAngle(i)) * y));
    }
  };
  add_end(low, radius_low);
  const uint32_t first_high = static_cast<uint32_t>(mesh.vertices.size());
  add_end(high, radius_high);
  const auto at_low = [&](uint32_t i) { return radius_low > 0.0 ? i % kNumSegments : 0; };
  const auto at_high = [&](uint32_t i) {
    return first_high + (radius_high > 0.0 ? i % kNumSegments : 0);
  };
  for (uint32_t i = 0; i < kNumSegments; ++i) {
    if (radius_low > 0.0) mesh.triangles.push_back({at_low(i), at_low(i + 1), at_high(i + 1)});
    if (radius_high > 0.0) mesh.triangles.push_back({at_low(i), at_high(i + 1), at_high(i)});
  }
  return mesh;
}

GroupMesh RectangleMesh(const Eigen::Vector3d& normal, std::span<const Eigen::Vector3d> points) {
  GroupMesh mesh;
  if (points.size() < 3) return mesh;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) centroid += X;
  centroid /= static_cast<double>(points.size());
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(normal);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector3d& X : points) {
    const Eigen::Vector2d u = basis.transpose() * (X - centroid);
    scatter += u * u.transpose();
  }
  const double angle = 0.5 * std::atan2(2.0 * scatter(0, 1), scatter(0, 0) - scatter(1, 1));
  const Eigen::Vector3d x = basis * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  const Eigen::Vector3d y = normal.cross(x);
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& X : points) {
    const Eigen::Vector2d u(x.dot(X - centroid), y.dot(X - centroid));
    low = low.cwiseMin(u);
    high = high.cwiseMax(u);
  }
  if (!((high - low).minCoeff() > 1e-12 * (high - low).maxCoeff())) return mesh;
  mesh.vertices = {centroid + low.x() * x + low.y() * y, centroid + high.x() * x + low.y() * y,
                   centroid + high.x() * x + high.y() * y, centroid + low.x() * x + high.y() * y};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

}  // namespace holba
