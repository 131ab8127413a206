// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/multi_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "holba/base/threads.h"
#include "holba/evaluation/box_tree.h"
#include "holba/evaluation/nearest_distance.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxCell = std::numeric_limits<int32_t>::max();

// What is known of a reconstructed point: how near the nearest scanned point is that counts for it,
// and whether it lies in space that is free.
struct Evidence {
  double distance_m = kInfinity;
  bool is_in_free_space = false;

  bool IsAccurate(double tolerance_m) const { return distance_m <= tolerance_m; }
  bool IsObserved(double tolerance_m) const { return IsAccurate(tolerance_m) || is_in_free_space; }
};

// The directions of a scan's beams, for those that pass near a point.
class Beams {
 public:
  Beams(std::span<const Eigen::Vector3d> points, const MultiViewOptions& options)
      : start_radius_m_(options.beam_start_radius_mm / 1000.0),
        tan_divergence_(std::tan(options.beam_divergence_halfangle_deg / kDegPerRad)),
        tree_(BoxesOf(points)) {
    points_.reserve(points.size());
    for (const uint32_t i : tree_.order()) points_.push_back(points[i]);
  }

  void Collect(const Eigen::Vector3d& x, Evidence* evidence) const {
    const double distance = x.norm();
    const double radius = start_radius_m_ + distance * tan_divergence_;
    // Of directions whose axis passes x within the radius the angle a to x has sin a <= radius /
    // distance, which is a chord of 2 sin(a / 2); beyond, all in the same half of space.
    const double sine = distance > radius ? radius / distance : 1.0;
    const double chord = 2.0 * std::sin(0.5 * std::asin(sine)) * (1.0 + 1e-9) + 1e-12;
    const Eigen::Vector3d towards =
        distance > 0.0 ? Eigen::Vector3d(x / distance) : Eigen::Vector3d::UnitX();
    tree_.ForEachNear(towards, distance > 0.0 ? chord : 3.0, [&](uint32_t slot) {
      const Eigen::Vector3d& scanned = points_[slot];
      const double range = scanned.norm();
      if (!(range > 0.0)) return;
      const Eigen::Vector3d axis = scanned / range;
      const double along = axis.dot(x);
      if (along < 0.0 || (x - along * axis).squaredNorm() > radius * radius) return;
      evidence->distance_m = std::min(evidence->distance_m, (scanned - x).norm());
      if (along < range) evidence->is_in_free_space = true;
    });
  }

 private:
  static std::vector<Box3d> BoxesOf(std::span<const Eigen::Vector3d> points) {
    std::vector<Box3d> boxes(points.size());
    for (size_t i = 0; i < points.size(); ++i) boxes[i].Extend(points[i].normalized());
    return boxes;
  }

  double start_radius_m_, tan_divergence_;
  BoxTree tree_;
  std::vector<Eigen::Vector3d> points_;  // in the order of the tree's slots
};

// For each of two grids the voxel (x, y, z) and the index of each point, sorted by voxel.
using SortedCells = std::array<std::vector<std::array<int32_t, 4>>, 2>;

// The mean over the voxels of two grids of the share of points that are right, among those that
// count; `verdict(i)`: 0 does not count, 1 wrong, 2 right. 0 without voxels.
template <typename Verdict>
double MeanOverVoxels(const SortedCells& cells, const Verdict& verdict) {
  double sum = 0.0;
  size_t num_voxels = 0;
  for (const auto& grid : cells) {
    for (size_t begin = 0, end = 0; begin < grid.size(); begin = end) {
      size_t num_right = 0, num_counted = 0;
      while (end < grid.size() &&
             std::equal(grid[begin].begin(), grid[begin].begin() + 3, grid[end].begin())) {
        const int v = verdict(static_cast<size_t>(grid[end][3]));
        num_counted += v > 0;
        num_right += v == 2;
        ++end;
      }
      if (num_counted == 0) continue;
      sum += static_cast<double>(num_right) / static_cast<double>(num_counted);
      ++num_voxels;
    }
  }
  return num_voxels > 0 ? sum / static_cast<double>(num_voxels) : 0.0;
}

