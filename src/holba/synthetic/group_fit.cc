// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/group_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "holba/base/check.h"

namespace holba {
namespace {

using Params = std::array<double, kMaxGroupParams>;
using Points = std::vector<Eigen::Vector3d>;

// Sum over all points of the squared distance, each at most max_error^2.
double Score(const GroupType& type, const double* g, std::span<const Eigen::Vector3d> points,
             double max_error, Points* inliers) {
  double score = 0.0;
  if (inliers != nullptr) inliers->clear();
  for (const Eigen::Vector3d& X : points) {
    Eigen::Vector3d projected;
    double error = max_error * max_error;
    if (type.project_point(g, X, &projected) && (projected - X).squaredNorm() < error) {
      error = (projected - X).squaredNorm();
      if (inliers != nullptr) inliers->push_back(X);
    }
    score += error;
  }
  return score;
}

// Levenberg-Marquardt on the distances of points (inliers) from the surface.
void Refine(const GroupType& type, std::span<const Eigen::Vector3d> points, double* g) {
  const int ambient = type.manifold->ambient, tangent = type.manifold->tangent;
  const auto cost_of = [&](const double* params) {
    double cost = 0.0;
    for (const Eigen::Vector3d& X : points) {
      Eigen::Vector3d projected;
      if (type.project_point(params, X, &projected)) cost += (projected - X).squaredNorm();
    }
    return cost;
  };
  using Dynamic = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Dynamic plus(ambient, tangent), d_group(3, ambient);
  double cost = cost_of(g), damping = 1e-6;
  for (int iteration = 0; iteration < 15; ++iteration) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(tangent, tangent);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(tangent);
    type.manifold->plus_jacobian(g, plus.data());
    for (const Eigen::Vector3d& X : points) {
      Eigen::Vector3d projected;
      RowMajor<3, 3> d_point;
      if (!type.project_point_with_jacobian(g, X, &projected, d_point.data(), d_group.data())) {
        continue;
      }
      const Eigen::MatrixXd J = d_group * plus;
      H += J.transpose() * J;
      b += J.transpose() * (X - projected);
    }
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += 1e-12 * (1.0 + H.trace());
    const Eigen::VectorXd step = H.ldlt().solve(b);
    Params moved{};
    type.manifold->plus(g, step.data(), moved.data());
    const double moved_cost = cost_of(moved.data());
    if (std::isfinite(moved_cost) && moved_cost < cost) {
      const bool is_done = cost - moved_cost < 1e-12 * cost;
      std::copy_n(moved.data(), ambient, g);
      cost = moved_cost;
      damping = std::max(1e-12, 0.1 * damping);
      if (is_done) break;
    } else {
      damping *= 100.0;
      if (damping > 1e6) break;
    }
  }
}

std::optional<std::vector<double>> ToFile(const GroupType& type, const double* g) {
  std::vector<double> plain(type.num_file_params);
  type.to_file(g, plain.data());
  if (!std::all_of(plain.begin(), plain.end(), [](double x) { return std::isfinite(x); })) {
    return std::nullopt;
  }
  return plain;
}

std::optional<std::vector<double>> FitDirection(const GroupType& type,
                                                std::span<const PlueckerLine> lines,
                                                double max_sine) {
  if (lines.empty()) return std::nullopt;
  // Every line, or as many as are plenty, is a hypothesis.
  constexpr size_t kMaxHypotheses = 100;
  const size_t stride = (lines.size() + kMaxHypotheses - 1) / kMaxHypotheses;
  Eigen::Vector3d best = lines[0].direction;
  double best_score = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < lines.size(); i += stride) {
    double score = 0.0;
    for (const PlueckerLine& line : lines) {
      score +=
          std::min(max_sine * max_sine, lines[i].direction.cross(line.direction).squaredNorm());
    }
    if (score < best_score) {
      best_score = score;
      best = lines[i].direction;
    }
  }
  for (int iteration = 0; iteration < 3; ++iteration) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const PlueckerLine& line : lines) {
      const Eigen::Vector3d& d = line.direction;
      if (best.cross(d).norm() < max_sine) sum += d * d.transpose();
    }
    best = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(sum).eigenvectors().col(2);
  }
  Params g{};
  const PlueckerLine line = PlueckerLine::FromPointDirection(Eigen::Vector3d::Zero(), best);
  if (!type.fit_minimal({}, {&line, 1}, g.data())) return std::nullopt;
  return ToFile(type, g.data());
}

}  // namespace

