// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/repetition.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/base/check.h"

namespace holba {
namespace {

// Keypoints that are looked at one by one: shares of them are within 3 %, for a tenth of the time
// of the matching.
constexpr size_t kMaxSampled = 256;
// Lines that are tried for the band.
constexpr size_t kMaxLines = 64;

double Angle(double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); }

// `count` of `size` indices, spread evenly.
std::vector<size_t> Spread(size_t size, size_t count) {
  std::vector<size_t> idxs;
  const size_t kept = std::min(size, count);
  for (size_t k = 0; k < kept; ++k) idxs.push_back(k * size / kept);
  return idxs;
}

class Limits {
 public:
  Limits(const DescriptorMatchOptions& options, bool are_floats)
      : max_ratio_(options.max_ratio),
        max_distance_(are_floats ? std::acos(options.min_cossim) : options.max_distance) {}

  bool IsNear(const FoundNeighbour& found) const {
    return found.idx >= 0 && Angle(found.cosine) <= max_distance_;
  }
  bool IsRepeated(const FoundNeighbour& found) const {
    return IsNear(found) && Angle(found.cosine) >= max_ratio_ * Angle(found.second_cosine);
  }
  // Least cosine of those that the ratio test would not tell from the nearest.
  double MinCosine(const FoundNeighbour& found) const {
    const double limit = max_ratio_ > 0.0 ? Angle(found.cosine) / max_ratio_ : M_PI;
    return std::cos(std::min({limit, max_distance_, M_PI}));
  }

 private:
  double max_ratio_, max_distance_;
};

// Square of the error of a match, as MatchGuided has it.
double SquaredError(const GuidingGeometry& geometry, const Eigen::Matrix3d& inverse_H,
                    const Eigen::Vector2d& x1, const Eigen::Vector2d& x2) {
  if (geometry.H) {
    const double forward = ((*geometry.H * x1.homogeneous()).hnormalized() - x2).squaredNorm();
    const double backward = ((inverse_H * x2.homogeneous()).hnormalized() - x1).squaredNorm();
    return 0.5 * (forward + backward);
  }
  const Eigen::Vector3d line2 = *geometry.F * x1.homogeneous();
  const Eigen::Vector3d line1 = geometry.F->transpose() * x2.homogeneous();
  const double e = x2.homogeneous().dot(line2);
  return e * e / (line2.head<2>().squaredNorm() + line1.head<2>().squaredNorm());
}

// Distance over that of the next best match of the keypoint, which is matched with `idx`.
double RatioOf(const FoundNeighbour& found, double distance, int32_t idx) {
  const double next = Angle(found.idx == idx ? found.second_cosine : found.cosine);
  if (distance == 0.0 && next == 0.0) return 1.0;
  return next > 0.0 ? distance / next : std::numeric_limits<double>::infinity();
}

// Median distance of points from the line that makes it the least.
double Band(const std::vector<Eigen::Vector2d>& points, const std::vector<Eigen::Vector3d>& lines) {
  double least = std::numeric_limits<double>::infinity();
  std::vector<double> distances(points.size());
  for (const size_t k : Spread(lines.size(), kMaxLines)) {
    const double norm = lines[k].head<2>().norm();
    if (!(norm > 0.0)) continue;
    for (size_t i = 0; i < points.size(); ++i)
      distances[i] = std::abs(lines[k].dot(points[i].homogeneous())) / norm;
    const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
    std::nth_element(distances.begin(), middle, distances.end());
    least = std::min(least, *middle);
  }
  return std::isfinite(least) ? least : 0.0;
}

}  // namespace

PairRepetition MeasureRepetition(const DescriptorMatchOptions& options,
                                 const GuidingGeometry& geometry, const Neighbours& neighbours,
                                 const PackedDescriptors& descriptors1,
                                 const std::vector<std::optional<Eigen::Vector2d>>& positions1,
                                 const PackedDescriptors& descriptors2,
                                 const std::vector<std::optional<Eigen::Vector2d>>& positions2,
                                 const PointMatches& inliers) {
  HOLBA_CHECK(geometry.F.has_value() != geometry.H.has_value());
  HOLBA_CHECK(neighbours.of_first.size() == descriptors1.size() &&
              neighbours.of_second.size() == descriptors2.size());
  PairRepetition result;
  const Limits limits(options, descriptors1.are_floats());
  std::vector<size_t> repeated;
  for (size_t i = 0; i < neighbours.of_first.size(); ++i) {
    result.num_near[0] += limits.IsNear(neighbours.of_first[i]);
    if (limits.IsRepeated(neighbours.of_first[i])) repeated.push_back(i);
  }
  result.num_repeated[0] = static_cast<uint32_t>(repeated.size());
  for (const FoundNeighbour& found : neighbours.of_second) {
    result.num_near[1] += limits.IsNear(found);
    result.num_repeated[1] += limits.IsRepeated(found);
  }

  const double max_squared_error = geometry.max_error_px * geometry.max_error_px;
  const Eigen::Matrix3d inverse_H =
      geometry.H ? Eigen::Matrix3d(geometry.H->inverse()) : Eigen::Matrix3d::Identity();
  for (const size_t k : Spread(repeated.size(), kMaxSampled)) {
    const size_t i = repeated[k];
    if (!positions1[i]) continue;
    ++result.num_sampled;
    const double min_cosine = limits.MinCosine(neighbours.of_first[i]);
    // One point may have several descriptors, one for each orientation: places count.
    std::optional<Eigen::Vector2d> first;
    bool is_undecided = false;
    for (size_t j = 0; j < descriptors2.size() && !is_undecided; ++j) {
      if (!positions2[j] ||
          !(SquaredError(geometry, inverse_H, *positions1[i], *positions2[j]) <= max_squared_error))
        continue;
      if (descriptors1.Cosine(i, descriptors2, j) < min_cosine) continue;
      if (!first) {
        first = positions2[j];
      } else {
        is_undecided = (*positions2[j] - *first).norm() > 2.0 * geometry.max_error_px;
      }
    }
    result.num_agreeing += first.has_value();
    result.num_undecided += is_undecided;
  }

  std::vector<Eigen::Vector2d> points1, points2;
  std::vector<Eigen::Vector3d> lines1, lines2;
  for (const auto& [idx1, idx2] : inliers) {
    HOLBA_CHECK(idx1 < descriptors1.size() && idx2 < descriptors2.size());
    const double distance = Angle(descriptors1.Cosine(idx1, descriptors2, idx2));
    const double ratio =
        std::max(RatioOf(neighbours.of_first[idx1], distance, static_cast<int32_t>(idx2)),
                 RatioOf(neighbours.of_second[idx2], distance, static_cast<int32_t>(idx1)));
    result.ratios.push_back(
        static_cast<float>(std::min(ratio, static_cast<double>(kMaxMatchRatio))));
    if (!geometry.F || !positions1[idx1] || !positions2[idx2]) continue;
    points1.push_back(*positions1[idx1]);
    points2.push_back(*positions2[idx2]);
    lines1.push_back(geometry.F->transpose() * positions2[idx2]->homogeneous());
    lines2.push_back(*geometry.F * positions1[idx1]->homogeneous());
  }
  if (!points1.empty()) result.band_px = {{Band(points1, lines1), Band(points2, lines2)}};
  return result;
}

}  // namespace holba
