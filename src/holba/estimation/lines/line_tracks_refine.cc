// SPDX-License-Identifier: BSD-3-Clause
// RefineTracks: rounds of fitting, merging and claiming.
#include <algorithm>
#include <cmath>
#include <utility>

#include "holba/base/threads.h"
#include "holba/estimation/lines/line_tracks.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

constexpr int kMaxFits = 4;  // with members dropped in between
// A direction or a plane is kept in a fit while the pixels allow it.
constexpr double kMaxRmsFactor = 1.5;
constexpr double kMaxRmsGainPx = 0.15;
constexpr double kDirectionDistancePx = 1.5;  // of segments' ends, to belong to a vanishing point
constexpr double kDirectionShare = 0.8;       // of the members
// Two tracks are merged if the joint fit keeps this share of their members.
constexpr double kKeptShare = 0.8;

std::vector<LineSupport> SupportsOf(const LineScene& scene, const LineTrack& track) {
  std::vector<LineSupport> supports;
  supports.reserve(track.members.size());
  for (const SegmentKey& key : track.members)
    supports.push_back(scene.views[key.view].supports[key.segment]);
  return supports;
}

// Whether a segment belongs to a line of some extent, as seen in its image.
struct ImageFit {
  bool ok = false;
  double distance_px = 0.0;
};
ImageFit FitInImage(const SceneView& view, uint32_t segment_idx, const AnchoredLine& line,
                    double t_start, double t_end, double max_distance_px, double max_angle_deg,
                    double min_overlap, bool oriented) {
  const SceneSegment& segment = view.segments[segment_idx];
  const std::optional<Eigen::Vector3d> image = view.supports[segment_idx].Image(line);
  if (!image) return {};
  const Eigen::Vector2d normal = image->head<2>();
  const double distance = std::max(std::abs(image->dot(segment.ideal.start.homogeneous())),
                                   std::abs(image->dot(segment.ideal.end.homogeneous())));
  if (!(distance <= max_distance_px)) return {};
  const double cosine = normal.dot(segment.line.head<2>());
  if ((oriented ? cosine : std::abs(cosine)) < std::cos(max_angle_deg * kRadPerDeg)) return {};
  const std::optional<Eigen::Vector2d> a = view.view.Project(line.At(t_start));
  const std::optional<Eigen::Vector2d> b = view.view.Project(line.At(t_end));
  if (!a || !b || OverlapInImage(segment, *a, *b) < min_overlap) return {};
  return {true, distance};
}

// A member of its own image must show the whole overlap; the extent comes from all.
bool FitAndDrop(const LineOptions& options, const LineScene& scene, LineTrack* track) {
  for (int fit = 0; fit < kMaxFits; ++fit) {
    if (NumImages(track->members) < 2) return false;
    const std::vector<LineSupport> supports = SupportsOf(scene, *track);
    if (!FitLine(supports, LinePrior(), kSegmentCauchyPx, &track->line)) return false;
    const auto extent = ExtentOfLine(supports, track->line);
    if (!extent) return false;
    const double middle = 0.5 * (extent->first + extent->second);
    track->line.point = track->line.At(middle);
    track->t_start = extent->first - middle;
    track->t_end = extent->second - middle;
    std::vector<SegmentKey> kept;
    for (const SegmentKey& key : track->members) {
      if (FitInImage(scene.views[key.view], key.segment, track->line, track->t_start, track->t_end,
                     options.max_distance_px, options.max_angle_deg, options.min_overlap,
                     options.oriented)
              .ok)
        kept.push_back(key);
    }
    if (kept.size() == track->members.size()) {
      const std::optional<double> rms = RmsOfLine(supports, track->line);
      track->rms_px = rms ? *rms : 0.0;
      return rms.has_value();
    }
    track->members = std::move(kept);
  }
  return NumImages(track->members) >= 2;
}

