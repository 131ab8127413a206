// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/points/point_triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

// Point nearest to the rays of the views, each distance divided by the depth of an earlier estimate
// (as angles, not lengths); empty `depths`: plain distances.
std::optional<Eigen::Vector3d> NearestToRays(std::span<const PointView> views,
                                             std::span<const double> depths) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector3d ray = views[i].view->Ray(views[i].ideal);
    const double weight = depths.empty() ? 1.0 : 1.0 / (depths[i] * depths[i]);
    const Eigen::Matrix3d across = weight * (Eigen::Matrix3d::Identity() - ray * ray.transpose());
    A += across;
    b += across * views[i].view->centre();
  }
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(A);
  // Parallel rays leave one direction free.
  if (!(ldlt.vectorD().minCoeff() > 1e-12 * ldlt.vectorD().maxCoeff())) return std::nullopt;
  const Eigen::Vector3d X = ldlt.solve(b);
  if (!X.allFinite()) return std::nullopt;
  return X;
}

bool InFrontOfAll(std::span<const PointView> views, const Eigen::Vector3d& X) {
  return std::all_of(views.begin(), views.end(),
                     [&](const PointView& v) { return v.view->Depth(X) > 0.0; });
}

// First estimate of a point that all views see.
std::optional<Eigen::Vector3d> LinearEstimate(std::span<const PointView> views) {
  std::optional<Eigen::Vector3d> X = NearestToRays(views, {});
  if (!X || !InFrontOfAll(views, *X)) return std::nullopt;
  std::vector<double> depths(views.size());
  for (size_t i = 0; i < views.size(); ++i) depths[i] = (*X - views[i].view->centre()).norm();
  const auto weighted = NearestToRays(views, depths);
  return weighted && InFrontOfAll(views, *weighted) ? weighted : X;
}

// Squared distances, infinite behind the camera.
double SquaredError(const PointView& v, const Eigen::Vector3d& X) {
  const auto x = v.view->Project(X);
  return x ? (*x - v.ideal).squaredNorm() : std::numeric_limits<double>::infinity();
}

struct Consensus {
  std::vector<bool> is_inlier;
  size_t num_inliers = 0;
  double cost = 0.0;  // truncated squares (MSAC)
};

Consensus Agree(std::span<const PointView> views, const Eigen::Vector3d& X, double max_error_px) {
  const double bound = max_error_px * max_error_px;
  Consensus consensus;
  consensus.is_inlier.resize(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const double squared = SquaredError(views[i], X);
    consensus.is_inlier[i] = squared < bound;
    consensus.num_inliers += squared < bound;
    consensus.cost += std::min(squared, bound);
  }
  return consensus;
}

std::vector<PointView> Selected(std::span<const PointView> views, const std::vector<bool>& which) {
  std::vector<PointView> selected;
  for (size_t i = 0; i < views.size(); ++i) {
    if (which[i]) selected.push_back(views[i]);
  }
  return selected;
}

struct Estimate {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  Consensus consensus;
};

// Refines on the inliers until they stay the same; returns the best estimate on the way.
Estimate LocallyOptimise(std::span<const PointView> views, Estimate best, double max_error_px) {
  constexpr int kMaxRounds = 5;  // inlier sets of a handful of views settle in two or three
  for (int round = 0; round < kMaxRounds && best.consensus.num_inliers >= 2; ++round) {
    const auto refined = RefinePoint(Selected(views, best.consensus.is_inlier), best.xyz);
    if (!refined) break;
    Consensus consensus = Agree(views, *refined, max_error_px);
    const bool same = consensus.is_inlier == best.consensus.is_inlier;
    if (!same && consensus.cost > best.consensus.cost) break;
    best = {*refined, std::move(consensus)};
    if (same) break;
  }
  return best;
}

