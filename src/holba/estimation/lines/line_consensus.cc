// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_consensus.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/geometry/angle.h"

namespace holba {
namespace {

// Scales of the score between two proposals of one segment.
constexpr double kScoreRelativeDepth = 0.015;
constexpr double kScoreAngle3dDeg = 10.0;
// Scales of the score between a proposal and a segment of another image.
constexpr double kScoreDistancePx = 2.0;
constexpr double kScoreAngleDeg = 5.0;
constexpr double kMinScoreOverlap = 0.05;
// For overlaps below this the angle's scale falls linearly to kLittleOverlapDeg.
constexpr double kLittleOverlap = 0.2;
constexpr double kLittleOverlapDeg = 1.0;

// Score of a proposal with these ends against a segment of the view.
double ScoreInImage(const SceneView& view, const SceneSegment& segment,
                    const Eigen::Vector3d& start, const Eigen::Vector3d& end, bool oriented) {
  const std::optional<Eigen::Vector2d> a = view.view.Project(start), b = view.view.Project(end);
  if (!a || !b) return 0.0;
  double distance = std::max(std::abs(segment.line.dot(a->homogeneous())),
                             std::abs(segment.line.dot(b->homogeneous())));
  if (distance > kScoreDistancePx) return 0.0;
  const Eigen::Vector2d across = *b - *a;
  const double length = across.norm();
  if (!(length > 0.0)) return 0.0;
  const Eigen::Vector2d along = across / length;
  const double cosine = along.dot(segment.along);
  if (oriented && cosine < 0.0) return 0.0;
  const double overlap = OverlapInImage(segment, *a, *b);
  if (overlap <= kMinScoreOverlap) return 0.0;
  double threshold = kScoreAngleDeg;
  if (overlap < kLittleOverlap) {
    threshold = kLittleOverlapDeg + (kScoreAngleDeg - kLittleOverlapDeg) *
                                        (overlap - kMinScoreOverlap) /
                                        (kLittleOverlap - kMinScoreOverlap);
  }
  const double sine = along.x() * segment.along.y() - along.y() * segment.along.x();
  const double angle = std::asin(std::min(1.0, std::abs(sine))) / kRadPerDeg;
  const Eigen::Vector2d normal(-along.y(), along.x());
  distance = std::max({distance, std::abs(normal.dot(segment.ideal.start - *a)),
                       std::abs(normal.dot(segment.ideal.end - *a))});
  return std::min(ScoreOf(angle, threshold), ScoreOf(distance, kScoreDistancePx));
}

}  // namespace

double ScoreOf(double value, double threshold) {
  // exp(-(1/2) (x / 0.8493)^2) is a half at x = 1.
  if (!(value <= threshold)) return 0.0;
  const double x = value / threshold;
  return std::exp2(-x * x);
}

void ProposalScorer::Score(std::vector<Proposal>* unsorted, SegmentNode* node) {
  std::vector<Proposal>& proposals = *unsorted;
  std::stable_sort(proposals.begin(), proposals.end(), [](const Proposal& a, const Proposal& b) {
    return a.length_start < b.length_start;
  });
  best_of_view_.assign(scene_.views.size(), 0.0);
  const double min_cosine = std::cos(kScoreAngle3dDeg * kRadPerDeg);
  size_t first = 0;
  double plane_score = 0.0;
  for (size_t i = 0; i < proposals.size(); ++i) {
    const Proposal& p = proposals[i];
    const double window = kScoreRelativeDepth * p.length_start;
    while (proposals[first].length_start < p.length_start - window) ++first;
    touched_.clear();
    for (size_t k = first; k < proposals.size(); ++k) {
      const Proposal& q = proposals[k];
      if (q.length_start > p.length_start + window) break;
      if (q.view == p.view) continue;
      const double end = std::abs(q.length_end - p.length_end) / p.length_end;
      if (end > kScoreRelativeDepth) continue;
      const double cosine = p.along.dot(q.along);
      if (cosine < min_cosine) continue;
      const double start = std::abs(q.length_start - p.length_start) / p.length_start;
      double& best = best_of_view_[q.view];
      double score =
          std::min(ScoreOf(std::max(start, end), kScoreRelativeDepth),
                   ScoreOf(std::acos(std::min(1.0, cosine)) / kRadPerDeg, kScoreAngle3dDeg));
      if (score <= best) continue;
      score = std::min(score,
                       ScoreInImage(scene_.views[q.view], scene_.views[q.view].segments[q.segment],
                                    p.start, p.end, options_.oriented));
      if (score <= best) continue;
      if (best == 0.0) touched_.push_back(q.view);
      best = score;
    }
    double sum = 0.0;
    std::sort(touched_.begin(), touched_.end());
    for (uint32_t view : touched_) {
      sum += best_of_view_[view];
      best_of_view_[view] = 0.0;
    }
    if (sum < options_.min_score) continue;
    node->agreeing.push_back({p.view, p.segment});
    if (p.plane >= 0 && sum > plane_score) {
      plane_score = sum;
      node->plane = p.plane;
    }
    if (!node->placed || sum > node->score) {
      node->placed = true;
      node->score = sum;
      node->kind = p.kind;
      node->start = p.start;
      node->end = p.end;
    }
  }
  std::sort(node->agreeing.begin(), node->agreeing.end());
  node->agreeing.erase(std::unique(node->agreeing.begin(), node->agreeing.end()),
                       node->agreeing.end());
}

}  // namespace holba
