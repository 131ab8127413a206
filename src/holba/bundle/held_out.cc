// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/held_out.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/camera/camera_model.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

// Steps of one point; from its place at nearly the same cameras it takes two or three, more where
// an observation is an outlier by half.
constexpr int kMaxIterations = 50;
constexpr int kMaxStepHalvings = 6;
// Relative change of a point's cost below which it has arrived.
constexpr double kTolerance = 1e-9;
// An observation of a point behind the camera costs as much as one that misses by so many scales.
constexpr double kAbsentScales = 1e3;

constexpr double kNearTrustRadius = 1e8;
constexpr double kNearTolerance = 1e-6;

// 32 regions, eight in a fold: large beside the distances over which errors are alike, and
// enough that each fold leaves out a bit of everything.
constexpr int kHalvings = 5;

// A point, or the middle of a line.
struct Located {
  Eigen::Vector3d xyz;
  uint64_t id;
  bool is_line;
  bool is_judged;
};

// Calls visit(region) for the regions that halving at the median, across the longest side, makes.
template <typename Visitor>
void ForEachRegion(std::span<Located> points, int levels, const Visitor& visit) {
  if (levels == 0 || points.size() < 2) {
    if (!points.empty()) visit(points);
    return;
  }
  Eigen::AlignedBox3d box;
  for (const Located& point : points) box.extend(point.xyz);
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const size_t half = points.size() / 2;
  std::nth_element(
      points.begin(), points.begin() + half, points.end(), [&](const Located& a, const Located& b) {
        return std::tuple(a.xyz[axis], a.is_line, a.id) < std::tuple(b.xyz[axis], b.is_line, b.id);
      });
  ForEachRegion(points.subspan(0, half), levels - 1, visit);
  ForEachRegion(points.subspan(half), levels - 1, visit);
}

// One observation: its camera, and where it was seen.
struct Sighting {
  const CameraModel* model;
  const double* params;
  Rigid3d cam_from_world;
  Eigen::Vector2d pixel;
};

struct NormalEquations {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

// Sum of log(1 + |r|^2 / scale^2), with the normal equations of the reweighted squares if wanted.
double CostAt(std::span<const Sighting> sightings, const Eigen::Vector3d& X, double scale_px,
              NormalEquations* normal) {
  const double by_square = 1.0 / (scale_px * scale_px);
  double cost = 0.0;
  for (const Sighting& s : sightings) {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J;
    const Eigen::Vector3d in_cam = s.cam_from_world * X;
    const bool present =
        normal ? s.model->project_with_jacobian(s.params, in_cam, &pixel, J.data(), nullptr)
               : s.model->project(s.params, in_cam, &pixel);
    if (!present) {
      cost += std::log1p(kAbsentScales * kAbsentScales);
      continue;
    }
    const Eigen::Vector2d r = pixel - s.pixel;
    const double square = r.squaredNorm() * by_square;
    cost += std::log1p(square);
    if (!normal) continue;
    const double weight = by_square / (1.0 + square);
    const Eigen::Matrix<double, 2, 3> J_world = J * s.cam_from_world.rotation.toRotationMatrix();
    normal->H += weight * J_world.transpose() * J_world;
    normal->g += weight * J_world.transpose() * r;
  }
  return cost;
}

double BestCost(std::span<const Sighting> sightings, Eigen::Vector3d X, double scale_px) {
  double cost = CostAt(sightings, X, scale_px, nullptr);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    NormalEquations normal;
    CostAt(sightings, X, scale_px, &normal);
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal.H);
    if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0.0)) break;
    const Eigen::Vector3d step = -ldlt.solve(normal.g);
    if (!step.allFinite()) break;
    double length = 1.0, next = cost;
    for (int halving = 0; halving < kMaxStepHalvings; ++halving, length *= 0.5) {
      next = CostAt(sightings, X + length * step, scale_px, nullptr);
      if (next < cost) break;
    }
    if (!(next < cost)) break;
    X += length * step;
    const bool arrived = cost - next <= kTolerance * cost;
    cost = next;
    if (arrived) break;
  }
  return cost;
}

}  // namespace