double MaxAngle(std::span<const PointView> views, const Eigen::Vector3d& X) {
  double min_cos = 1.0;
  std::vector<Eigen::Vector3d> rays;
  for (const PointView& v : views) {
    rays.push_back((X - v.view->centre()).normalized());
    for (size_t i = 0; i + 1 < rays.size(); ++i)
      min_cos = std::min(min_cos, rays[i].dot(rays.back()));
  }
  return std::acos(std::clamp(min_cos, -1.0, 1.0));
}

std::vector<std::pair<size_t, size_t>> SamplePairs(size_t num_views, size_t max_num_samples) {
  std::vector<std::pair<size_t, size_t>> pairs;
  const size_t num_pairs = num_views * (num_views - 1) / 2;
  if (num_pairs <= max_num_samples) {
    for (size_t i = 0; i < num_views; ++i) {
      for (size_t j = i + 1; j < num_views; ++j) pairs.emplace_back(i, j);
    }
    return pairs;
  }
  Random random(num_views);
  while (pairs.size() < max_num_samples) {
    const size_t i = random.Index(num_views), j = random.Index(num_views);
    if (i != j) pairs.emplace_back(std::min(i, j), std::max(i, j));
  }
  return pairs;
}

}  // namespace

Matrix23d ProjectionJacobian(const IdealView& view, const Eigen::Vector3d& X) {
  const Eigen::Vector3d x = view.R() * X + view.t();
  const double fx = view.K()(0, 0), fy = view.K()(1, 1);
  Matrix23d d_cam;
  d_cam << fx, 0.0, -fx * x.x() / x.z(), 0.0, fy, -fy * x.y() / x.z();
  return d_cam / x.z() * view.R();
}

std::optional<Eigen::Vector3d> RefinePoint(std::span<const PointView> views,
                                           const Eigen::Vector3d& start) {
  constexpr int kMaxIterations = 30;
  const auto cost_at = [&](const Eigen::Vector3d& X) {
    double cost = 0.0;
    for (const PointView& v : views) cost += SquaredError(v, X);
    return cost;
  };
  Eigen::Vector3d X = start;
  double cost = cost_at(X), damping = 1e-6;
  if (!std::isfinite(cost)) return std::nullopt;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double nearest = std::numeric_limits<double>::infinity();
    for (const PointView& v : views) {
      const Matrix23d J = ProjectionJacobian(*v.view, X);
      A += J.transpose() * J;
      b += J.transpose() * (v.ideal - *v.view->Project(X));
      nearest = std::min(nearest, (X - v.view->centre()).norm());
    }
    bool is_better = false;
    Eigen::Vector3d step = Eigen::Vector3d::Zero();
    for (int trial = 0; trial < 10 && !is_better; ++trial) {
      Eigen::Matrix3d damped = A;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::LDLT<Eigen::Matrix3d> ldlt(damped);
      if (!(ldlt.vectorD().minCoeff() > 0.0)) return std::nullopt;
      step = ldlt.solve(b);
      const double new_cost = cost_at(X + step);
      is_better = new_cost < cost;
      if (is_better) {
        X += step;
        cost = new_cost;
      }
      damping = is_better ? std::max(0.1 * damping, 1e-12) : 10.0 * damping;
    }
    if (!is_better || step.norm() < 1e-10 * nearest) break;
  }
  if (!X.allFinite()) return std::nullopt;
  return X;
}

std::optional<Eigen::Matrix3d> PointCovariance(std::span<const PointView> views,
                                               const Eigen::Vector3d& X) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  for (const PointView& v : views) {
    if (!(v.view->Depth(X) > 0.0)) return std::nullopt;
    const Matrix23d J = ProjectionJacobian(*v.view, X);
    A += J.transpose() * J;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
  // Rays parallel to 1e-6 rad: the depth is unknown.
  if (!(eigen.eigenvalues()[0] > 1e-12 * eigen.eigenvalues()[2])) return std::nullopt;
  return Eigen::Matrix3d(eigen.eigenvectors() *
                         eigen.eigenvalues().cwiseInverse().asDiagonal() *
                         eigen.eigenvectors().transpose());
}

