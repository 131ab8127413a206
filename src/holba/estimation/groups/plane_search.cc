// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "holba/base/random.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

constexpr int kRefits = 4;
// Of the points beside it, so many lie on a plane that a sample at the point stands for.
constexpr size_t kMinNear = 6;

class PlaneSearch {
 public:
  PlaneSearch(const PlaneOptions& options, const PlanePoints& points,
              const std::vector<Eigen::Vector3d>& vp_normals, std::vector<bool> is_free)
      : options_(options),
        points_(points),
        vp_normals_(vp_normals),
        is_free_(std::move(is_free)),
        mark_(points.size(), 0) {}

  std::vector<FoundPlane> Run() {
    FreePoints();
    SampleAll();
    std::vector<FoundPlane> found;
    while (found.size() < static_cast<size_t>(options_.max_planes)) {
      FoundPlane plane = Best();
      if (plane.members.size() < static_cast<size_t>(options_.min_component)) break;
      Remove(plane.members);
      found.push_back(std::move(plane));
    }
    return found;
  }

 private:
  // Points laid out for scoring: single precision is 1e-7 of the scene's extent.
  struct Pool {
    std::vector<uint32_t> index;
    Eigen::ArrayXf x, y, z, inverse_limit;
  };
  Pool PoolOf(std::vector<uint32_t> index) const {
    Pool pool;
    const auto size = static_cast<Eigen::Index>(index.size());
    pool.x.resize(size);
    pool.y.resize(size);
    pool.z.resize(size);
    pool.inverse_limit.resize(size);
    for (Eigen::Index k = 0; k < size; ++k) {
      const PlanePoint& p = points_[index[static_cast<size_t>(k)]];
      pool.x[k] = static_cast<float>(p.X.x());
      pool.y[k] = static_cast<float>(p.X.y());
      pool.z[k] = static_cast<float>(p.X.z());
      pool.inverse_limit[k] = static_cast<float>(1.0 / p.limit);
    }
    pool.index = std::move(index);
    return pool;
  }
  static double Score(const Pool& pool, const PlaneParams& plane) {
    const Eigen::Vector3f n = plane.n.cast<float>();
    const float w = static_cast<float>(plane.w);
    // In pieces, so that no more than some hundreds of single precision numbers are added.
    constexpr Eigen::Index kPiece = 512;
    double sum = 0.0;
    for (Eigen::Index begin = 0; begin < pool.x.size(); begin += kPiece) {
      const Eigen::Index size = std::min(kPiece, pool.x.size() - begin);
      sum += (1.0f - ((n.x() * pool.x.segment(begin, size) + n.y() * pool.y.segment(begin, size) +
                       n.z() * pool.z.segment(begin, size) + w) *
                      pool.inverse_limit.segment(begin, size))
                         .square())
                 .max(0.0f)
                 .sum();
    }
    return sum;
  }
  void FreePoints() {
    std::vector<uint32_t> index;
    for (uint32_t i = 0; i < points_.size(); ++i) {
      if (is_free_[i]) index.push_back(i);
    }
    free_ = PoolOf(std::move(index));
  }

  // Calls visit(first, last, gain) for each connected set of the inliers, in order; the range is of
  // queue_.
  template <typename Visit>
  void ForEachComponent(const PlaneParams& plane, const std::vector<uint32_t>& inliers,
                        const Visit& visit) {
    for (uint32_t i : inliers) mark_[i] = 1;
    queue_.clear();
    for (uint32_t seed : inliers) {
      if (mark_[seed] != 1) continue;
      const size_t first = queue_.size();
      queue_.push_back(seed);
      mark_[seed] = 2;
      double gain = 0.0;
      for (size_t k = first; k < queue_.size(); ++k) {
        gain += points_.Gain(plane, queue_[k]);
        for (uint32_t j : points_.Connected(queue_[k])) {
          if (mark_[j] != 1) continue;
          mark_[j] = 2;
          queue_.push_back(j);
        }
      }
      visit(first, queue_.size(), gain);
    }
    for (uint32_t i : inliers) mark_[i] = 0;
  }

