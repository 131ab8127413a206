// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vanishing_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "holba/base/random.h"
#include "holba/estimation/directions/direction_fit.h"
#include "holba/geometry/angle.h"
#include "holba/robust/j_linkage.h"

namespace holba {
namespace {

// Two lines always meet, so three are the fewest whose meeting says something.
constexpr size_t kMinCluster = 3;
// Sine of the angle of two planes below which their intersection is rounding.
constexpr double kMinSine = 1e-9;

struct Candidate {
  Eigen::Vector3d direction;
  std::vector<size_t> members;  // positions in `used`, of segments that no accepted point has
  int support = 0;              // distinct lines among them
};

class Detection {
 public:
  Detection(const VanishingPointOptions& options, std::span<const LineSegment2d> segments,
            const Eigen::Matrix3d& K)
      : options_(options), segments_(segments), K_(K) {
    for (size_t i = 0; i < segments.size(); ++i) {
      const double length_px = segments[i].Length();
      if (length_px > 0.0 && length_px >= options.min_length_px && std::isfinite(length_px)) {
        used_.push_back(i);
      }
    }
    std::stable_sort(used_.begin(), used_.end(), [&](size_t a, size_t b) {
      return segments[a].Length() > segments[b].Length();
    });
    for (const size_t i : used_) {
      evidence_.emplace_back(segments[i], K);
      const double sine = std::min(1.0, 2.0 * options.max_error_px / segments[i].Length());
      chances_.push_back(std::asin(sine) * 2.0 / std::numbers::pi);
    }
  }

  VanishingPoints Run() {
    VanishingPoints found;
    found.vp_of_segment.assign(segments_.size(), -1);
    if (used_.size() < kMinCluster) return found;
    std::vector<Candidate> candidates = FindCandidates();
    std::vector<bool> taken(used_.size(), false);
    std::vector<Eigen::Vector3d> accepted;
    while (const std::optional<Candidate> best = Strongest(taken, accepted, &candidates)) {
      accepted.push_back(best->direction);
      for (const size_t k : best->members) taken[k] = true;
    }
    Label(accepted, &found);
    return found;
  }

 private:
  bool Agrees(size_t k, const Eigen::Vector3d& direction) const {
    return evidence_[k].SquaredError(direction) < options_.max_error_px * options_.max_error_px;
  }

  std::vector<Eigen::Vector3d> DrawHypotheses(size_t n) const {
    std::vector<Eigen::Vector3d> hypotheses;
    const auto intersect = [&](size_t a, size_t b) {
      const Eigen::Vector3d &n1 = evidence_[a].normal(), &n2 = evidence_[b].normal();
      const Eigen::Vector3d d = n1.cross(n2);
      if (d.norm() > kMinSine * n1.norm() * n2.norm()) hypotheses.push_back(d.normalized());
    };
    if (n * (n - 1) / 2 <= static_cast<size_t>(options_.num_hypotheses)) {
      for (size_t a = 0; a < n; ++a) {
        for (size_t b = a + 1; b < n; ++b) intersect(a, b);
      }
      return hypotheses;
    }
    Random random(options_.seed);
    for (int i = 0; i < options_.num_hypotheses; ++i) {
      const size_t a = random.Index(n);
      const size_t b = random.Index(n - 1);
      intersect(a, b < a ? b : b + 1);
    }
    return hypotheses;
  }

  PreferenceSets Preferences(size_t n, const std::vector<Eigen::Vector3d>& hypotheses) const {
    PreferenceSets sets(n, hypotheses.size());
    Eigen::ArrayX3d v(hypotheses.size(), 3);  // images of the hypotheses
    for (size_t j = 0; j < hypotheses.size(); ++j) v.row(j) = (K_ * hypotheses[j]).transpose();
    const double max_squared = options_.max_error_px * options_.max_error_px;
    for (size_t k = 0; k < n; ++k) {
      // DirectionEvidence::SquaredError in a form that the compiler vectorises.
      const LineSegment2d& segment = segments_[used_[k]];
      const Eigen::Vector2d middle = 0.5 * (segment.start + segment.end);
      const Eigen::Vector2d half = 0.5 * (segment.end - segment.start);
      const double mx = middle.x(), my = middle.y(), hx = half.x(), hy = half.y();
      const double half_squared = half.squaredNorm();
      const double *vx = v.col(0).data(), *vy = v.col(1).data(), *vz = v.col(2).data();
      uint64_t* const words = sets.Words(k);
      for (size_t begin = 0; begin < hypotheses.size(); begin += 64) {
        const size_t size = std::min<size_t>(64, hypotheses.size() - begin);
        double agrees[64];
        for (size_t j = 0; j < size; ++j) {
          const double z = vz[begin + j];
          const double ux = vx[begin + j] - z * mx, uy = vy[begin + j] - z * my;
          const double distance = ux * ux + uy * uy, cross = hx * uy - hy * ux;
          // Both below 0: it agrees.
          agrees[j] =
              std::max(cross * cross - max_squared * distance, z * z * half_squared - distance);
        }
        uint64_t word = 0;
        for (size_t j = 0; j < size; ++j) word |= uint64_t{agrees[j] < 0.0} << j;
        words[begin / 64] = word;
      }
    }
    return sets;
  }