size_t NumImages(const std::vector<PointObservation>& track, const FlatIndex& image_idx) {
  std::vector<image_t> images;
  for (const PointObservation& o : track) {
    if (image_idx.contains(o.image_id) &&
        std::find(images.begin(), images.end(), o.image_id) == images.end())
      images.push_back(o.image_id);
  }
  return images.size();
}

BundleSelection WithoutPoints(BundleSelection selection, const std::vector<point3D_t>& ids) {
  const std::unordered_set<point3D_t> out(ids.begin(), ids.end());
  std::erase_if(selection.points, [&](const auto& point) { return out.contains(point.id); });
  return selection;
}

HeldOutPoints::HeldOutPoints(const Reconstruction& model, const BundleSelection& selection)
    : folds_(kNumFolds) {
  for (const auto& [id, image] : ImagesOf(model, selection)) image_idx_.Add(id);
  std::vector<Located> located;
  located.reserve(selection.points.size());
  for (const auto& selected : selection.points) {
    if (selected.constant) continue;
    const Point3D& point = model.points3D.at(selected.id);
    located.push_back(
        {point.xyz, selected.id, false,
         !IsOfStructure(point.origin) && NumImages(point.track, image_idx_) >= kMinImages});
  }
  for (const auto& selected : selection.lines) {
    if (selected.constant) continue;
    const Line3D& line = model.lines3D.at(selected.id);
    located.push_back({0.5 * (line.start + line.end), selected.id, true, false});
  }
  size_t region = 0;
  ForEachRegion(std::span(located), kHalvings, [&](std::span<const Located> points) {
    Fold& fold = folds_[region++ % kNumFolds];
    for (const Located& located : points) {
      (located.is_line ? fold.lines : fold.points).push_back(located.id);
      if (located.is_judged) fold.judged.push_back(located.id);
    }
  });
}

BundleSelection HeldOutPoints::Without(size_t fold, BundleSelection selection) const {
  const std::unordered_set<line3D_t> out(folds_[fold].lines.begin(), folds_[fold].lines.end());
  std::erase_if(selection.lines, [&](const auto& line) { return out.contains(line.id); });
  return WithoutPoints(std::move(selection), folds_[fold].points);
}

std::vector<double> HeldOutPoints::PredictionCosts(size_t fold, const Reconstruction& model,
                                                   double scale_px, int num_threads) const {
  const std::vector<point3D_t>& ids = folds_[fold].judged;
  std::vector<double> costs(ids.size());
  ParallelFor(num_threads, ids.size(), [&](size_t begin, size_t end) {
    std::vector<Sighting> sightings;
    for (size_t i = begin; i < end; ++i) {
      const Point3D& point = model.points3D.at(ids[i]);
      sightings.clear();
      for (const PointObservation& o : point.track) {
        if (!image_idx_.contains(o.image_id)) continue;
        const Image& image = model.images.at(o.image_id);
        const Camera& camera = model.cameras.at(image.camera_id);
        sightings.push_back({camera.model, camera.params.data(), image.cam_from_world,
                             image.points2D[o.point2D_idx].xy});
      }
      costs[i] = BestCost(sightings, point.xyz, scale_px);
    }
  });
  return costs;
}

SolverOptions StepsFromNear(SolverOptions options, int num_iterations) {
  options.analyse_reduced_system = false;
  options.max_num_iterations = std::min(options.max_num_iterations, num_iterations);
  options.function_tolerance = kNearTolerance;
  options.initial_trust_radius = kNearTrustRadius;
  return options;
}

PairedMean MeanDifference(const std::vector<double>& a, const std::vector<double>& b) {
  HOLBA_CHECK(a.size() == b.size() && a.size() > 1);
  const double n = static_cast<double>(a.size());
  double sum = 0.0, squares = 0.0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] - b[i];
  const double mean = sum / n;
  for (size_t i = 0; i < a.size(); ++i) squares += std::pow(a[i] - b[i] - mean, 2);
  return {mean, std::sqrt(squares / (n * (n - 1.0)))};
}

}  // namespace holba