std::optional<std::vector<double>> FitGroupRobustly(const GroupType& type,
                                                    std::span<const Eigen::Vector3d> points,
                                                    std::span<const PlueckerLine> lines,
                                                    double max_error, Random* random) {
  if (type.IsParallelism()) return FitDirection(type, lines, max_error);
  HOLBA_CHECK(type.project_point != nullptr && type.min_points > 0);
  const size_t sample_size = static_cast<size_t>(type.min_points);
  if (points.size() < sample_size) return std::nullopt;
  const int max_iterations = type.min_points <= 5 ? 500 : 100;
  constexpr double kLogOfMissing = -9.2;  // of 1e-4, the chance to miss a sample of inliers only
  Params best{};
  double best_score = std::numeric_limits<double>::infinity();
  Points sample, inliers;

  // A fit to more points than the least is one of least squares.
  const auto consider = [&](std::span<const Eigen::Vector3d> support, bool refine) {
    Params g{};
    if (!type.fit_minimal(support, {}, g.data())) return false;
    if (refine) Refine(type, support, g.data());
    const double score = Score(type, g.data(), points, max_error, nullptr);
    if (!(score < best_score)) return false;
    best = g;
    best_score = score;
    return true;
  };
  const auto consider_inliers = [&] {
    Score(type, best.data(), points, max_error, &inliers);
    if (inliers.size() < sample_size) return;
    Params refined = best;
    Refine(type, inliers, refined.data());
    const double score = Score(type, refined.data(), points, max_error, nullptr);
    if (score < best_score) {
      best = refined;
      best_score = score;
    }
    consider(inliers, true);
  };

  if (consider(points, true)) consider_inliers();
  std::vector<size_t> picked;
  for (int iteration = 0, num_iterations = max_iterations; iteration < num_iterations;
       ++iteration) {
    // Minimal samples of types with many parameters leave the shape open (a box through 9 points is
    // one of many), which twice as many points settle.
    const bool twice = type.min_points > 5 && iteration % 2 == 1;
    picked.clear();
    sample.clear();
    while (sample.size() < std::min(points.size(), (twice ? 2 : 1) * sample_size)) {
      const size_t i = random->Index(points.size());
      if (std::find(picked.begin(), picked.end(), i) != picked.end()) continue;
      picked.push_back(i);
      sample.push_back(points[i]);
    }
    // Local optimisation (Chum et al. 2003): minimal samples of noisy points are poor.
    if (consider(sample, false)) consider_inliers();
    if (!std::isfinite(best_score)) continue;
    const double all_inliers =
        std::pow(static_cast<double>(inliers.size()) / static_cast<double>(points.size()),
                 static_cast<double>(sample_size));
    if (all_inliers > 0) {
      const double needed = kLogOfMissing / std::log1p(-std::min(all_inliers, 1.0 - 1e-12));
      num_iterations = static_cast<int>(std::clamp(needed, 20.0, double(max_iterations)));
    }
  }
  if (!std::isfinite(best_score)) return std::nullopt;
  for (int round = 0; round < 3; ++round) {
    Score(type, best.data(), points, max_error, &inliers);
    if (inliers.size() < sample_size) break;
    Refine(type, inliers, best.data());
  }
  return ToFile(type, best.data());
}

}  // namespace holba