  std::vector<Candidate> FindCandidates() const {
    const size_t n = std::min<size_t>(used_.size(), options_.max_num_segments);
    std::vector<Candidate> candidates;
    for (const auto& cluster : ClusterByJLinkage(Preferences(n, DrawHypotheses(n)))) {
      if (cluster.size() < kMinCluster) continue;
      Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
      for (const size_t k : cluster) {
        const Eigen::Vector3d normal = evidence_[k].normal().normalized();
        scatter += normal * normal.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
      const auto refined =
          RefineDirection(evidence_, options_.max_error_px, eigen.eigenvectors().col(0));
      if (refined) candidates.push_back({.direction = *refined});
    }
    return candidates;
  }

  // Members (by falling length) whose line is apart from those of the ones before.
  int CountDistinct(const std::vector<size_t>& members) const {
    std::vector<Eigen::Vector3d> lines;
    for (const size_t k : members) {
      const LineSegment2d& segment = segments_[used_[k]];
      const bool is_known = std::any_of(lines.begin(), lines.end(), [&](const auto& line) {
        return std::abs(line.dot(segment.start.homogeneous())) < options_.min_line_distance_px &&
               std::abs(line.dot(segment.end.homogeneous())) < options_.min_line_distance_px;
      });
      if (!is_known) lines.push_back(segment.Line());
    }
    return static_cast<int>(lines.size());
  }

  // Probability that `support` or more of the segments that are not taken agree with a given point
  // if each had a random direction: Hoeffding's bound (1963, theorem 1) for independent events
  // of unequal probability, that a segment of length L is within the angle asin(2 max_error / L).
  double Chance(const std::vector<bool>& taken, int support) const {
    double expected = 0.0;
    int n = 0;
    for (size_t k = 0; k < used_.size(); ++k) {
      if (taken[k]) continue;
      expected += chances_[k];
      ++n;
    }
    if (!(support > expected)) return 1.0;
    const double share = static_cast<double>(support) / n, mean = expected / n;
    double log_chance = support * std::log(mean / share);
    if (support < n) log_chance += (n - support) * std::log((1.0 - mean) / (1.0 - share));
    return std::exp(log_chance);
  }

  // The acceptable candidate with the most members among segments that are not taken; those that
  // repeat an accepted one are dropped. Empty: none is acceptable.
  std::optional<Candidate> Strongest(const std::vector<bool>& taken,
                                     const std::vector<Eigen::Vector3d>& accepted,
                                     std::vector<Candidate>* candidates) const {
    const double min_cosine = std::cos(options_.min_angle_deg * kRadPerDeg);
    const double max_cosine = std::sin(options_.max_orthogonality_error_deg * kRadPerDeg);
    std::erase_if(*candidates, [&](const Candidate& c) {
      return std::any_of(accepted.begin(), accepted.end(), [&](const Eigen::Vector3d& d) {
        return std::abs(d.dot(c.direction)) > min_cosine;
      });
    });
    // Probability that a random direction is orthogonal to one of them: bands around great circles.
    const double chance_of_orthogonality = std::min(1.0, max_cosine * accepted.size());
    const Candidate* best = nullptr;
    bool best_stands_alone = false;
    for (Candidate& c : *candidates) {
      c.members.clear();
      for (size_t k = 0; k < used_.size(); ++k) {
        if (!taken[k] && Agrees(k, c.direction)) c.members.push_back(k);
      }
      c.support = CountDistinct(c.members);
      const double chance = Chance(taken, c.support);
      const bool stands_alone = c.support >= options_.min_support && chance <= options_.max_chance;
      const bool is_orthogonal =
          c.support >= options_.min_orthogonal_support &&
          chance * chance_of_orthogonality <= options_.max_chance &&
          std::any_of(accepted.begin(), accepted.end(), [&](const Eigen::Vector3d& d) {
            return std::abs(d.dot(c.direction)) < max_cosine;
          });
      if (!stands_alone && !is_orthogonal) continue;
      // Candidates that need an orthogonal direction come after all that do not.
      if (!best || std::pair(stands_alone, c.members.size()) >
                       std::pair(best_stands_alone, best->members.size())) {
        best = &c;
        best_stands_alone = stands_alone;
      }
    }
    if (!best) return std::nullopt;
    return *best;
  }

  void Label(const std::vector<Eigen::Vector3d>& directions, VanishingPoints* found) const {
    std::vector<int32_t> label_of_used(used_.size(), -1);
    std::vector<ImageVanishingPoint> points;
    for (const Eigen::Vector3d& d : directions) points.push_back({.direction_in_cam = d});
    for (size_t k = 0; k < used_.size(); ++k) {
      double least = options_.max_error_px * options_.max_error_px;
      for (size_t i = 0; i < directions.size(); ++i) {
        const double error = evidence_[k].SquaredError(directions[i]);
        if (error < least) {
          least = error;
          label_of_used[k] = static_cast<int32_t>(i);
        }
      }
      if (label_of_used[k] >= 0) ++points[label_of_used[k]].num_segments;
    }
    std::vector<int32_t> order(points.size()), rank(points.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
      return points[a].num_segments > points[b].num_segments;
    });
    for (size_t i = 0; i < order.size(); ++i) {
      rank[order[i]] = static_cast<int32_t>(i);
      found->points.push_back(points[order[i]]);
    }
    for (size_t k = 0; k < used_.size(); ++k) {
      if (label_of_used[k] >= 0) found->vp_of_segment[used_[k]] = rank[label_of_used[k]];
    }
  }

