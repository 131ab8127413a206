// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "holba/base/random.h"
#include "holba/render/ray_triangle_testing.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<Surface> AllShapes() {
  const Eigen::Matrix3d axes =
      (Eigen::AngleAxisd(0.7, Vector3d(1, 2, 0.5).normalized())).toRotationMatrix();
  const Vector3d at(0.4, -0.2, 3.0);
  return {{.shape = Shape::kRectangle, .origin = at, .axes = axes, .size = {0.8, 0.5, 0}},
          {.shape = Shape::kDisc, .origin = at, .axes = axes, .size = {0.6, 0.2, 0}},
          {.shape = Shape::kEllipsoid, .origin = at, .axes = axes, .size = {0.5, 0.3, 0.7}},
          {.shape = Shape::kFrustum, .origin = at, .axes = axes, .size = {0.4, 0.4, 0.9}},
          {.shape = Shape::kFrustum, .origin = at, .axes = axes, .size = {0.5, 0.0, 0.6}},
          {.shape = Shape::kFrustum, .origin = at, .axes = axes, .size = {0.1, 0.4, 0.6}}};
}

TEST(Surface, RaysMeetItWhereTheyMeetItsTriangles) {
  Random random(3);
  constexpr double kDeviation = 1e-4;
  for (const Surface& surface : AllShapes()) {
    const SurfaceMesh mesh = Tessellate(surface, kDeviation);
    int num_hits = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d from(random.Uniform(-0.5, 0.5), random.Uniform(-0.5, 0.5), 0.0);
      const Vector3d to =
          surface.origin + Vector3d(random.Normal(0.4), random.Normal(0.4), random.Normal(0.4));
      const Vector3d ray = (to - from).normalized();
      const auto exact = Intersect(surface, from, ray, 1e-6, 1e9);
      const auto meshed = FirstTriangle(mesh, from, ray);
      // At the rim one may just miss.
      if (!exact || !meshed) continue;
      const double slant = std::abs(NormalAt(surface, from + *exact * ray).dot(ray));
      if (slant < 0.1) continue;
      ++num_hits;
      EXPECT_NEAR(*exact, *meshed, 2 * kDeviation / slant);
    }
    EXPECT_GT(num_hits, 30);
  }
}

TEST(Surface, TheNormalIsOutwardAndAcrossTheChart) {
  for (const Surface& surface : AllShapes()) {
    const Vector2d size = ChartSize(surface);
    const Vector2d at = 0.37 * size;
    const Vector3d point = PointOfChart(surface, at), normal = NormalAt(surface, point);
    EXPECT_NEAR(normal.norm(), 1.0, 1e-12);
    for (const Vector2d& step : {Vector2d(1e-6, 0), Vector2d(0, 1e-6)}) {
      EXPECT_NEAR((PointOfChart(surface, at + step) - point).normalized().dot(normal), 0.0, 1e-4);
    }
    if (surface.shape == Shape::kEllipsoid) {
      EXPECT_GT(normal.dot(point - surface.origin), 0.0);
    }
    EXPECT_LT((ChartOf(surface, point) - at).norm(), 1e-12);
  }
}

TEST(Surface, TrianglesRunCounterClockwiseSeenFromOutside) {
  for (const Surface& surface : AllShapes()) {
    for (const auto& [a, b, c] : Tessellate(surface, 1e-3).triangles) {
      const SurfaceMesh mesh = Tessellate(surface, 1e-3);
      const Vector3d cross =
          (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
      if (cross.norm() < 1e-12) continue;  // at a tip
      const Vector3d centre = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3.0;
      EXPECT_GT(cross.normalized().dot(NormalAt(surface, centre)), 0.9);
      break;
    }
  }
}

TEST(Surface, BoundsHoldAllOfIt) {
  for (const Surface& surface : AllShapes()) {
    Vector3d low, high;
    Bounds(surface, &low, &high);
    for (const Vector3d& vertex : Tessellate(surface, 1e-3).vertices) {
      EXPECT_TRUE(((vertex - low).array() > -1e-12).all() &&
                  ((high - vertex).array() > -1e-12).all());
    }
  }
}

}  // namespace
}  // namespace holba
