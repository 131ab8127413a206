// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_nodes.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/base/threads.h"
#include "holba/estimation/lines/line_consensus.h"
#include "holba/estimation/lines/line_proposals.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

// Scales of the test that a proposal from one view alone is seen in other images.
constexpr double kCheckDistancePx = 2.0;
constexpr double kCheckAngleDeg = 3.0;
constexpr double kCheckOverlap = 0.4;
constexpr size_t kMinChecked = 2;  // images
// A segment runs to a vanishing point: its ends' distance from the line of midpoint and point, and
// the angle (which decides for short ones).
constexpr double kVanishingDistancePx = 1.5;
constexpr double kVanishingAngleDeg = 3.0;
constexpr size_t kMinPlanePoints = 3;
// A plane seen at a smaller angle gives no depth.
constexpr double kMinPlaneAngleDeg = 3.0;
// Of depths that differ by less than this share only one is proposed.
constexpr double kSameDepth = 0.005;
constexpr size_t kMaxDepthsPerDirection = 3;
constexpr size_t kMaxPlanesPerSegment = 3;
constexpr double kSharedPointBonus = 0.15;  // in descriptor distance
// Where segments are not described, the epipolar overlap takes the descriptor's part.
constexpr double kMissingDescriptorScale = 0.4;
constexpr size_t kMaxOnePoint = 2;

struct Candidate {
  uint32_t segment;
  float rank;  // smaller is better
  double length_start, length_end;
};

SegmentPlane PlaneOf(const SceneView& view, const SceneSegment& segment) {
  return {view.view.centre(), segment.ray_start, segment.ray_end, segment.normal};
}

// Matches of an image with one of its neighbours: for each segment, those of the neighbour with
// their distances.
using Adjacency = std::vector<std::vector<std::pair<uint32_t, float>>>;

// Matches of a view with each of its neighbours.
std::vector<Adjacency> AdjacencyOf(const LineScene& scene, uint32_t view_idx,
                                   const LineMatchMap& matches) {
  const SceneView& view = scene.views[view_idx];
  // Index in SceneView::segments of an image's segments; not usable: kInvalidId32.
  const auto compact = [](const SceneView& v) {
    std::vector<uint32_t> index;
    for (uint32_t i = 0; i < v.segments.size(); ++i) {
      const line2D_t idx = v.segments[i].line2D_idx;
      if (idx >= index.size()) index.resize(idx + 1, kInvalidId32);
      index[idx] = i;
    }
    return index;
  };
  const auto at = [](const std::vector<uint32_t>& index, line2D_t idx) {
    return idx < index.size() ? index[idx] : kInvalidId32;
  };
  const std::vector<uint32_t> own = compact(view);
  std::vector<Adjacency> adjacency(view.neighbours.size(), Adjacency(view.segments.size()));
  for (size_t n = 0; n < view.neighbours.size(); ++n) {
    const SceneView& other = scene.views[view.neighbours[n]];
    const bool is_first = view.image_id < other.image_id;
    const auto found = matches.find(is_first ? ImagePair(view.image_id, other.image_id)
                                             : ImagePair(other.image_id, view.image_id));
    if (found == matches.end()) continue;
    const std::vector<uint32_t> theirs = compact(other);
    for (const LineMatch& match : found->second) {
      const uint32_t a = at(own, is_first ? match.idx1 : match.idx2);
      const uint32_t b = at(theirs, is_first ? match.idx2 : match.idx1);
      if (a != kInvalidId32 && b != kInvalidId32) adjacency[n][a].emplace_back(b, match.distance);
    }
  }
  return adjacency;
}

class Placer {
 public:
  // `adjacency`: AdjacencyOf the view; null: all segments of neighbours may match.
  Placer(const LineOptions& options, const LineScene& scene,
         const std::vector<Adjacency>* adjacency, uint32_t view_idx)
      : options_(options),
        scene_(scene),
        adjacency_(adjacency),
        view_idx_(view_idx),
        view_(scene.views[view_idx]),
        scorer_(options, scene),
        min_sine_(std::sin(options.min_ray_plane_angle_deg * kRadPerDeg)) {
    fundamental_.reserve(view_.neighbours.size());
    for (uint32_t other : view_.neighbours) {
      fundamental_.push_back(FundamentalMatrix(view_.view, scene.views[other].view));
      // Heights of the first centre over the planes of the other's segments, for each.
      const SceneView& v = scene.views[other];
      std::vector<double> heights(v.segments.size());
      for (size_t i = 0; i < heights.size(); ++i)
        heights[i] = v.segments[i].normal.dot(v.view.centre() - view_.view.centre());
      heights_.push_back(std::move(heights));
    }
  }

