// SPDX-License-Identifier: BSD-3-Clause
// JoinSegments: pairs of segments join their sets, strongest first.
#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/base/union_find.h"
#include "holba/estimation/lines/line_consensus.h"
#include "holba/estimation/lines/line_tracks.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

constexpr double kJoinAngleDeg = 10.0;
constexpr double kMinJoinOverlap = 0.05;
constexpr double kLittleJoinOverlap = 0.1;  // below it the angle's threshold falls to:
constexpr double kLittleJoinOverlapDeg = 2.0;
constexpr double kNodeSigmaPx = 2.0;  // of a hypothesis
constexpr size_t kMaxStarts = 12;

struct Edge {
  double weight;
  uint32_t a, b;
};

// Distance of two 3D segments where they overlap, with the overlap's share of the shorter.
struct Closeness {
  double cosine, overlap, distance;
};
Closeness Compare(const SegmentNode& a, const SegmentNode& b) {
  const Eigen::Vector3d da = (a.end - a.start), db = (b.end - b.start);
  const double la = da.norm(), lb = db.norm();
  if (!(la > 0.0) || !(lb > 0.0)) return {0.0, 0.0, 0.0};
  const Eigen::Vector3d ua = da / la, ub = db / lb;
  Closeness result{ua.dot(ub), 0.0, 0.0};
  const auto clip = [](const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                       const Eigen::Vector3d& origin, const Eigen::Vector3d& along, double length) {
    const double tp = along.dot(p - origin), tq = along.dot(q - origin);
    return std::pair(std::max(std::min(tp, tq), 0.0), std::min(std::max(tp, tq), length));
  };
  const auto in_a = clip(b.start, b.end, a.start, ua, la);
  const auto in_b = clip(a.start, a.end, b.start, ub, lb);
  const double common = std::min(in_a.second - in_a.first, in_b.second - in_b.first);
  if (!(common > 0.0)) return result;
  result.overlap = std::max((in_a.second - in_a.first) / la, (in_b.second - in_b.first) / lb);
  const Eigen::Vector3d a0 = a.start + in_a.first * ua, a1 = a.start + in_a.second * ua;
  Eigen::Vector3d b0 = b.start + in_b.first * ub, b1 = b.start + in_b.second * ub;
  if (result.cosine < 0.0) std::swap(b0, b1);
  result.distance = std::max((a0 - b0).norm(), (a1 - b1).norm());
  return result;
}

}  // namespace

size_t NumImages(const std::vector<SegmentKey>& members) {
  size_t count = 0;
  for (size_t i = 0; i < members.size(); ++i)
    count += i == 0 || members[i].view != members[i - 1].view;
  return count;
}