  const VanishingPointOptions& options_;
  std::span<const LineSegment2d> segments_;
  Eigen::Matrix3d K_;
  std::vector<size_t> used_;  // segments that take part, by falling length
  std::vector<DirectionEvidence> evidence_;
  std::vector<double> chances_;  // that a random direction agrees with a given point
};

}  // namespace

void VanishingPointOptions::Describe(OptionTable* table) const {
  table->Section("VanishingPoints");
  table->Field("max_error_px", &max_error_px, GreaterThan(0),
               "Largest distance of a segment's ends from the line through its middle and its "
               "vanishing point.");
  table->Field("min_length_px", &min_length_px, AtLeast(0), "Shorter segments do not take part.");
  table->Field("max_num_segments", &max_num_segments, AtLeast(3),
               "Of more segments the longest are clustered.");
  table->Field("num_hypotheses", &num_hypotheses, AtLeast(1), "Pairs of segments intersected.");
  table->Field("seed", &seed, AnyValue(), "Seed of the choice of pairs.");
  table->Field("min_support", &min_support, AtLeast(3),
               "Fewest distinct lines of a vanishing point.");
  table->Field("min_orthogonal_support", &min_orthogonal_support, AtLeast(3),
               "The same where it is orthogonal to another one.");
  table->Field("max_orthogonality_error_deg", &max_orthogonality_error_deg, Between(0, 90),
               "Largest deviation from 90 degrees of orthogonal vanishing points.");
  table->Field("max_chance", &max_chance, Between(0, 1),
               "Largest probability that as many random segments agree with a vanishing point.");
  table->Field("min_line_distance_px", &min_line_distance_px, AtLeast(0),
               "Segments nearer to the line of a longer one count with it as one line.");
  table->Field("min_angle_deg", &min_angle_deg, Between(0, 90), "Nearer vanishing points are one.");
}

VanishingPoints DetectVanishingPoints(const VanishingPointOptions& options,
                                      std::span<const LineSegment2d> ideal_segments,
                                      const Eigen::Matrix3d& K) {
  return Detection(options, ideal_segments, K).Run();
}

}  // namespace holba
