// SPDX-License-Identifier: BSD-3-Clause
// Rays against triangles, one by one: what the renderer is compared with.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <optional>

#include "holba/render/surface.h"

namespace holba {

// Distance along the unit ray to the first triangle (by Cramer's rule). Empty: none.
inline std::optional<double> FirstTriangle(const SurfaceMesh& mesh, const Eigen::Vector3d& from,
                                           const Eigen::Vector3d& ray) {
  std::optional<double> first;
  for (const auto& [a, b, c] : mesh.triangles) {
    Eigen::Matrix3d system;
    system << mesh.vertices[b] - mesh.vertices[a], mesh.vertices[c] - mesh.vertices[a], -ray;
    const double determinant = system.determinant();
    if (determinant == 0.0) continue;
    const Eigen::Vector3d right = from - mesh.vertices[a];
    double values[3];
    for (int i = 0; i < 3; ++i) {
      Eigen::Matrix3d replaced = system;
      replaced.col(i) = right;
      values[i] = replaced.determinant() / determinant;
    }
    constexpr double kPlay = 1e-9;  // no gaps between neighbours
    if (values[0] < -kPlay || values[1] < -kPlay || values[0] + values[1] > 1.0 + kPlay ||
        values[2] < 1e-4)
      continue;
    if (!first || values[2] < *first) first = values[2];
  }
  return first;
}

}  // namespace holba
