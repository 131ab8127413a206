// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_detection.h"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <unordered_set>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/robust/kd_tree.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

constexpr size_t kSampleNeighbours = 60;
constexpr size_t kGraphNeighbours = 10;
constexpr size_t kShareNeighbours = 12;
constexpr int kRefits = 4;
// Of its 12 nearest, so many lie on a plane that a sample at the point stands for, and so many on
// one that the point may join.
constexpr size_t kMinNear = 6;
constexpr size_t kMinBeside = 2;
constexpr uint32_t kNoPlane = 0xffffffff;

struct PlanePoint {
  point3D_t id;
  Eigen::Vector3d X;  // relative to the centre of all
  double gsd;
  double limit;  // farthest from a plane, model units
  Eigen::Matrix3d covariance;
};

// n.x + w = 0.
struct PlaneParams {
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();
  double w = 0.0;
  double Signed(const Eigen::Vector3d& X) const { return n.dot(X) + w; }
};

struct FoundPlane {
  PlaneParams params;
  std::vector<uint32_t> members;
  double gain = 0.0;
};

double AngleRad(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b)));
}

class PlaneFinder {
 public:
  PlaneFinder(const PlaneOptions& options, std::vector<PlanePoint> points,
              std::vector<Eigen::Vector3d> vp_normals, PlaneReport* report)
      : options_(options),
        points_(std::move(points)),
        vp_normals_(std::move(vp_normals)),
        report_(*report) {
    FindNeighbours();
  }

  std::vector<FoundPlane> Run() {
    is_free_.assign(points_.size(), true);
    mark_.assign(points_.size(), 0);
    std::vector<FoundPlane> planes;
    // The second search is among the remaining points, which had few samples in the first one.
    for (int search = 0; search < 2; ++search) {
      std::vector<FoundPlane> found = Search();
      report_.planes_found += found.size();
      planes.insert(planes.end(), found.begin(), found.end());
      Merge(&planes);
      Accept(/*counted=*/search == 1, &planes);
      // The search is greedy, so that a plane may have taken points of one beside it.
      for (int pass = 0; pass < 2; ++pass) Reassign(&planes);
      Merge(&planes);
      Accept(/*counted=*/search == 1, &planes);
      is_free_.assign(points_.size(), true);
      for (const FoundPlane& plane : planes) {
        for (uint32_t i : plane.members) is_free_[i] = false;
      }
    }
    std::stable_sort(planes.begin(), planes.end(), [](const FoundPlane& a, const FoundPlane& b) {
      return a.members.size() > b.members.size();
    });
    return planes;
  }

 private:
  bool IsNeighbour(size_t i, size_t j) const {
    return (points_[i].X - points_[j].X).norm() <
           options_.max_neighbour_px * std::max(points_[i].gsd, points_[j].gsd);
  }