std::vector<LineTrack> JoinSegments(const LineOptions& options, const LineScene& scene,
                                    const std::vector<std::vector<SegmentNode>>& nodes,
                                    TrackCounts* counts) {
  std::vector<uint32_t> offset(nodes.size() + 1, 0);
  for (size_t v = 0; v < nodes.size(); ++v)
    offset[v + 1] = offset[v] + static_cast<uint32_t>(nodes[v].size());
  std::vector<SegmentKey> keys(offset.back());
  // World length of the deviation of a hypothesis.
  std::vector<double> sigma(offset.back(), 0.0);
  for (uint32_t v = 0; v < nodes.size(); ++v) {
    for (uint32_t i = 0; i < nodes[v].size(); ++i) {
      keys[offset[v] + i] = {v, i};
      const SegmentNode& node = nodes[v][i];
      if (!node.placed) continue;
      sigma[offset[v] + i] =
          kNodeSigmaPx / scene.views[v].view.PixelsPerLength(0.5 * (node.start + node.end));
    }
  }
  std::vector<Edge> edges;
  for (uint32_t a = 0; a < keys.size(); ++a) {
    const SegmentNode& node = nodes[keys[a].view][keys[a].segment];
    for (const SegmentKey& key : node.agreeing) {
      const SegmentNode& other = nodes[key.view][key.segment];
      if (!other.placed) {
        ++counts->dropped["pair: the other segment has no place"];
        continue;
      }
      const uint32_t b = offset[key.view] + key.segment;
      const Closeness c = Compare(node, other);
      if (options.oriented ? c.cosine <= 0.0 : false) continue;
      if (c.overlap <= kMinJoinOverlap) {
        ++counts->dropped["pair: no overlap in 3D"];
        continue;
      }
      double threshold = kJoinAngleDeg;
      if (c.overlap < kLittleJoinOverlap) {
        threshold = kLittleJoinOverlapDeg + (kJoinAngleDeg - kLittleJoinOverlapDeg) *
                                                (c.overlap - kMinJoinOverlap) /
                                                (kLittleJoinOverlap - kMinJoinOverlap);
      }
      const double angle = std::acos(std::min(1.0, std::abs(c.cosine))) / kRadPerDeg;
      const double weight =
          std::min(ScoreOf(angle, threshold), ScoreOf(c.distance, std::min(sigma[a], sigma[b])));
      if (!(weight > 0.0)) {
        ++counts->dropped["pair: apart in 3D"];
        continue;
      }
      edges.push_back({weight, std::min(a, b), std::max(a, b)});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    if (x.weight != y.weight) return x.weight > y.weight;
    return x.a != y.a ? x.a < y.a : x.b < y.b;
  });
  UnionFind sets(keys.size());
  for (const Edge& edge : edges) {
    const uint32_t a = sets.Root(edge.a), b = sets.Root(edge.b);
    sets.Join(std::min(a, b), std::max(a, b));
  }
  std::vector<LineTrack> tracks;
  std::vector<int64_t> track_of_root(keys.size(), -1);
  std::vector<uint32_t> size_of_root(keys.size(), 0);
  for (uint32_t i = 0; i < keys.size(); ++i) ++size_of_root[sets.Root(i)];
  for (uint32_t i = 0; i < keys.size(); ++i) {
    const uint32_t r = sets.Root(i);
    if (size_of_root[r] < 2) {
      if (nodes[keys[i].view][keys[i].segment].placed)
        ++counts->dropped["segment: placed, but no other agrees"];
      continue;
    }
    if (track_of_root[r] < 0) {
      track_of_root[r] = static_cast<int64_t>(tracks.size());
      tracks.emplace_back();
    }
    tracks[track_of_root[r]].members.push_back(keys[i]);
  }
  // Each starts as the hypothesis that fits all its members best.
  for (LineTrack& track : tracks) {
    std::vector<SegmentKey> starts = track.members;
    std::stable_sort(starts.begin(), starts.end(), [&](const SegmentKey& x, const SegmentKey& y) {
      return nodes[x.view][x.segment].score > nodes[y.view][y.segment].score;
    });
    if (starts.size() > kMaxStarts) starts.resize(kMaxStarts);
    double best = std::numeric_limits<double>::infinity();
    std::map<int32_t, size_t> planes;
    for (const SegmentKey& key : track.members) {
      const SegmentNode& node = nodes[key.view][key.segment];
      if (node.plane >= 0) ++planes[node.plane];
      track.score = std::max(track.score, node.score);
    }
    for (const SegmentKey& key : starts) {
      const SegmentNode& node = nodes[key.view][key.segment];
      const AnchoredLine line{(node.end - node.start).normalized(), 0.5 * (node.start + node.end)};
      double cost = 0.0;
      for (const SegmentKey& member : track.members) {
        const double square =
            SquaredDistance(scene.views[member.view].supports[member.segment], line);
        cost += std::log1p(std::min(square, 1e12) / (kSegmentCauchyPx * kSegmentCauchyPx));
      }
      if (!(cost < best)) continue;
      best = cost;
      track.line = line;
      track.t_end = 0.5 * (node.end - node.start).norm();
      track.t_start = -track.t_end;
    }
    // The plane that placed a third of the members or more.
    for (const auto& [plane, count] : planes) {
      if (count * 3 >= track.members.size() &&
          (track.proposed_plane < 0 || count > planes[track.proposed_plane]))
        track.proposed_plane = plane;
    }
  }
  return tracks;
}

}  // namespace holba