  const std::vector<uint32_t>& FreeInliers(const PlaneParams& plane) {
    inliers_.clear();
    for (uint32_t i : free_.index) {
      if (points_.IsWithinLimit(plane, i)) inliers_.push_back(i);
    }
    return inliers_;
  }

  // The largest set of free points on the plane that is connected to one of the seeds: its cost is
  // that of the set. (On a street most fronts lie near the plane of any other.)
  FoundPlane ComponentAround(const PlaneParams& plane, std::span<const uint32_t> seeds) {
    FoundPlane largest{plane, {}, 0.0};
    queue_.clear();
    const auto take = [&](uint32_t i) {
      if (mark_[i] != 0 || !is_free_[i] || !points_.IsWithinLimit(plane, i)) return;
      mark_[i] = 1;
      queue_.push_back(i);
    };
    for (const uint32_t seed : seeds) {
      const size_t first = queue_.size();
      take(seed);
      double gain = 0.0;
      for (size_t k = first; k < queue_.size(); ++k) {
        gain += points_.Gain(plane, queue_[k]);
        for (const uint32_t j : points_.Connected(queue_[k])) take(j);
      }
      if (gain <= largest.gain) continue;
      largest.gain = gain;
      largest.members.assign(queue_.begin() + static_cast<std::ptrdiff_t>(first), queue_.end());
    }
    for (const uint32_t i : queue_) mark_[i] = 0;
    std::sort(largest.members.begin(), largest.members.end());
    return largest;
  }

  std::optional<PlaneParams> Sample(uint32_t seed, bool by_vps, Random* random) const {
    PlaneParams plane;
    if (by_vps) {
      plane.n = vp_normals_[random->Index(vp_normals_.size())];
    } else {
      // Half of the samples are from the nearest third, for small planes; the others have a wider
      // base.
      constexpr size_t kNumNearest = PlanePoints::kNumNearest;
      const std::span<const uint32_t> nearest = points_.Nearest(seed);
      const size_t reach =
          std::min(nearest.size(), random->Index(2) == 0 ? kNumNearest / 3 : kNumNearest);
      uint32_t near[kNumNearest];
      size_t num_near = 0;
      for (uint32_t i : nearest.first(reach)) {
        if (is_free_[i]) near[num_near++] = i;
      }
      if (num_near < 2) return std::nullopt;
      const size_t a = random->Index(num_near);
      size_t b = random->Index(num_near - 1);
      b += b >= a;
      const Eigen::Vector3d u = points_[near[a]].X - points_[seed].X,
                            v = points_[near[b]].X - points_[seed].X;
      const Eigen::Vector3d normal = u.cross(v);
      const double extent = std::max(u.norm(), v.norm());
      // Three points nearly on a line, or nearer to each other than their noise, define no plane.
      if (!(normal.norm() > 0.05 * extent * extent) || extent < 3.0 * points_[seed].limit) {
        return std::nullopt;
      }
      plane.n = normal.normalized();
    }
    plane.w = -plane.n.dot(points_[seed].X);
    size_t num_near = 0;
    for (uint32_t i : points_.Beside(seed)) num_near += points_.IsWithinLimit(plane, i);
    if (num_near < kMinNear) return std::nullopt;
    return plane;
  }