  void FindNeighbours() {
    std::vector<Eigen::Vector3d> xs;
    for (const PlanePoint& p : points_) xs.push_back(p.X);
    const KdTree tree(xs);
    nearest_.resize(points_.size());
    ParallelFor(options_.num_threads, points_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        for (const KdTree::Neighbour& n : tree.Nearest(xs[i], kSampleNeighbours + 1)) {
          if (n.index != i) nearest_[i].push_back(n.index);
        }
      }
    });
    std::vector<std::vector<uint32_t>> graph(points_.size());
    for (uint32_t i = 0; i < points_.size(); ++i) {
      const size_t num = std::min(kGraphNeighbours, nearest_[i].size());
      for (size_t k = 0; k < num; ++k) {
        const uint32_t j = nearest_[i][k];
        if (!IsNeighbour(i, j)) continue;
        graph[i].push_back(j);
        graph[j].push_back(i);
      }
    }
    for (std::vector<uint32_t>& edges : graph) {
      std::sort(edges.begin(), edges.end());
      edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    }
    graph_ = std::move(graph);
  }

  // 1 on the plane, 0 from the limit on (MSAC).
  double Gain(const PlaneParams& plane, uint32_t i) const {
    const double ratio = plane.Signed(points_[i].X) / points_[i].limit;
    return std::max(0.0, 1.0 - ratio * ratio);
  }

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
        gain += Gain(plane, queue_[k]);
        for (uint32_t j : graph_[queue_[k]]) {
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
      if (std::abs(plane.Signed(points_[i].X)) < points_[i].limit) inliers_.push_back(i);
    }
    return inliers_;
  }

  // Least squares in units of the limits, of weight `weight(i)`.
  template <typename Weight>
  PlaneParams Fit(std::span<const uint32_t> members, const Weight& weight_of) const {
    double sum = 0.0;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (uint32_t i : members) {
      const double weight = weight_of(i) / (points_[i].limit * points_[i].limit);
      sum += weight;
      centre += weight * points_[i].X;
    }
    centre /= sum;
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (uint32_t i : members) {
      const Eigen::Vector3d u = (points_[i].X - centre) / points_[i].limit;
      scatter += weight_of(i) * u * u.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
    PlaneParams plane;
    plane.n = eigen.eigenvectors().col(0);
    plane.w = -plane.n.dot(centre);
    return plane;
  }
  PlaneParams Fit(std::span<const uint32_t> members) const {
    return Fit(members, [](uint32_t i) { return 1.0; });
  }

  FoundPlane LargestComponent(const PlaneParams& plane) {
    FoundPlane largest{plane, {}, 0.0};
    ForEachComponent(plane, FreeInliers(plane), [&](size_t first, size_t last, double gain) {
      if (gain <= largest.gain) return;
      largest.gain = gain;
      largest.members.assign(queue_.begin() + static_cast<std::ptrdiff_t>(first),
                             queue_.begin() + static_cast<std::ptrdiff_t>(last));
    });
    return largest;
  }

  std::optional<PlaneParams> Sample(uint32_t seed, bool by_vps, Random* random) const {
    PlaneParams plane;
    if (by_vps) {
      plane.n = vp_normals_[random->Index(vp_normals_.size())];
    } else {
      // Half of the samples are from the nearest third, for small planes; the others have a wider
      // base.
      const size_t reach = std::min(
          nearest_[seed].size(), random->Index(2) == 0 ? kSampleNeighbours / 3 : kSampleNeighbours);
      uint32_t near[kSampleNeighbours];
      size_t num_near = 0;
      for (size_t k = 0; k < reach; ++k) {
        if (is_free_[nearest_[seed][k]]) near[num_near++] = nearest_[seed][k];
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
    for (size_t k = 0; k < std::min(kShareNeighbours, nearest_[seed].size()); ++k) {
      const PlanePoint& p = points_[nearest_[seed][k]];
      num_near += std::abs(plane.Signed(p.X)) < p.limit;
    }
    if (num_near < kMinNear) return std::nullopt;
    return plane;
  }

  // Connected sets of coplanar free points, which are free no longer.
  std::vector<FoundPlane> Search() {
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

  // Draws the hypotheses for all planes at once; every point is the seed of some.
  void SampleAll() {
    // Normals of vanishing points get samples of their own, so that planes of other directions have
    // as
    // many as without them.
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
      if (samples[k]) hypotheses_.push_back({*samples[k], scores[k], scores[k]});
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

  // The plane whose largest connected set of free points has the greatest gain.
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
      FoundPlane candidate = LargestComponent(hypothesis.plane);
      hypothesis.bound = std::min(hypothesis.bound, candidate.gain);
      if (candidate.gain <= best.gain) continue;
      best = candidate;
      for (int refit = 0; refit < kRefits && candidate.members.size() >= 3; ++refit) {
        candidate = LargestComponent(Fit(candidate.members));
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
      if (set.size() < largest && ShareOf(set) < options_.min_share) continue;
      best.members.insert(best.members.end(), set.begin(), set.end());
    }
    std::sort(best.members.begin(), best.members.end());
    return best;
  }

  // Mean share of the nearest points that are members too.
  double ShareOf(const std::vector<uint32_t>& members) {
    for (uint32_t i : members) mark_[i] = 1;
    double sum = 0.0;
    for (uint32_t i : members) {
      const size_t num = std::min(kShareNeighbours, nearest_[i].size());
      size_t same = 0;
      for (size_t k = 0; k < num; ++k) same += mark_[nearest_[i][k]];
      sum += num == 0 ? 0.0 : static_cast<double>(same) / static_cast<double>(num);
    }
    for (uint32_t i : members) mark_[i] = 0;
    return sum / static_cast<double>(members.size());
  }

  double MedianRatio(const PlaneParams& plane, std::span<const uint32_t> members) const {
    std::vector<double> ratios;
    for (uint32_t i : members) {
      ratios.push_back(std::abs(plane.Signed(points_[i].X)) / points_[i].limit);
    }
    return Median(std::move(ratios));
  }

  // In standard deviations of the points along the normal.
  double WhitenedDistance(const PlaneParams& plane, uint32_t i) const {
    const double variance = plane.n.dot(points_[i].covariance * plane.n);
    return std::abs(plane.Signed(points_[i].X)) / std::sqrt(std::max(variance, 1e-300));
  }

  // Whether one plane fits both sets about as well as their own planes: within the limits or within
  // the uncertainty of the depths (distant facades are often found as several oblique pieces).
  bool IsOnePlane(const FoundPlane& a, const FoundPlane& b, FoundPlane* both) const {
    if (AngleRad(a.params.n, b.params.n) > DegToRad(options_.merge_angle_deg)) {
      return false;
    }
    both->members = a.members;
    both->members.insert(both->members.end(), b.members.begin(), b.members.end());
    both->params = Fit(both->members);
    both->gain = 0.0;
    for (uint32_t i : both->members) both->gain += Gain(both->params, i);
    for (const FoundPlane* part : {&a, &b}) {
      size_t inside = 0;
      std::vector<double> whitened;
      for (uint32_t i : part->members) {
        whitened.push_back(WhitenedDistance(both->params, i));
        inside +=
            std::abs(both->params.Signed(points_[i].X)) < points_[i].limit || whitened.back() < 2.5;
      }
      if (static_cast<double>(inside) < 0.85 * static_cast<double>(part->members.size())) {
        return false;
      }
      const bool is_as_near = MedianRatio(both->params, part->members) <
                              1.3 * MedianRatio(part->params, part->members) + 0.05;
      // The expected median is 0.67.
      if (!is_as_near && Median(std::move(whitened)) > 1.0) return false;
    }
    return true;
  }

  void Merge(std::vector<FoundPlane>* planes) {
    for (bool changed = true; changed;) {
      changed = false;
      for (size_t a = 0; a < planes->size() && !changed; ++a) {
        for (size_t b = a + 1; b < planes->size() && !changed; ++b) {
          FoundPlane both;
          if (!IsOnePlane((*planes)[a], (*planes)[b], &both)) continue;
          std::sort(both.members.begin(), both.members.end());
          (*planes)[a] = std::move(both);
          planes->erase(planes->begin() + static_cast<std::ptrdiff_t>(b));
          ++report_.planes_merged;
          changed = true;
        }
      }
    }
  }

  // Gives every point to the nearest plane among those of its neighbours, then refits each plane to
  // its points, with small weights for points near the limit.
  void Reassign(std::vector<FoundPlane>* planes) const {
    std::vector<uint32_t> plane_of(points_.size(), kNoPlane), fresh(points_.size(), kNoPlane);
    for (uint32_t p = 0; p < planes->size(); ++p) {
      for (uint32_t i : (*planes)[p].members) plane_of[i] = p;
    }
    ParallelFor(options_.num_threads, points_.size(), [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        size_t num = 0;
        uint32_t beside[kShareNeighbours];
        for (size_t k = 0; k < std::min(kShareNeighbours, nearest_[i].size()); ++k) {
          if (IsNeighbour(i, nearest_[i][k])) beside[num++] = plane_of[nearest_[i][k]];
        }
        double least = points_[i].limit;
        for (size_t k = 0; k < num; ++k) {
          if (beside[k] == kNoPlane || beside[k] == fresh[i]) continue;
          const auto same = static_cast<size_t>(std::count(beside, beside + num, beside[k]));
          if (same < kMinBeside) continue;
          const double distance = std::abs((*planes)[beside[k]].params.Signed(points_[i].X));
          if (distance >= least) continue;
          least = distance;
          fresh[i] = beside[k];
        }
      }
    });
    for (FoundPlane& plane : *planes) plane.members.clear();
    for (uint32_t i = 0; i < points_.size(); ++i) {
      if (fresh[i] != kNoPlane) (*planes)[fresh[i]].members.push_back(i);
    }
    for (FoundPlane& plane : *planes) {
      if (plane.members.size() < 3) continue;
      const PlaneParams before = plane.params;
      plane.params = Fit(plane.members, [&](uint32_t i) { return Gain(before, i) + 1e-3; });
    }
  }

  void Accept(bool counted, std::vector<FoundPlane>* planes) {
    std::erase_if(*planes, [&](const FoundPlane& plane) {
      const char* reason = nullptr;
      if (plane.members.size() < static_cast<size_t>(options_.min_points)) {
        reason = "plane: few points";
      } else if (ShareOf(plane.members) < options_.min_share) {
        reason = "plane: points of others among its own";
      }
      if (reason && counted) ++report_.dropped[reason];
      return reason != nullptr;
    });
  }

  const PlaneOptions& options_;
  const std::vector<PlanePoint> points_;
  const std::vector<Eigen::Vector3d> vp_normals_;
  PlaneReport& report_;
  std::vector<std::vector<uint32_t>> nearest_, graph_;
  std::vector<bool> is_free_;
  Pool free_;
  struct Hypothesis {
    PlaneParams plane;
    double score;  // of all free points
    double bound;  // of a connected set of them
  };
  std::vector<Hypothesis> hypotheses_;
  // Work space.
  std::vector<uint8_t> mark_;
  std::vector<uint32_t> queue_, inliers_;
};

// Likely normals of planes: directions of vanishing points, and normals of each two of them.
std::vector<Eigen::Vector3d> NormalsOfVanishingPoints(const Reconstruction& model) {
  std::vector<Eigen::Vector3d> directions;
  for (const auto& [id, group] : model.groups3D) {
    double g[kMaxGroupParams];
    if (!group.type->IsParallelism() || !group.type->from_file(group.params.data(), g)) continue;
    Eigen::Vector3d direction;
    group.type->direction(g, &direction, nullptr);
    directions.push_back(direction);
  }
  std::vector<Eigen::Vector3d> normals;
  const auto add = [&normals](const Eigen::Vector3d& n) {
    for (const Eigen::Vector3d& other : normals) {
      if (AngleRad(n, other) < DegToRad(1.0)) return;
    }
    normals.push_back(n);
  };
  for (const Eigen::Vector3d& v : directions) add(v);
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = i + 1; j < directions.size(); ++j) {
      const Eigen::Vector3d n = directions[i].cross(directions[j]);
      if (n.norm() > 0.5) add(n.normalized());
    }
  }
  return normals;
}

}  // namespace