// The vanishing point that the members run to: each end's distance from the line through the
// middle.
int32_t FindDirection(const LineScene& scene, const LineTrack& track) {
  int32_t best = -1;
  double best_sum = 0.0;
  for (size_t d = 0; d < scene.directions.size(); ++d) {
    size_t agreeing = 0;
    double sum = 0.0;
    for (const SegmentKey& key : track.members) {
      const SceneView& view = scene.views[key.view];
      const SceneSegment& s = view.segments[key.segment];
      const Eigen::Vector3d vp = view.view.K() * (view.view.R() * scene.directions[d]);
      const Eigen::Vector2d to = vp.head<2>() - vp.z() * 0.5 * (s.ideal.start + s.ideal.end);
      const double size = to.norm();
      if (!(size > 0.0)) continue;
      const double distance =
          0.5 * s.length_px * std::abs(to.x() * s.along.y() - to.y() * s.along.x()) / size;
      sum += std::min(distance, 2.0 * kDirectionDistancePx);
      agreeing += distance <= kDirectionDistancePx;
    }
    if (agreeing < kDirectionShare * track.members.size()) continue;
    if (best < 0 || sum < best_sum) {
      best = static_cast<int32_t>(d);
      best_sum = sum;
    }
  }
  return best;
}

// Tries a fit with a prior and keeps it if the residuals in pixels allow it.
bool TryPrior(const std::vector<LineSupport>& supports, const LinePrior& prior, double free_rms_px,
              LineTrack* track) {
  AnchoredLine line = track->line;
  if (!FitLine(supports, prior, kSegmentCauchyPx, &line)) return false;
  const std::optional<double> rms = RmsOfLine(supports, line);
  if (!rms || *rms >= kMaxRmsFactor * free_rms_px + kMaxRmsGainPx) return false;
  const auto extent = ExtentOfLine(supports, line);
  if (!extent) return false;
  const double middle = 0.5 * (extent->first + extent->second);
  line.point = line.At(middle);
  track->line = line;
  track->t_start = extent->first - middle;
  track->t_end = extent->second - middle;
  track->rms_px = *rms;
  return true;
}

void HoldToGroups(const LineOptions& options, const LineScene& scene, LineTrack* track) {
  track->direction = track->plane = -1;
  if (!options.propose_from_groups) return;
  const std::vector<LineSupport> supports = SupportsOf(scene, *track);
  const double free_rms_px = track->rms_px;
  LinePrior prior;
  if (options.vp_weight_px_per_rad > 0.0) {
    const int32_t direction = FindDirection(scene, *track);
    if (direction >= 0) {
      // A free fit of a line in the plane of the cameras may be far from the direction, where the
      // residuals hardly change: the line is first turned to it, about its middle.
      Eigen::Vector3d toward = scene.directions[direction];
      if (toward.dot(track->line.direction) < 0.0) toward = -toward;
      prior.direction = toward;
      prior.direction_weight = options.vp_weight_px_per_rad;
      LineTrack held = *track;
      held.line.direction = toward;
      if (TryPrior(supports, prior, free_rms_px, &held)) {
        *track = held;
        track->direction = direction;
      } else {
        prior = LinePrior();
      }
    }
  }
  if (track->proposed_plane < 0 || !(options.plane_weight > 0.0)) return;
  const auto uncertainty = UncertaintyOfFit(supports, prior, options.sigma_px, track->line,
                                            track->t_start, track->t_end);
  if (!uncertainty || uncertainty->RelativeSigma() < options.max_relative_sigma) return;
  prior.plane = scene.planes[track->proposed_plane].plane;
  prior.plane_weight = options.plane_weight;
  prior.t_start = track->t_start;
  prior.t_end = track->t_end;
  if (TryPrior(supports, prior, free_rms_px, track)) track->plane = track->proposed_plane;
}

void FitAll(const LineOptions& options, const LineScene& scene, int num_threads,
            std::vector<LineTrack>* tracks, TrackCounts* counts) {
  std::vector<uint8_t> good(tracks->size(), 1);
  ParallelTasks(num_threads, tracks->size(), [&](size_t i) {
    LineTrack& track = (*tracks)[i];
    if (!track.changed) return;
    good[i] = FitAndDrop(options, scene, &track);
    if (good[i]) HoldToGroups(options, scene, &track);
    track.changed = false;
  });
  size_t kept = 0;
  for (size_t i = 0; i < tracks->size(); ++i) {
    if (!good[i]) {
      ++counts->dropped["line: no fit with two images"];
      continue;
    }
    if (kept != i) (*tracks)[kept] = std::move((*tracks)[i]);
    ++kept;
  }
  tracks->resize(kept);
}