SortedCells SortedIntoVoxels(std::span<const Eigen::Vector3d> points, double voxel_size_m,
                             int num_threads) {
  SortedCells cells;
  ParallelTasks(num_threads, 2, [&](size_t grid) {
    const double shift = grid == 0 ? 0.0 : 0.5;
    cells[grid].resize(points.size());
    for (size_t i = 0; i < points.size(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        const double cell = std::floor(points[i][axis] / voxel_size_m + shift);
        cells[grid][i][axis] = static_cast<int32_t>(std::clamp(cell, -kMaxCell, kMaxCell));
      }
      cells[grid][i][3] = static_cast<int32_t>(i);
    }
    std::sort(cells[grid].begin(), cells[grid].end());
  });
  return cells;
}

std::vector<Evidence> CollectEvidence(std::span<const Eigen::Vector3d> points,
                                      std::span<const TruthScan> scans,
                                      const MultiViewOptions& options, int num_threads) {
  std::vector<Evidence> evidence(points.size());
  for (const TruthScan& scan : scans) {
    const Rigid3d scan_from_world = scan.world_from_scan.Inverse();
    if (!scan.has_scanner) {
      std::vector<Eigen::Vector3d> in_scan;
      for (const Eigen::Vector3d& x : points) in_scan.push_back(scan_from_world * x);
      const std::vector<double> distances =
          NearestDistance::ToPoints(scan.points).Of(in_scan, num_threads);
      for (size_t i = 0; i < points.size(); ++i) {
        evidence[i].distance_m = std::min(evidence[i].distance_m, distances[i]);
        evidence[i].is_in_free_space = true;
      }
      continue;
    }
    const Beams beams(scan.points, options);
    ParallelFor(num_threads, points.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) beams.Collect(scan_from_world * points[i], &evidence[i]);
    });
  }
  return evidence;
}

}  // namespace

void MultiViewOptions::Describe(OptionTable* table) const {
  table->Section("MultiView");
  table->Field("tolerances_cm", &tolerances_cm, GreaterThan(0),
               "Tolerances of ETH3D's accuracy, completeness and F1, centimetres.");
  table->Field("voxel_size_m", &voxel_size_m, GreaterThan(0),
               "Side of the voxels over which these are averaged, metres.");
  table->Field("beam_start_radius_mm", &beam_start_radius_mm, AtLeast(0),
               "Radius of the scanner's beam at the scanner, millimetres.");
  table->Field("beam_divergence_halfangle_deg", &beam_divergence_halfangle_deg, Between(0, 45),
               "Half of the angle by which the scanner's beam widens, degrees.");
  table->Section("");
}

MultiViewErrors MeasureMultiView(std::span<const Eigen::Vector3d> points,
                                 std::span<const TruthScan> scans, const MultiViewOptions& options,
                                 int num_threads) {
  std::vector<Eigen::Vector3d> scanned;
  for (const TruthScan& scan : scans) {
    for (const Eigen::Vector3d& x : scan.points) scanned.push_back(scan.world_from_scan * x);
  }
  const std::vector<double> scanned_m = NearestDistance::ToPoints(points).Of(scanned, num_threads);
  const std::vector<Evidence> evidence = CollectEvidence(points, scans, options, num_threads);
  const auto scanned_cells = SortedIntoVoxels(scanned, options.voxel_size_m, num_threads);
  const auto point_cells = SortedIntoVoxels(points, options.voxel_size_m, num_threads);

  MultiViewErrors errors;
  for (const double tolerance_cm : options.tolerances_cm) {
    const double tolerance_m = tolerance_cm / 100.0;
    const double completeness = MeanOverVoxels(
        scanned_cells, [&](size_t i) { return scanned_m[i] <= tolerance_m ? 2 : 1; });
    const double accuracy = MeanOverVoxels(point_cells, [&](size_t i) {
      if (evidence[i].IsAccurate(tolerance_m)) return 2;
      return evidence[i].IsObserved(tolerance_m) ? 1 : 0;
    });
    const double sum = accuracy + completeness;
    errors.accuracy_percent.push_back(100.0 * accuracy);
    errors.completeness_percent.push_back(100.0 * completeness);
    errors.f1_percent.push_back(sum > 0.0 ? 200.0 * accuracy * completeness / sum : 0.0);
    errors.num_observed.push_back(
        static_cast<size_t>(std::count_if(evidence.begin(), evidence.end(), [&](const Evidence& e) {
          return e.IsObserved(tolerance_m);
        })));
  }
  return errors;
}

}  // namespace holba