  void Place(uint32_t segment_idx, SegmentNode* node, NodeCounts* counts) {
    const SceneSegment& segment = view_.segments[segment_idx];
    plane_ = PlaneOf(view_, segment);
    proposals_.clear();
    directions_.clear();
    if (options_.propose_from_groups) FindDirections(segment_idx, segment);
    bool any_candidate = false;
    for (size_t n = 0; n < view_.neighbours.size(); ++n) {
      FindCandidates(segment_idx, segment, n, counts);
      any_candidate |= !candidates_.empty();
      counts->candidates += candidates_.size();
      for (const Candidate& candidate : candidates_)
        ProposeFromPair(segment, view_.neighbours[n], candidate);
    }
    if (options_.propose_from_groups) {
      ProposeOnPlanes(segment_idx, segment);
      ProposeAtDepths(segment_idx, segment);
    }
    for (const Proposal& p : proposals_) ++counts->proposals[static_cast<int>(p.kind)];
    if (proposals_.empty()) {
      ++counts->dropped[any_candidate ? "segment: no proposal in front of the cameras"
                                      : "segment: no candidate in any neighbour"];
      return;
    }
    scorer_.Score(&proposals_, node);
    if (!node->placed) {
      ++counts->dropped["segment: no proposal reaches min_score"];
      return;
    }
    ++counts->best[static_cast<int>(node->kind)];
  }

 private:
  // Adds segment i of neighbour n to the candidates if angle, depth and descriptor allow it.
  void TestCandidate(uint32_t segment_idx, const SceneSegment& segment, size_t n, uint32_t i,
                     double iou, std::optional<float> distance) {
    const uint32_t other_idx = view_.neighbours[n];
    const SceneView& other = scene_.views[other_idx];
    const SceneSegment& theirs = other.segments[i];
    const double s = theirs.normal.dot(segment.ray_start);
    const double e = theirs.normal.dot(segment.ray_end);
    if (!(std::abs(s) >= min_sine_) || !(std::abs(e) >= min_sine_)) {
      ++weak_angle_;
      return;
    }
    const double length_start = heights_[n][i] / s, length_end = heights_[n][i] / e;
    if (!view_.DepthIsPossible(length_start * segment.depth_per_start) ||
        !view_.DepthIsPossible(length_end * segment.depth_per_end)) {
      ++bad_depth_;
      return;
    }
    const double depth_start =
        other.view.Depth(view_.view.centre() + length_start * segment.ray_start);
    const double depth_end = other.view.Depth(view_.view.centre() + length_end * segment.ray_end);
    if (!other.DepthIsPossible(depth_start) || !other.DepthIsPossible(depth_end)) {
      ++bad_depth_;
      return;
    }
    double rank;
    if (distance) {
      rank = *distance;
    } else if (scene_.described) {
      rank = scene_.DescriptorDistance(view_idx_, segment_idx, other_idx, i);
      if (rank > options_.max_descriptor_distance) {
        ++unlike_;
        return;
      }
    } else {
      rank = kMissingDescriptorScale * (1.0 - iou);
    }
    rank -= kSharedPointBonus * CountShared(segment, other, theirs, kBesideSegmentPx);
    candidates_.push_back({i, static_cast<float>(rank), length_start, length_end});
  }

