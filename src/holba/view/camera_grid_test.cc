// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/camera_grid.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

// The ray of a pixel as the page interpolates it.
Eigen::Vector3d RayOf(const CameraGrid& grid, const Camera& camera, double x, double y) {
  const double u = x / static_cast<double>(camera.width) * (grid.columns - 1),
               v = y / static_cast<double>(camera.height) * (grid.rows - 1);
  const int c = std::min(static_cast<int>(u), grid.columns - 2),
            r = std::min(static_cast<int>(v), grid.rows - 2);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int dr = 0; dr < 2; ++dr) {
    for (int dc = 0; dc < 2; ++dc) {
      const float* ray = &grid.rays[3 * ((r + dr) * grid.columns + c + dc)];
      sum += (dr ? v - r : 1 - v + r) * (dc ? u - c : 1 - u + c) *
             Eigen::Vector3d(ray[0], ray[1], ray[2]);
    }
  }
  return sum;
}

double WorstError(const CameraGrid& grid, const Camera& camera) {
  double worst = 0.0;
  for (double y = 3.7; y < static_cast<double>(camera.height); y += 11.3) {
    for (double x = 5.1; x < static_cast<double>(camera.width); x += 13.9) {
      Eigen::Vector2d seen;
      if (!camera.model->project(camera.params.data(), RayOf(grid, camera, x, y), &seen))
        return INFINITY;
      worst = std::max(worst, (seen - Eigen::Vector2d(x, y)).norm());
    }
  }
  return worst;
}

TEST(CameraGrid, OfAPinholeFourNodesAreExact) {
  const Camera camera{FindCameraModel("PINHOLE"), 640, 480, {500, 510, 300, 250}};
  const CameraGrid grid = MakeCameraGrid(camera, 0.1);
  EXPECT_EQ(grid.columns * grid.rows, 4);
  EXPECT_LT(WorstError(grid, camera), 1e-3);
}

TEST(CameraGrid, OfDistortingLensesIsRightEverywhere) {
  const Camera cameras[] = {
      {FindCameraModel("SIMPLE_RADIAL"), 640, 480, {500, 320, 240, -0.15}},
      {FindCameraModel("OPENCV"), 640, 480, {500, 510, 330, 230, -0.3, 0.1, 1e-3, -2e-3}},
      {FindCameraModel("OPENCV_FISHEYE"), 640, 480, {300, 300, 320, 240, 0.01, 0.002, 0, 0}}};
  for (const Camera& camera : cameras) {
    const CameraGrid grid = MakeCameraGrid(camera, 0.1);
    EXPECT_GT(grid.columns, 2);
    // Errors are greatest near the middles of cells, where they are measured.
    EXPECT_LT(WorstError(grid, camera), 0.2) << camera.model->name;
  }
}

TEST(CameraGrid, BeyondNinetyDegreesRaysHaveUnitLength) {
  const Camera camera{
      FindCameraModel("SIMPLE_FISHEYE"), 800, 800, {220, 400, 400}};  // 104 degrees at the sides
  const CameraGrid grid = MakeCameraGrid(camera, 0.1);
  EXPECT_FALSE(grid.is_planar);
  int num_behind = 0;
  for (size_t i = 0; i < grid.rays.size(); i += 3) {
    const Eigen::Vector3d ray(grid.rays[i], grid.rays[i + 1], grid.rays[i + 2]);
    if (ray.isZero()) continue;
    EXPECT_NEAR(ray.norm(), 1.0, 1e-6);
    num_behind += ray.z() < 0.0f;
  }
  EXPECT_GT(num_behind, 0);
}

}  // namespace
}  // namespace holba