using Owners = std::vector<std::vector<int32_t>>;
Owners FindOwners(const LineScene& scene, const std::vector<LineTrack>& tracks) {
  Owners owners(scene.views.size());
  for (size_t v = 0; v < owners.size(); ++v) owners[v].assign(scene.views[v].segments.size(), -1);
  for (size_t t = 0; t < tracks.size(); ++t) {
    for (const SegmentKey& key : tracks[t].members)
      owners[key.view][key.segment] = static_cast<int32_t>(t);
  }
  return owners;
}

struct Hit {
  SegmentKey segment;
  double distance_px;
};

// Segments of other tracks and free ones at the images of a track.
std::vector<Hit> FindHits(const LineOptions& options, const LineScene& scene, const Owners& owners,
                          int32_t track_idx, const LineTrack& track) {
  std::vector<uint8_t> in_sight(scene.views.size(), 0);
  for (const SegmentKey& key : track.members) {
    in_sight[key.view] = 1;
    for (uint32_t n : scene.views[key.view].neighbours) in_sight[n] = 1;
  }
  std::vector<Hit> hits;
  std::vector<uint32_t> seen;
  for (uint32_t v = 0; v < scene.views.size(); ++v) {
    if (!in_sight[v]) continue;
    const SceneView& view = scene.views[v];
    const std::optional<Eigen::Vector2d> a = view.view.Project(track.Start());
    const std::optional<Eigen::Vector2d> b = view.view.Project(track.End());
    if (!a || !b) continue;
    seen.clear();
    view.grid.ForEachNear({*a, *b}, [&](uint32_t i) {
      if (owners[v][i] == track_idx) return;
      const ImageFit fit =
          FitInImage(view, i, track.line, track.t_start, track.t_end, options.claim_distance_px,
                     options.claim_angle_deg, options.claim_overlap, options.oriented);
      if (!fit.ok || std::find(seen.begin(), seen.end(), i) != seen.end()) return;
      seen.push_back(i);
      if (scene.described) {
        double nearest = 2.0;
        for (const SegmentKey& key : track.members)
          nearest = std::min(nearest, scene.DescriptorDistance(key.view, key.segment, v, i));
        if (nearest > options.claim_descriptor_distance) return;
      }
      hits.push_back({{v, i}, fit.distance_px});
    });
  }
  return hits;
}

