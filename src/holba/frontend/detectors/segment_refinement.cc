// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_refinement.h"

#include <array>
#include <cmath>
#include <utility>

namespace holba {
namespace {

// Profiles across the segment: one for each pixel along it, sampled so far to either side.
constexpr float kStepPx = 0.5f;
constexpr int kNumSteps = 4;  // to each side: 2 px
constexpr int kProfileSize = 2 * kNumSteps + 1;
// Profiles of so many neighbours to either side are added up before the maximum is looked for: a
// detector's direction is good enough for that, and noise is not.
constexpr int kHalfWindow = 1;
// Scale of Cauchy's loss; maxima at twice that from the fitted line do not support it.
constexpr double kRobustScalePx = 0.6;
constexpr double kMinInlierShare = 0.5;
// A detector errs by less than this; a line farther away is another edge.
constexpr double kMaxEndMovePx = 1.0;

struct Maximum {
  double along;   // from the middle of the segment
  double offset;  // towards the brighter side
  double weight;
};

}  // namespace

void OrientSegments(const GradientImage& gradients, std::vector<LineSegment2d>* segments) {
  for (LineSegment2d& segment : *segments) {
    const Eigen::Vector2f normal = segment.Line().head<2>().cast<float>();
    const Eigen::Vector2f start = segment.start.cast<float>();
    const Eigen::Vector2f step = (segment.end - segment.start).cast<float>();
    const int count = std::max(2, static_cast<int>(std::ceil(segment.Length())));
    float sum = 0.0f;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2f p = start + step * ((static_cast<float>(i) + 0.5f) / count);
      sum += gradients.At(p.x(), p.y()).dot(normal);
    }
    if (sum < 0.0f) std::swap(segment.start, segment.end);
  }
}

std::optional<LineSegment2d> RefineSegment(const GradientImage& gradients,
                                           const LineSegment2d& segment) {
  const double length = segment.Length();
  if (!(length > 2.0)) return std::nullopt;
  const Eigen::Vector2f start = segment.start.cast<float>();
  const Eigen::Vector2f along = ((segment.end - segment.start) / length).cast<float>();
  const Eigen::Vector2f normal(-along.y(), along.x());
  const int count = static_cast<int>(std::ceil(length));
  const float spacing = static_cast<float>(length) / count;

  std::vector<std::array<float, kProfileSize>> profiles(count);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2f p = start + along * (spacing * (static_cast<float>(i) + 0.5f));
    for (int k = 0; k < kProfileSize; ++k) {
      const Eigen::Vector2f q = p + normal * (kStepPx * static_cast<float>(k - kNumSteps));
      profiles[i][k] = gradients.At(q.x(), q.y()).dot(normal);
    }
  }

  std::vector<Maximum> maxima;
  maxima.reserve(count);
  for (int i = 0; i < count; ++i) {
    std::array<float, kProfileSize> sum{};
    const int first = std::max(0, i - kHalfWindow), last = std::min(count - 1, i + kHalfWindow);
    for (int j = first; j <= last; ++j) {
      for (int k = 0; k < kProfileSize; ++k) sum[k] += profiles[j][k];
    }
    // The highest local maximum inside the profile.
    int best = -1;
    for (int k = 1; k + 1 < kProfileSize; ++k) {
      if (sum[k] > 0.0f && sum[k] >= sum[k - 1] && sum[k] > sum[k + 1] &&
          (best < 0 || sum[k] > sum[best]))
        best = k;
    }
    if (best < 0) continue;
    // An edge blurred by a Gaussian has a Gaussian profile: a parabola of its logarithm.
    const float floor = 1e-3f * sum[best];
    const double a = std::log(std::max(sum[best - 1], floor)), b = std::log(sum[best]),
                 c = std::log(std::max(sum[best + 1], floor));
    const double curvature = a - 2.0 * b + c;
    if (!(curvature < 0.0)) continue;
    const double peak = best - kNumSteps + 0.5 * (a - c) / curvature;
    maxima.push_back({(spacing * (i + 0.5)) - 0.5 * length, kStepPx * peak, sum[best]});
  }
  if (maxima.size() < kMinInlierShare * count || maxima.size() < 3) return std::nullopt;

  // offset = shift + slope * along, from the detector's line on: weights by the gradient, Cauchy.
  double shift = 0.0, slope = 0.0;
  constexpr int kIterations = 8;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double w = 0, ws = 0, wss = 0, wy = 0, wsy = 0;
    for (const Maximum& m : maxima) {
      const double r = (m.offset - shift - slope * m.along) / kRobustScalePx;
      const double weight = m.weight / (1.0 + r * r);
      w += weight;
      ws += weight * m.along;
      wss += weight * m.along * m.along;
      wy += weight * m.offset;
      wsy += weight * m.along * m.offset;
    }
    const double det = w * wss - ws * ws;
    if (!(det > 1e-9 * w * w)) return std::nullopt;
    shift = (wy * wss - wsy * ws) / det;
    slope = (w * wsy - ws * wy) / det;
  }
  int num_inliers = 0;
  for (const Maximum& m : maxima) {
    if (std::abs(m.offset - shift - slope * m.along) < 2.0 * kRobustScalePx) ++num_inliers;
  }
  const double at_start = shift - 0.5 * slope * length, at_end = shift + 0.5 * slope * length;
  if (num_inliers < kMinInlierShare * count || std::abs(at_start) > kMaxEndMovePx ||
      std::abs(at_end) > kMaxEndMovePx)
    return std::nullopt;
  const Eigen::Vector2d across = normal.cast<double>();
  return LineSegment2d{segment.start + at_start * across, segment.end + at_end * across};
}

}  // namespace holba