PlaneReport DetectPlanes(const PlaneOptions& options, Reconstruction* model) {
  PlaneReport report;
  const ViewMap views(*model);
  report.sigma_px = MeasurePointSigmaPx(*model, views).value_or(1.0);
  std::unordered_set<point3D_t> taken;
  for (const auto& [id, group] : model->groups3D) {
    if (IsPlane(*group.type)) taken.insert(group.point3D_ids.begin(), group.point3D_ids.end());
  }

  std::vector<PlanePoint> points;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& [id, point] : model->points3D) {
    if (taken.contains(id)) continue;
    const std::optional<PointGeometry> geometry = GeometryOf(views, point);
    if (!geometry || geometry->num_images < static_cast<size_t>(options.min_images)) {
      ++report.dropped["point: few images"];
      continue;
    }
    if (geometry->angle_rad < DegToRad(options.min_angle_deg)) {
      ++report.dropped["point: small angle"];
      continue;
    }
    const auto covariance = PointCovariance(views, point.xyz, point.track, report.sigma_px);
    if (!covariance) {
      ++report.dropped["point: unknown depth"];
      continue;
    }
    points.push_back({id, point.xyz, geometry->gsd,
                      options.max_distance_px * geometry->LengthPerPx(), *covariance});
    centre += point.xyz;
  }
  report.points_eligible = points.size();
  if (points.empty()) return report;
  centre /= static_cast<double>(points.size());
  for (PlanePoint& p : points) p.X -= centre;

  const std::vector<Eigen::Vector3d> vp_normals = NormalsOfVanishingPoints(*model);
  const std::vector<PlanePoint> kept = points;
  const std::vector<FoundPlane> planes =
      PlaneFinder(options, std::move(points), vp_normals, &report).Run();
  std::vector<double> residuals;
  for (const FoundPlane& plane : planes) {
    const Eigen::Vector3d& n = plane.params.n;
    std::vector<point3D_t> members;
    for (uint32_t i : plane.members) {
      members.push_back(kept[i].id);
      residuals.push_back(std::abs(plane.params.Signed(kept[i].X)) / kept[i].gsd);
    }
    report.points_on_planes += plane.members.size();
    report.planes_along_vps +=
        std::any_of(vp_normals.begin(), vp_normals.end(),
                    [&n](const Eigen::Vector3d& v) { return AngleRad(n, v) < DegToRad(3.0); });
    model->AddGroup3D(PlaneType(), {n.x(), n.y(), n.z(), plane.params.w - n.dot(centre)},
                      std::move(members));
  }
  report.planes = planes.size();
  report.median_residual_px = Median(std::move(residuals));
  return report;
}