void MergeAndClaim(const LineOptions& options, const LineScene& scene, int num_threads,
                   std::vector<LineTrack>* tracks, TrackCounts* counts) {
  const Owners owners = FindOwners(scene, *tracks);
  std::vector<std::vector<Hit>> hits(tracks->size());
  ParallelTasks(num_threads, tracks->size(), [&](size_t t) {
    hits[t] = FindHits(options, scene, owners, static_cast<int32_t>(t), (*tracks)[t]);
  });
  // Number of members of one track that lie on the other, for both.
  std::map<std::pair<int32_t, int32_t>, size_t> votes;
  struct Claim {
    SegmentKey segment;
    double distance_px;
    int32_t track;
  };
  std::vector<Claim> claims;
  for (size_t t = 0; t < tracks->size(); ++t) {
    for (const Hit& hit : hits[t]) {
      const int32_t owner = owners[hit.segment.view][hit.segment.segment];
      const int32_t self = static_cast<int32_t>(t);
      if (owner < 0) {
        claims.push_back({hit.segment, hit.distance_px, self});
      } else {
        ++votes[{std::min(owner, self), std::max(owner, self)}];
      }
    }
  }
  struct Pair {
    double share;
    int32_t a, b;
  };
  std::vector<Pair> pairs;
  for (const auto& [pair, count] : votes) {
    const size_t smaller =
        std::min((*tracks)[pair.first].members.size(), (*tracks)[pair.second].members.size());
    const double share = static_cast<double>(count) / smaller;
    if (share >= 0.5) pairs.push_back({share, pair.first, pair.second});
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) {
    if (x.share != y.share) return x.share > y.share;
    return x.a != y.a ? x.a < y.a : x.b < y.b;
  });
  // Joint fits do not depend on each other until a track is taken.
  std::vector<std::optional<LineTrack>> joined(pairs.size());
  ParallelTasks(num_threads, pairs.size(), [&](size_t p) {
    const LineTrack& a = (*tracks)[pairs[p].a];
    const LineTrack& b = (*tracks)[pairs[p].b];
    const bool a_first = a.members.size() >= b.members.size();
    LineTrack both = a_first ? a : b;
    if (both.proposed_plane < 0) both.proposed_plane = (a_first ? b : a).proposed_plane;
    both.score = std::max(a.score, b.score);
    both.members.clear();
    std::merge(a.members.begin(), a.members.end(), b.members.begin(), b.members.end(),
               std::back_inserter(both.members));
    const size_t before = both.members.size();
    if (!FitAndDrop(options, scene, &both)) return;
    if (both.members.size() < kKeptShare * before) return;
    both.changed = true;
    joined[p] = std::move(both);
  });
  std::vector<int32_t> now(tracks->size());
  for (size_t t = 0; t < now.size(); ++t) now[t] = static_cast<int32_t>(t);
  std::vector<uint8_t> gone(tracks->size(), 0), taken(tracks->size(), 0);
  for (size_t p = 0; p < pairs.size(); ++p) {
    const auto [share, a, b] = pairs[p];
    if (!joined[p] || taken[a] || taken[b]) continue;
    taken[a] = taken[b] = 1;
    (*tracks)[a] = std::move(*joined[p]);
    gone[b] = 1;
    now[b] = a;
    ++counts->merged;
  }
  // A segment goes to the line that is nearest to it.
  std::sort(claims.begin(), claims.end(), [](const Claim& x, const Claim& y) {
    if (x.segment != y.segment) return x.segment < y.segment;
    return x.distance_px != y.distance_px ? x.distance_px < y.distance_px : x.track < y.track;
  });
  for (size_t c = 0; c < claims.size(); ++c) {
    if (c > 0 && claims[c].segment == claims[c - 1].segment) continue;
    LineTrack& track = (*tracks)[now[claims[c].track]];
    const auto place =
        std::lower_bound(track.members.begin(), track.members.end(), claims[c].segment);
    track.members.insert(place, claims[c].segment);
    track.changed = true;
    ++counts->claimed;
  }
  size_t kept = 0;
  for (size_t t = 0; t < tracks->size(); ++t) {
    if (gone[t]) continue;
    if (kept != t) (*tracks)[kept] = std::move((*tracks)[t]);
    ++kept;
  }
  tracks->resize(kept);
}

}  // namespace

void RefineTracks(const LineOptions& options, const LineScene& scene, int num_threads,
                  std::vector<LineTrack>* tracks, TrackCounts* counts) {
  FitAll(options, scene, num_threads, tracks, counts);
  for (int round = 0; round < options.refinement_rounds; ++round) {
    MergeAndClaim(options, scene, num_threads, tracks, counts);
    FitAll(options, scene, num_threads, tracks, counts);
  }
  size_t kept = 0;
  for (size_t t = 0; t < tracks->size(); ++t) {
    const size_t num_images = NumImages((*tracks)[t].members);
    if (num_images < static_cast<size_t>(options.min_images)) {
      ++counts->dropped["line: fewer than min_images"];
      continue;
    }
    if (num_images < 4 && (*tracks)[t].score < options.min_score_of_few) {
      ++counts->dropped["line: fewer than 4 images and less than min_score_of_few"];
      continue;
    }
    counts->held_to_direction += (*tracks)[t].direction >= 0;
    counts->held_to_plane += (*tracks)[t].plane >= 0;
    if (kept != t) (*tracks)[kept] = std::move((*tracks)[t]);
    ++kept;
  }
  tracks->resize(kept);
}

}  // namespace holba
