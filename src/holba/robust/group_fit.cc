// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/group_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

// Points and lines of a sample or of a refit, as FitMinimal takes them.
struct FitInput {
  std::vector<Eigen::Vector3d> points;
  std::vector<PlueckerLine> lines;
  void Clear() {
    points.clear();
    lines.clear();
  }
  bool Fit(const GroupType& type, double* g) const {
    if (points.size() + lines.size() == 0) return false;
    if (!type.fit_minimal(points, lines, g)) return false;
    return std::all_of(g, g + type.manifold->ambient, [](double x) { return std::isfinite(x); });
  }
};

// A surface through as many points as it has unknowns follows their noise; from some more on it is
// stable enough for the local optimisation to start from. One of several faces (those take lines)
// needs points on enough of them. 0: not from this kind.
size_t SampleSize(const GroupType& type, bool of_points) {
  if (!of_points) return static_cast<size_t>(type.min_lines);
  const auto least = static_cast<size_t>(type.min_points);
  if (least <= 4) return least;
  return least + (type.TakesLines() ? 5 : 2);
}

// Points to draw samples from. A labelled surface is one object: points farther from its middle
// than three times the median distance carry a wrong label.
std::vector<uint32_t> Core(std::span<const Eigen::Vector3d> points) {
  std::vector<uint32_t> core;
  if (points.empty()) return core;
  Eigen::Vector3d middle;
  std::vector<double> values(points.size());
  const auto median = [&values] {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i][axis];
    middle[axis] = median();
  }
  for (size_t i = 0; i < points.size(); ++i) values[i] = (points[i] - middle).norm();
  const double reach = 3.0 * median();
  for (uint32_t i = 0; i < points.size(); ++i) {
    if ((points[i] - middle).norm() <= reach) core.push_back(i);
  }
  return core;
}