  void FindCandidates(uint32_t segment_idx, const SceneSegment& segment, size_t n,
                      NodeCounts* counts) {
    candidates_.clear();
    weak_angle_ = bad_depth_ = unlike_ = 0;
    const SceneView& other = scene_.views[view_.neighbours[n]];
    const Eigen::Index size = static_cast<Eigen::Index>(other.segments.size());
    const auto unit = [](const Eigen::Vector3d& l) {
      const double scale = l.head<2>().norm();
      return Eigen::Vector3f((l / (scale > 0.0 ? scale : 1.0)).cast<float>());
    };
    const Eigen::Vector3f a = unit(fundamental_[n] * segment.ideal.start.homogeneous());
    Eigen::Vector3f b = unit(fundamental_[n] * segment.ideal.end.homogeneous());
    // The sign of the second line is free; the distances below need that of the first.
    if (a.head<2>().dot(b.head<2>()) < 0.0f) b = -b;
    const float min_iou = static_cast<float>(options_.min_epipolar_iou);
    // Overlap of the other segment with its part between the two epipolar lines, from the signed
    // distances of its ends to them.
    const auto iou_of = [&](float as, float ae, float bs, float be) {
      const float low = as / (as - ae), high = bs / (bs - be);
      if (options_.oriented && !(low < high)) return 0.0f;
      const float c1 = std::min(low, high), c2 = std::max(low, high);
      return (std::min(c2, 1.0f) - std::max(c1, 0.0f)) / (std::max(c2, 1.0f) - std::min(c1, 0.0f));
    };
    if (adjacency_) {
      for (const auto& [i, distance] : (*adjacency_)[n][segment_idx]) {
        const auto to = [&](const Eigen::Vector3f& l, float x, float y) {
          return l.x() * x + l.y() * y + l.z();
        };
        const float iou = iou_of(
            to(a, other.start_x[i], other.start_y[i]), to(a, other.end_x[i], other.end_y[i]),
            to(b, other.start_x[i], other.start_y[i]), to(b, other.end_x[i], other.end_y[i]));
        if (!(iou > min_iou)) {
          ++counts->dropped["candidate: outside the epipolar band or opposite"];
          continue;
        }
        TestCandidate(segment_idx, segment, n, i, iou, distance);
      }
    } else {
      // Most segments lie beside the band: both ends on one side of both lines.
      using Array = Eigen::Map<const Eigen::ArrayXf>;
      const Array sx(other.start_x.data(), size), sy(other.start_y.data(), size);
      const Array ex(other.end_x.data(), size), ey(other.end_y.data(), size);
      to_a_start_ = a.x() * sx + a.y() * sy + a.z();
      to_a_end_ = a.x() * ex + a.y() * ey + a.z();
      to_b_start_ = b.x() * sx + b.y() * sy + b.z();
      to_b_end_ = b.x() * ex + b.y() * ey + b.z();
      beside_ = (to_a_start_.min(to_a_end_)).min(to_b_start_.min(to_b_end_));
      beside_ = beside_.max(-(to_a_start_.max(to_a_end_)).max(to_b_start_.max(to_b_end_)));
      for (Eigen::Index i = 0; i < size; ++i) {
        if (beside_[i] > 0.0f) continue;
        const float iou = iou_of(to_a_start_[i], to_a_end_[i], to_b_start_[i], to_b_end_[i]);
        if (iou > min_iou)
          TestCandidate(segment_idx, segment, n, static_cast<uint32_t>(i), iou, std::nullopt);
      }
    }
    if (weak_angle_) counts->dropped["candidate: ray nearly in the other plane"] += weak_angle_;
    if (bad_depth_) counts->dropped["candidate: depth out of the points' range"] += bad_depth_;
    if (unlike_) counts->dropped["candidate: descriptors differ"] += unlike_;
    if (candidates_.size() > static_cast<size_t>(options_.max_candidates)) {
      std::partial_sort(candidates_.begin(), candidates_.begin() + options_.max_candidates,
                        candidates_.end(), [](const Candidate& x, const Candidate& y) {
                          return x.rank != y.rank ? x.rank < y.rank : x.segment < y.segment;
                        });
      counts->dropped["candidate: not among the best max_candidates"] +=
          candidates_.size() - options_.max_candidates;
      candidates_.resize(options_.max_candidates);
    }
  }

