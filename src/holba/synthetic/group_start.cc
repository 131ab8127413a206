// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/group_start.h"

#include <algorithm>
#include <cmath>

#include "holba/base/check.h"
#include "holba/robust/group_fit.h"

namespace holba {
namespace {

std::optional<std::vector<double>> ToFile(const GroupType& type, const double* g) {
  std::vector<double> plain(type.num_file_params);
  type.to_file(g, plain.data());
  if (!std::all_of(plain.begin(), plain.end(), [](double x) { return std::isfinite(x); })) {
    return std::nullopt;
  }
  return plain;
}

}  // namespace

std::optional<std::vector<double>> GroupStart(const GroupType& type,
                                              std::span<const Eigen::Vector3d> points,
                                              std::span<const PlueckerLine> lines, double max_error,
                                              Random* random) {
  GroupRansacOptions options{.limit = max_error, .confidence = 1.0 - 1e-4, .seed = random->Bits()};
  if (type.IsParallelism()) {
    const auto sines = [&](const double* g, std::vector<double>* residuals) {
      Eigen::Vector3d v;
      type.direction(g, &v, nullptr);
      for (size_t i = 0; i < lines.size(); ++i) {
        (*residuals)[i] = v.cross(lines[i].direction).norm();
      }
    };
    const auto fit = FitGroupRobustly(type, {}, lines, sines, options);
    return fit ? ToFile(type, fit->g.data()) : std::nullopt;
  }
  HOLBA_CHECK(type.project_point != nullptr && type.min_points > 0);
  const auto distances = [&](const double* g, std::vector<double>* residuals) {
    for (size_t i = 0; i < points.size(); ++i) {
      Eigen::Vector3d projected;
      (*residuals)[i] =
          type.project_point(g, points[i], &projected) ? (projected - points[i]).norm() : HUGE_VAL;
    }
  };
  options.refine_distances = true;
  const auto fit = FitGroupRobustly(type, points, {}, distances, options);
  return fit ? ToFile(type, fit->g.data()) : std::nullopt;
}

}  // namespace holba