void PlaneOptions::Describe(OptionTable* table) const {
  table->Section("Planes");
  table->Field("seed", &seed, AnyValue(), "Seed of the random samples.");
  table->Field("min_images", &min_images, AtLeast(2), "Fewest images of a point.");
  table->Field("min_angle_deg", &min_angle_deg, Between(0, 90),
               "Least triangulation angle of a point.");
  table->Field("max_distance_px", &max_distance_px, GreaterThan(0),
               "Farthest from its plane that a point may be, in pixels at its depth.");
  table->Field("max_neighbour_px", &max_neighbour_px, GreaterThan(0),
               "Farthest apart that two neighbours on a plane may be, in pixels at their depth.");
  table->Field("min_component", &min_component, AtLeast(4),
               "Fewest connected points that found a plane.");
  table->Field("min_points", &min_points, AtLeast(4), "Fewest points of a plane.");
  table->Field("min_share", &min_share, Between(0, 1),
               "Least mean share of a member's 12 nearest points that are members too.");
  table->Field("samples_per_point", &samples_per_point, AtLeast(1),
               "Samples of three neighbours that each point starts.");
  table->Field("max_planes", &max_planes, AtLeast(0), "Most planes.");
  table->Field("merge_angle_deg", &merge_angle_deg, Between(0, 90),
               "Widest angle of two planes that may be one.");
}

}  // namespace holba