  // Draws the hypotheses for all planes at once; every point is the seed of some.
  void SampleAll() {
    // Normals of vanishing points get samples of their own, so that planes of other directions have
    // as many as without them.
    const size_t by_points = static_cast<size_t>(options_.samples_per_point);
    const size_t per_point = by_points + (vp_normals_.empty() ? 0 : 1);
    std::vector<std::optional<PlaneParams>> samples(points_.size() * per_point);
    std::vector<double> scores(samples.size());
    ParallelFor(options_.num_threads, points_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        if (!is_free_[i]) continue;
        Random random(options_.seed + i);
        for (size_t k = i * per_point; k < (i + 1) * per_point; ++k) {
          samples[k] = Sample(static_cast<uint32_t>(i), k >= i * per_point + by_points, &random);
          if (samples[k]) scores[k] = Score(free_, *samples[k]);
        }
      }
    });
    hypotheses_.clear();
    for (size_t k = 0; k < samples.size(); ++k) {
      if (!samples[k]) continue;
      hypotheses_.push_back(
          {*samples[k], static_cast<uint32_t>(k / per_point), scores[k], scores[k]});
    }
  }

  // A plane's score falls by what the points gave that are no longer free; what a connected set of
  // it gained stays a bound of what one can gain.
  void Remove(const std::vector<uint32_t>& members) {
    for (uint32_t i : members) is_free_[i] = false;
    const Pool removed = PoolOf(members);
    ParallelFor(options_.num_threads, hypotheses_.size(), [&](size_t begin, size_t end) {
      for (size_t k = begin; k < end; ++k) {
        Hypothesis& h = hypotheses_[k];
        h.score -= Score(removed, h.plane);
        h.bound = std::min(h.bound, h.score);
      }
    });
    // A gain below a quarter of the fewest points does not lead to a plane.
    std::erase_if(hypotheses_, [this](const Hypothesis& h) {
      return h.bound < 0.25 * static_cast<double>(options_.min_component);
    });
    FreePoints();
  }

  // The plane whose connected set of free points has the greatest gain.
  FoundPlane Best() {
    FoundPlane best;
    std::vector<uint32_t> order(hypotheses_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [this](uint32_t a, uint32_t b) {
      return hypotheses_[a].bound > hypotheses_[b].bound;
    });
    for (uint32_t k : order) {
      Hypothesis& hypothesis = hypotheses_[k];
      if (hypothesis.bound <= best.gain) break;
      FoundPlane candidate = ComponentAround(hypothesis.plane, {&hypothesis.seed, 1});
      hypothesis.bound = std::min(hypothesis.bound, candidate.gain);
      if (candidate.gain <= best.gain) continue;
      best = candidate;
      for (int refit = 0; refit < kRefits && candidate.members.size() >= 3; ++refit) {
        candidate = ComponentAround(points_.Fit(candidate.members), candidate.members);
        if (candidate.gain <= best.gain) break;
        best = candidate;
      }
    }
    if (best.members.size() < static_cast<size_t>(options_.min_component)) return best;
    // Sets apart from the largest belong to it if they could nearly stand alone.
    std::vector<std::vector<uint32_t>> apart;
    ForEachComponent(best.params, FreeInliers(best.params),
                     [&](size_t first, size_t last, double gain) {
                       if (2 * (last - first) < static_cast<size_t>(options_.min_component)) return;
                       apart.emplace_back(queue_.begin() + static_cast<std::ptrdiff_t>(first),
                                          queue_.begin() + static_cast<std::ptrdiff_t>(last));
                     });
    best.members.clear();
    size_t largest = 0;
    for (const auto& set : apart) largest = std::max(largest, set.size());
    for (const auto& set : apart) {
      if (set.size() < largest && points_.ShareOf(set) < options_.min_share) continue;
      best.members.insert(best.members.end(), set.begin(), set.end());
    }
    std::sort(best.members.begin(), best.members.end());
    return best;
  }

  struct Hypothesis {
    PlaneParams plane;
    uint32_t seed;
    double score;  // of all free points
    double bound;  // of the connected set of the seed
  };

  const PlaneOptions& options_;
  const PlanePoints& points_;
  const std::vector<Eigen::Vector3d>& vp_normals_;
  std::vector<bool> is_free_;
  Pool free_;
  std::vector<Hypothesis> hypotheses_;
  // Work space.
  std::vector<uint8_t> mark_;
  std::vector<uint32_t> queue_, inliers_;
};

}  // namespace

std::vector<FoundPlane> SearchPlanes(const PlaneOptions& options, const PlanePoints& points,
                                     const std::vector<Eigen::Vector3d>& vp_normals,
                                     std::vector<bool> is_free) {
  return PlaneSearch(options, points, vp_normals, std::move(is_free)).Run();
}

}  // namespace holba
