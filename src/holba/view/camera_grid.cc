// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/camera_grid.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

namespace holba {
namespace {

constexpr int kMaxNumCells = 64;
// Towards 90 degrees from the axis rays are ever farther apart on the plane z = 1: of lenses that
// see beyond 60 degrees the nodes are nearer to straight on the sphere.
constexpr double kMinPlanarZ = 0.5;

Eigen::Vector2d PixelOf(const Camera& camera, double column, double row) {
  return {static_cast<double>(camera.width) * column, static_cast<double>(camera.height) * row};
}

std::optional<Eigen::Vector3d> RayOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  const auto ray = camera.model->unproject(camera.params.data(), pixel);
  if (!ray || !ray->allFinite()) return std::nullopt;
  return ray;
}

CameraGrid GridOfCells(const Camera& camera, int num_cells) {
  CameraGrid grid{.columns = num_cells + 1, .rows = num_cells + 1};
  std::vector<Eigen::Vector3d> rays;
  for (int r = 0; r <= num_cells; ++r) {
    for (int c = 0; c <= num_cells; ++c) {
      const auto ray = RayOf(camera, PixelOf(camera, c / static_cast<double>(num_cells),
                                             r / static_cast<double>(num_cells)));
      rays.push_back(ray.value_or(Eigen::Vector3d::Zero()));
      grid.is_planar =
          grid.is_planar && (camera.model->is_pinhole || !ray || ray->z() > kMinPlanarZ);
    }
  }
  for (const Eigen::Vector3d& ray : rays) {
    const double scale = grid.is_planar && ray.z() > 0.0 ? 1.0 / ray.z() : 1.0;
    for (int k = 0; k < 3; ++k) grid.rays.push_back(static_cast<float>(scale * ray[k]));
  }
  return grid;
}

// Greatest distance between a pixel and that of the interpolated ray, amid the cells and amid their
// sides, where bends of opposite sign do not make up for each other. A cell of which a corner has
// no ray is not looked at: it is not shown.
double ErrorOf(const Camera& camera, const CameraGrid& grid) {
  double worst = 0.0;
  const auto node = [&](int r, int c) {
    const float* ray = &grid.rays[3 * (r * static_cast<size_t>(grid.columns) + c)];
    return Eigen::Vector3d(ray[0], ray[1], ray[2]);
  };
  for (int r = 0; r + 1 < grid.rows; ++r) {
    for (int c = 0; c + 1 < grid.columns; ++c) {
      const Eigen::Vector3d a = node(r, c), b = node(r, c + 1), d = node(r + 1, c),
                            e = node(r + 1, c + 1);
      if (a.isZero() || b.isZero() || d.isZero() || e.isZero()) continue;
      const std::tuple<double, double, Eigen::Vector3d> places[] = {
          {0.5, 0.5, 0.25 * (a + b + d + e)}, {0.5, 0.0, 0.5 * (a + b)}, {0.0, 0.5, 0.5 * (a + d)}};
      for (const auto& [right, below, ray] : places) {
        const Eigen::Vector2d pixel =
            PixelOf(camera, (c + right) / (grid.columns - 1), (r + below) / (grid.rows - 1));
        Eigen::Vector2d seen;
        if (!camera.model->project(camera.params.data(), ray, &seen)) return INFINITY;
        worst = std::max(worst, (seen - pixel).norm());
      }
    }
  }
  return worst;
}

}  // namespace

CameraGrid MakeCameraGrid(const Camera& camera, double max_error_px) {
  CameraGrid grid;
  for (int num_cells = 1; num_cells <= kMaxNumCells; num_cells *= 2) {
    grid = GridOfCells(camera, num_cells);
    // One cell is enough for a lens without distortion only: its middle is the axis, where there
    // is none.
    if (num_cells == 1 && !camera.model->is_pinhole) continue;
    if (num_cells <= 2 && !camera.model->is_pinhole && !camera.model->extra_idxs.empty()) continue;
    if (ErrorOf(camera, grid) <= max_error_px) break;
  }
  return grid;
}

}  // namespace holba
