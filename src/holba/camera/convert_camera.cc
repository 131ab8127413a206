// SPDX-License-Identifier: BSD-3-Clause
#include "holba/camera/convert_camera.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace holba {
namespace {

// Pixels of a side of the grid: several times the parameters of any model.
constexpr int kGridSize = 17;
constexpr int kMaxIterations = 50;
// A step that lowers the sum of squares by less than this part of it ends the search.
constexpr double kTolerance = 1e-12;

struct Sight {
  Eigen::Vector2d pixel;
  Eigen::Vector3d ray;
};

std::vector<Sight> SightsOf(const CameraModel& model, std::span<const double> params, double width,
                            double height) {
  std::vector<Sight> sights;
  for (int row = 0; row < kGridSize; ++row) {
    for (int col = 0; col < kGridSize; ++col) {
      const Eigen::Vector2d pixel((col + 0.5) / kGridSize * width,
                                  (row + 0.5) / kGridSize * height);
      if (const auto ray = model.unproject(params.data(), pixel)) sights.push_back({pixel, *ray});
    }
  }
  return sights;
}

using Params = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxCameraParams, 1>;
using Normal =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxCameraParams, kMaxCameraParams>;

struct Equations {
  Normal H;
  Params b;
  double cost = 0.0;
};

// Infinite cost where a ray has no image.
Equations Linearise(const CameraModel& model, const Params& params,
                    const std::vector<Sight>& sights) {
  const int n = model.num_params;
  Equations equations{Normal::Zero(n, n), Params::Zero(n)};
  double d_params[2 * kMaxCameraParams];
  for (const Sight& sight : sights) {
    Eigen::Vector2d pixel;
    if (!model.project_with_jacobian(params.data(), sight.ray, &pixel, nullptr, d_params) ||
        !pixel.allFinite()) {
      equations.cost = std::numeric_limits<double>::infinity();
      return equations;
    }
    const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> J(d_params, 2,
                                                                                        n);
    const Eigen::Vector2d error = pixel - sight.pixel;
    equations.H += J.transpose() * J;
    equations.b -= J.transpose() * error;
    equations.cost += error.squaredNorm();
  }
  return equations;
}

void Hold(std::span<const int> idxs, Equations* equations) {
  for (int idx : idxs) {
    equations->H.row(idx).setZero();
    equations->H.col(idx).setZero();
    equations->H(idx, idx) = 1.0;
    equations->b(idx) = 0.0;
  }
}

}  // namespace

std::optional<std::vector<double>> ConvertCamera(const CameraModel& from,
                                                 std::span<const double> given, double width,
                                                 double height, const CameraModel& to) {
  const std::vector<Sight> sights = SightsOf(from, given, width, height);
  if (sights.size() < size_t{kMaxCameraParams}) return std::nullopt;
  const IdealCalibration K = from.ideal_calibration(given.data());
  Params params = Params::Zero(to.num_params);
  for (size_t i = 0; i < to.focal_idxs.size(); ++i) {
    params(to.focal_idxs[i]) =
        to.focal_idxs.size() == 1 ? 0.5 * (K.fx + K.fy) : (i == 0 ? K.fx : K.fy);
  }
  params(to.principal_point_idxs[0]) = K.cx;
  params(to.principal_point_idxs[1]) = K.cy;

  Equations equations = Linearise(to, params, sights);
  if (!std::isfinite(equations.cost)) return std::nullopt;
  double damping = 1e-6;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Hold(to.principal_point_idxs, &equations);
    Normal damped = equations.H;
    damped.diagonal() += damping * equations.H.diagonal();
    const Params trial = params + Params(damped.ldlt().solve(equations.b));
    Equations next = trial.allFinite() ? Linearise(to, trial, sights) : Equations{};
    if (!trial.allFinite() || !(next.cost < equations.cost)) {
      damping *= 10.0;
      if (damping > 1e6) break;
      continue;
    }
    const bool arrived = equations.cost - next.cost <= kTolerance * equations.cost;
    params = trial;
    equations = std::move(next);
    damping = std::max(0.1 * damping, 1e-12);
    if (arrived) break;
  }
  return std::vector<double>(params.begin(), params.end());
}

}  // namespace holba