  // Calls visit(point_idx) for points near both segments.
  template <typename Visit>
  void ForEachShared(const SceneSegment& segment, const SceneView& other,
                     const SceneSegment& theirs, double radius_px, Visit visit) const {
    const auto a = view_.PointsNear(segment), b = other.PointsNear(theirs);
    size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
      if (a[i].point_idx < b[j].point_idx) {
        ++i;
      } else if (a[i].point_idx > b[j].point_idx) {
        ++j;
      } else {
        if (a[i].distance_px <= radius_px && b[j].distance_px <= radius_px) visit(a[i].point_idx);
        ++i;
        ++j;
      }
    }
  }
  int CountShared(const SceneSegment& segment, const SceneView& other, const SceneSegment& theirs,
                  double radius_px) const {
    int count = 0;
    ForEachShared(segment, other, theirs, radius_px, [&](uint32_t) { ++count; });
    return count;
  }

  void Add(const SceneSegment& segment, uint32_t view, uint32_t other_segment, ProposalKind kind,
           int32_t plane, const RayLengths& lengths) {
    Proposal p{view, other_segment, kind, plane, lengths.start, lengths.end, {}, {}, {}};
    p.start = plane_.centre + lengths.start * segment.ray_start;
    p.end = plane_.centre + lengths.end * segment.ray_end;
    p.along = p.end - p.start;
    const double length = p.along.norm();
    if (!(length > 0.0)) return;
    p.along /= length;
    proposals_.push_back(p);
  }

  bool LengthsArePossible(const SceneSegment& segment, const RayLengths& lengths) const {
    return view_.DepthIsPossible(lengths.start * segment.depth_per_start) &&
           view_.DepthIsPossible(lengths.end * segment.depth_per_end);
  }

  void ProposeFromPair(const SceneSegment& segment, uint32_t other_idx,
                       const Candidate& candidate) {
    const SceneView& other = scene_.views[other_idx];
    const SceneSegment& theirs = other.segments[candidate.segment];
    const auto add = [&](ProposalKind kind, const std::optional<RayLengths>& lengths) {
      if (lengths && LengthsArePossible(segment, *lengths))
        Add(segment, other_idx, candidate.segment, kind, -1, *lengths);
    };
    add(ProposalKind::kRayPlane, RayLengths{candidate.length_start, candidate.length_end});
    const SegmentPlane other_plane = PlaneOf(other, theirs);
    if (options_.propose_from_points) {
      shared_.clear();
      ForEachShared(segment, other, theirs, kOnSegmentPx,
                    [&](uint32_t point) { shared_.push_back(scene_.points[point]); });
      if (shared_.size() >= 2) add(ProposalKind::kPoints, ProposeThroughPoints(plane_, shared_));
      for (size_t i = 0; i < std::min(shared_.size(), kMaxOnePoint); ++i)
        add(ProposalKind::kPoint, ProposeThroughPoint(plane_, shared_[i], other_plane));
    }
    for (const Eigen::Vector3d& direction : directions_)
      add(ProposalKind::kDirection, ProposeAlong(plane_, direction, other_plane));
  }

  // Directions of the scene or of the image that the segment runs to.
  void FindDirections(uint32_t segment_idx, const SceneSegment& segment) {
    const auto runs_to = [&](const Eigen::Vector3d& direction) {
      const Eigen::Vector3d vp = view_.view.K() * (view_.view.R() * direction);
      const Eigen::Vector2d middle = 0.5 * (segment.ideal.start + segment.ideal.end);
      const Eigen::Vector2d to = vp.head<2>() - vp.z() * middle;
      const double length = to.norm();
      if (!(length > 0.0)) return false;
      const double sine =
          std::abs(to.x() * segment.along.y() - to.y() * segment.along.x()) / length;
      return 0.5 * segment.length_px * sine <= kVanishingDistancePx &&
             sine <= std::sin(kVanishingAngleDeg * kRadPerDeg);
    };
    for (const Eigen::Vector3d& direction : scene_.directions) {
      if (runs_to(direction)) directions_.push_back(direction);
    }
    const int32_t own = view_.image_vp[segment_idx];
    if (own >= 0 && static_cast<size_t>(own) < view_.image_directions.size()) {
      const Eigen::Vector3d& direction = view_.image_directions[own];
      for (const Eigen::Vector3d& known : directions_) {
        if (known.cross(direction).norm() < std::sin(DegToRad(1.0))) return;
      }
      directions_.push_back(direction);
    }
  }

  // Adds a proposal from one view alone if segments in enough other images lie where its ends are
  // projected to.
  void CheckAndAdd(uint32_t segment_idx, const SceneSegment& segment, ProposalKind kind,
                   int32_t plane, const RayLengths& lengths) {
    if (!LengthsArePossible(segment, lengths)) return;
    const Eigen::Vector3d start = plane_.centre + lengths.start * segment.ray_start;
    const Eigen::Vector3d end = plane_.centre + lengths.end * segment.ray_end;
    checked_.clear();
    const double max_sine = std::sin(kCheckAngleDeg * kRadPerDeg);
    for (size_t n = 0; n < view_.neighbours.size(); ++n) {
      const uint32_t other_idx = view_.neighbours[n];
      const SceneView& other = scene_.views[other_idx];
      const std::optional<Eigen::Vector2d> a = other.view.Project(start);
      const std::optional<Eigen::Vector2d> b = other.view.Project(end);
      if (!a || !b) continue;
      const Eigen::Vector2d across = *b - *a;
      const double length = across.norm();
      if (!(length >= 1.0)) continue;
      const Eigen::Vector2d along = across / length;
      double best = kCheckDistancePx;
      uint32_t found = kInvalidId32;
      other.grid.ForEachNear({*a, *b}, [&](uint32_t i) {
        const SceneSegment& theirs = other.segments[i];
        const double cosine = along.dot(theirs.along);
        if (options_.oriented ? cosine < 0.9 : std::abs(cosine) < 0.9) return;
        const double sine = along.x() * theirs.along.y() - along.y() * theirs.along.x();
        if (std::abs(sine) > max_sine) return;
        const Eigen::Vector2d normal(-along.y(), along.x());
        const double distance = std::max(std::abs(normal.dot(theirs.ideal.start - *a)),
                                         std::abs(normal.dot(theirs.ideal.end - *a)));
        if (!(distance < best || (distance == best && i < found))) return;
        if (OverlapInImage(theirs, *a, *b) < kCheckOverlap) return;
        if (adjacency_) {
          const auto& given = (*adjacency_)[n][segment_idx];
          if (std::none_of(given.begin(), given.end(),
                           [&](const auto& match) { return match.first == i; }))
            return;
        } else if (scene_.described &&
                   scene_.DescriptorDistance(view_idx_, segment_idx, other_idx, i) >
                       options_.max_descriptor_distance) {
          return;
        }
        best = distance;
        found = i;
      });
      if (found != kInvalidId32) checked_.push_back({other_idx, found});
    }
    if (checked_.size() < kMinChecked) return;
    for (const SegmentKey& key : checked_)
      Add(segment, key.view, key.segment, kind, plane, lengths);
  }

  void ProposeOnPlanes(uint32_t segment_idx, const SceneSegment& segment) {
    if (scene_.planes.empty()) return;
    plane_votes_.clear();
    for (const NearPoint& near : view_.PointsNear(segment)) {
      for (uint32_t plane : scene_.planes_of_point[near.point_idx]) {
        const auto it = std::find_if(plane_votes_.begin(), plane_votes_.end(),
                                     [&](const auto& vote) { return vote.second == plane; });
        if (it == plane_votes_.end()) {
          plane_votes_.emplace_back(1, plane);
        } else {
          ++it->first;
        }
      }
    }
    std::sort(plane_votes_.begin(), plane_votes_.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    size_t used = 0;
    for (const auto& [votes, plane] : plane_votes_) {
      if (votes < kMinPlanePoints || used++ >= kMaxPlanesPerSegment) break;
      const std::optional<RayLengths> lengths = ProposeOnPlane(
          plane_, scene_.planes[plane].plane, std::sin(kMinPlaneAngleDeg * kRadPerDeg));
      if (lengths)
        CheckAndAdd(segment_idx, segment, ProposalKind::kScenePlane, static_cast<int32_t>(plane),
                    *lengths);
    }
  }

  void ProposeAtDepths(uint32_t segment_idx, const SceneSegment& segment) {
    for (const Eigen::Vector3d& direction : directions_) {
      near_.clear();
      for (const NearPoint& near : view_.PointsNear(segment)) {
        if (near.distance_px <= kDepthPointPx) near_.push_back(near);
      }
      std::sort(near_.begin(), near_.end(), [](const NearPoint& a, const NearPoint& b) {
        return a.distance_px != b.distance_px ? a.distance_px < b.distance_px
                                              : a.point_idx < b.point_idx;
      });
      lengths_.clear();
      for (const NearPoint& near : near_) {
        if (lengths_.size() >= kMaxDepthsPerDirection) break;
        const std::optional<RayLengths> lengths =
            ProposeOnLine(plane_, scene_.points[near.point_idx], direction);
        if (!lengths) continue;
        if (std::any_of(lengths_.begin(), lengths_.end(), [&](double known) {
              return std::abs(known - lengths->start) < kSameDepth * known;
            }))
          continue;
        lengths_.push_back(lengths->start);
        CheckAndAdd(segment_idx, segment, ProposalKind::kDirectionDepth, -1, *lengths);
      }
    }
  }

  const LineOptions& options_;
  const LineScene& scene_;
  const std::vector<Adjacency>* adjacency_;  // to each neighbour; null: not guided
  const uint32_t view_idx_;
  const SceneView& view_;
  ProposalScorer scorer_;
  const double min_sine_;
  std::vector<Eigen::Matrix3d> fundamental_;  // to each neighbour
  std::vector<std::vector<double>> heights_;

  // Of the segment at hand.
  SegmentPlane plane_;
  std::vector<Eigen::Vector3d> directions_;
  std::vector<Proposal> proposals_;
  std::vector<Candidate> candidates_;
  Eigen::ArrayXf to_a_start_, to_a_end_, to_b_start_, to_b_end_, beside_;  // px
  std::vector<Eigen::Vector3d> shared_;
  std::vector<SegmentKey> checked_;
  std::vector<std::pair<size_t, uint32_t>> plane_votes_;
  std::vector<NearPoint> near_;
  std::vector<double> lengths_;
  size_t weak_angle_ = 0, bad_depth_ = 0, unlike_ = 0;
};

}  // namespace