double PixelsPerLength(std::span<const PointView> views, const Eigen::Vector3d& X) {
  double most = 0.0;
  for (const PointView& v : views) {
    if (v.view->Depth(X) > 0.0) most = std::max(most, v.view->PixelsPerLength(X));
  }
  return most;
}

std::optional<TriangulatedPoint> TriangulatePoint(std::span<const PointView> views,
                                                  const PointTriangulationOptions& options,
                                                  PointTriangulationFailure* failure) {
  HOLBA_CHECK(options.min_num_views >= 2);
  PointTriangulationFailure ignored;
  if (failure == nullptr) failure = &ignored;
  *failure = PointTriangulationFailure::kFewViews;
  if (views.size() < options.min_num_views) return std::nullopt;

  const auto estimate_from = [&](std::span<const PointView> some) -> std::optional<Estimate> {
    const auto X = LinearEstimate(some);
    if (!X) return std::nullopt;
    return Estimate{*X, Agree(views, *X, options.max_error_px)};
  };
  // Where all views agree there is nothing to be robust against.
  std::optional<Estimate> best = estimate_from(views);
  if (best) best = LocallyOptimise(views, *best, options.max_error_px);
  if (!best || best->consensus.num_inliers < views.size()) {
    for (const auto& [i, j] : SamplePairs(views.size(), options.max_num_samples)) {
      const PointView pair[] = {views[i], views[j]};
      std::optional<Estimate> sample = estimate_from(pair);
      if (!sample || sample->consensus.num_inliers < 2) continue;
      if (best && sample->consensus.cost >= best->consensus.cost) continue;
      best = LocallyOptimise(views, *sample, options.max_error_px);
    }
  }
  if (!best || best->consensus.num_inliers < options.min_num_views) return std::nullopt;

  *failure = PointTriangulationFailure::kSmallAngle;
  const std::vector<PointView> inliers = Selected(views, best->consensus.is_inlier);
  TriangulatedPoint result;
  result.max_angle_rad = MaxAngle(inliers, best->xyz);
  if (result.max_angle_rad < DegToRad(options.min_angle_deg)) return std::nullopt;
  const auto covariance = PointCovariance(inliers, best->xyz);
  if (!covariance) return std::nullopt;
  result.covariance_1px = *covariance;
  double sum_squares = 0.0;
  for (const PointView& v : inliers) sum_squares += SquaredError(v, best->xyz);
  result.rms_error_px = std::sqrt(sum_squares / static_cast<double>(inliers.size()));
  result.xyz = best->xyz;
  result.is_inlier = std::move(best->consensus.is_inlier);
  result.num_inliers = best->consensus.num_inliers;
  *failure = PointTriangulationFailure::kNone;
  return result;
}

std::optional<double> MeanReprojectionErrorPx(const Reconstruction& model, const Point3D& point) {
  double sum = 0.0;
  size_t count = 0;
  for (const PointObservation& observation : point.track) {
    const Image& image = model.images.at(observation.image_id);
    const Camera& camera = model.cameras.at(image.camera_id);
    Eigen::Vector2d pixel;
    if (!camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel)) {
      continue;
    }
    sum += (pixel - image.points2D.at(observation.point2D_idx).xy).norm();
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

point3D_t AddPointOfStructure(const Eigen::Vector3d& xyz, PointOrigin origin,
                              const std::array<uint8_t, 3>& rgb,
                              std::span<const std::pair<image_t, Eigen::Vector2d>> observations,
                              Reconstruction* model) {
  std::vector<PointObservation> track;
  for (const auto& [image_id, pixel] : observations)
    track.push_back({image_id, model->AddPoint2D(image_id, pixel)});
  const point3D_t id = model->AddPoint3D(xyz, track, origin, rgb);
  Point3D& point = model->points3D.at(id);
  point.error = MeanReprojectionErrorPx(*model, point).value_or(-1.0);
  return id;
}

}  // namespace holba