// Levenberg-Marquardt on the distances of points from the surface.
void RefineDistances(const GroupType& type, std::span<const Eigen::Vector3d> points, double* g) {
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
    std::array<double, kMaxGroupParams> moved{};
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

// One run of RANSAC on the members of one group.
class GroupRansac {
 public:
  GroupRansac(const GroupType& type, std::span<const Eigen::Vector3d> points,
              std::span<const PlueckerLine> lines, const GroupResiduals& residuals,
              const GroupRansacOptions& options)
      : type_(type), points_(points), lines_(lines), residuals_(residuals), options_(options) {
    HOLBA_CHECK(!options.refine_distances || (type.TakesPoints() && lines.empty()));
  }

  std::optional<GroupFit> Run(const double* start) {
    if (start && Consider(Judge(start))) Optimise(best_);
    std::vector<uint32_t> points = Core(points_), lines(lines_.size());
    std::iota(lines.begin(), lines.end(), 0);
    const bool by_points = CanSample(points, true), by_lines = CanSample(lines, false);
    Random random(options_.seed);
    double needed = by_points || by_lines ? options_.max_samples : 0;
    for (int sample = 0; sample < needed; ++sample) {
      // From either kind in proportion to its number.
      const bool take_points =
          by_points && (!by_lines || random.Index(NumMembers()) < points_.size());
      std::vector<uint32_t>& pool = take_points ? points : lines;
      Draw(take_points, &random, &pool);
      double g[kMaxGroupParams];
      if (!input_.Fit(type_, g)) continue;
      GroupFit fit = Judge(g);
      // A rough start may still lead to the best end.
      if (fit.gain > 0.75 * best_.gain) Optimise(std::move(fit));
      needed =
          std::clamp(std::ceil(NumSamplesNeeded(options_.confidence, InlierShare(pool, take_points),
                                                SampleSize(type_, take_points))),
                     1.0, static_cast<double>(options_.max_samples));
    }
    if (best_.num_inliers == 0) return std::nullopt;
    return std::move(best_);
  }

 private:
  size_t NumMembers() const { return points_.size() + lines_.size(); }

  bool CanSample(const std::vector<uint32_t>& pool, bool of_points) const {
    const size_t size = SampleSize(type_, of_points);
    return size > 0 && pool.size() >= size;
  }

  // Into input_; the sample's members come first in the pool.
  void Draw(bool of_points, Random* random, std::vector<uint32_t>* pool) {
    input_.Clear();
    for (size_t k = 0; k < SampleSize(type_, of_points); ++k) {
      std::swap((*pool)[k], (*pool)[k + random->Index(pool->size() - k)]);
      if (of_points) {
        input_.points.push_back(points_[(*pool)[k]]);
      } else {
        input_.lines.push_back(lines_[(*pool)[k]]);
      }
    }
  }

  GroupFit Judge(const double* g) const {
    return JudgeGroup(type_, g, NumMembers(), residuals_, options_.limit);
  }

  bool Consider(GroupFit fit) {
    if (fit.gain <= best_.gain) return false;
    best_ = std::move(fit);
    return true;
  }

  // From wide to narrow: the first parameters are too rough to tell the members at the limit.
  void Optimise(GroupFit fit) {
    for (const double factor : {3.0, 1.5, 1.0, 1.0}) {
      const double reach = factor * options_.limit;
      input_.Clear();
      for (size_t i = 0; i < points_.size(); ++i) {
        if (fit.residuals[i] < reach) input_.points.push_back(points_[i]);
      }
      for (size_t i = 0; i < lines_.size(); ++i) {
        if (fit.residuals[points_.size() + i] < reach) input_.lines.push_back(lines_[i]);
      }
      double g[kMaxGroupParams];
      if (options_.refine_distances) {
        std::copy_n(fit.g.data(), type_.manifold->ambient, g);
        RefineDistances(type_, input_.points, g);
      } else if (!input_.Fit(type_, g)) {
        return;
      }
      fit = Judge(g);
      Consider(fit);
    }
  }

  double InlierShare(const std::vector<uint32_t>& pool, bool of_points) const {
    size_t inliers = 0;
    for (const uint32_t i : pool) {
      inliers += best_.num_inliers > 0 &&
                 best_.residuals[of_points ? i : points_.size() + i] < options_.limit;
    }
    return static_cast<double>(inliers) / static_cast<double>(pool.size());
  }

  const GroupType& type_;
  const std::span<const Eigen::Vector3d> points_;
  const std::span<const PlueckerLine> lines_;
  const GroupResiduals& residuals_;
  const GroupRansacOptions options_;
  FitInput input_;
  GroupFit best_;
};

}  // namespace

std::vector<double> GroupFit::FileParams(const GroupType& type) const {
  std::vector<double> plain(static_cast<size_t>(type.num_file_params));
  type.to_file(g.data(), plain.data());
  return plain;
}

double NumSamplesNeeded(double confidence, double share, size_t sample_size) {
  const double right = std::pow(share, static_cast<double>(sample_size));
  if (!(right > 0.0)) return std::numeric_limits<double>::infinity();
  // log1p, because 1 - right is 1 for a small probability; and one sample is enough at a share
  // of 1.
  return std::log(1.0 - confidence) / std::log1p(-std::min(right, 1.0 - 1e-9));
}

GroupFit JudgeGroup(const GroupType& type, const double* g, size_t num_members,
                    const GroupResiduals& residuals, double limit) {
  GroupFit fit;
  std::copy_n(g, type.manifold->ambient, fit.g.begin());
  fit.residuals.resize(num_members);
  residuals(g, &fit.residuals);
  for (const double residual : fit.residuals) {
    if (!(residual < limit)) continue;
    ++fit.num_inliers;
    fit.gain += 1.0 - (residual / limit) * (residual / limit);
  }
  return fit;
}

std::optional<GroupFit> FitGroupRobustly(const GroupType& type,
                                         std::span<const Eigen::Vector3d> points,
                                         std::span<const PlueckerLine> lines,
                                         const GroupResiduals& residuals,
                                         const GroupRansacOptions& options, const double* start) {
  return GroupRansac(type, points, lines, residuals, options).Run(start);
}

}  // namespace holba