std::vector<std::vector<SegmentNode>> PlaceSegments(const LineOptions& options,
                                                    const LineScene& scene,
                                                    const LineMatchMap* matches, int num_threads,
                                                    NodeCounts* counts) {
  // Chunks of segments keep all threads busy where there are few images.
  constexpr uint32_t kChunk = 128;
  struct Task {
    uint32_t view, begin, end;
  };
  std::vector<Task> tasks;
  std::vector<std::vector<SegmentNode>> nodes(scene.views.size());
  for (uint32_t v = 0; v < scene.views.size(); ++v) {
    const uint32_t size = static_cast<uint32_t>(scene.views[v].segments.size());
    nodes[v].resize(size);
    for (uint32_t begin = 0; begin < size; begin += kChunk)
      tasks.push_back({v, begin, std::min(size, begin + kChunk)});
  }
  std::vector<std::vector<Adjacency>> adjacency(matches ? scene.views.size() : 0);
  ParallelTasks(num_threads, adjacency.size(), [&](size_t v) {
    adjacency[v] = AdjacencyOf(scene, static_cast<uint32_t>(v), *matches);
  });
  std::vector<NodeCounts> counts_of_task(tasks.size());
  ParallelTasks(num_threads, tasks.size(), [&](size_t t) {
    Placer placer(options, scene, matches ? &adjacency[tasks[t].view] : nullptr, tasks[t].view);
    for (uint32_t i = tasks[t].begin; i < tasks[t].end; ++i)
      placer.Place(i, &nodes[tasks[t].view][i], &counts_of_task[t]);
  });
  for (const NodeCounts& c : counts_of_task) {
    counts->candidates += c.candidates;
    for (int k = 0; k < kNumProposalKinds; ++k) {
      counts->proposals[k] += c.proposals[k];
      counts->best[k] += c.best[k];
    }
    for (const auto& [reason, count] : c.dropped) counts->dropped[reason] += count;
  }
  return nodes;
}

}  // namespace holba
