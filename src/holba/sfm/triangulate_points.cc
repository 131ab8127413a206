// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/triangulate_points.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/bundle/reprojection.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

// The stages share what they look up: views of images and where keypoints are in them.
class Triangulator {
 public:
  Triangulator(const TriangulationOptions& options, MapperState* state)
      : options_(options), state_(*state), model_(state->model()), views_(state->model()) {}

  PointChanges OfImage(image_t image_id) {
    changes_ = {};
    const size_t num_points = model_.images.at(image_id).points2D.size();
    for (point2D_t idx = 0; idx < num_points; ++idx) OfKeypoint({image_id, idx});
    return changes_;
  }

  PointChanges Complete(std::span<const point3D_t> point_ids) {
    changes_ = {};
    for (const point3D_t id : point_ids) {
      if (model_.points3D.contains(id)) CompleteTrack(id);
    }
    return changes_;
  }

  PointChanges Merge(std::span<const point3D_t> point_ids) {
    changes_ = {};
    for (const point3D_t id : point_ids) {
      point3D_t kept = id;
      while (model_.points3D.contains(kept)) {
        const std::optional<point3D_t> merged = MergeTrack(kept);
        if (!merged) break;
        kept = *merged;
      }
    }
    return changes_;
  }

  PointChanges Again() {
    changes_ = {};
    std::vector<image_t> images;
    for (const auto& [id, image] : model_.images) images.push_back(id);
    std::sort(images.begin(), images.end());
    for (const image_t id1 : images) {
      for (const MatchedImage& matched : state_.graph().MatchedImages(id1)) {
        const image_t id2 = matched.image_id;
        if (id2 <= id1 || !model_.images.contains(id2)) continue;
        PairAgain(id1, id2);
      }
    }
    return changes_;
  }

 private:
  point3D_t PointOf(const PointObservation& observation) const {
    const Image* image = model_.images.Find(observation.image_id);
    return image != nullptr ? image->points2D[observation.point2D_idx].point3D_id : kNoId;
  }
  const Eigen::Vector2d& SeenAt(const PointObservation& observation) const {
    return model_.images.at(observation.image_id).points2D[observation.point2D_idx].xy;
  }

  // Cosine of the angle between the observed ray and the direction to X; empty: behind.
  std::optional<double> CosAngle(const PointObservation& observation, const Eigen::Vector3d& X) {
    const IdealView& view = views_.Of(observation.image_id);
    if (!(view.Depth(X) > 0.0)) return std::nullopt;
    const auto ideal = view.ToIdeal(SeenAt(observation));
    if (!ideal) return std::nullopt;
    return view.Ray(*ideal).dot((X - view.centre()).normalized());
  }

  // In pixels of the photograph; empty: behind.
  std::optional<double> SquaredErrorPx(const PointObservation& observation,
                                       const Eigen::Vector3d& X) const {
    const Image& image = model_.images.at(observation.image_id);
    const auto pixel = PixelOf(model_, image, X);
    if (!pixel) return std::nullopt;
    return (*pixel - image.points2D[observation.point2D_idx].xy).squaredNorm();
  }

  void OfKeypoint(const PointObservation& self) {
    const auto matches = state_.graph().CorrespondencesOf(self.image_id, self.point2D_idx);
    if (matches.empty() || PointOf(self) != kNoId) return;
    std::vector<PointObservation> open;
    std::optional<std::pair<double, point3D_t>> best;
    for (const Correspondence& match : matches) {
      const PointObservation other{match.image_id, match.point2D_idx};
      if (!model_.images.contains(other.image_id)) continue;
      const point3D_t id = PointOf(other);
      if (id == kNoId) {
        open.push_back(other);
        continue;
      }
      const auto cos_angle = CosAngle(self, model_.points3D.at(id).xyz);
      if (cos_angle && (!best || *cos_angle > best->first)) best = {*cos_angle, id};
    }
    if (best && best->first >= std::cos(DegToRad(options_.continue_max_angle_error_deg))) {
      state_.Observe(best->second, self);
      ++changes_.continued;
      return;
    }
    if (open.empty()) return;
    if (options_.ignore_two_view_tracks &&
        state_.graph().IsTwoViewObservation(self.image_id, self.point2D_idx))
      return;
    open.insert(open.begin(), self);
    Create(std::move(open), options_.create_max_angle_error_deg);
  }

  // What the points of the observations are, as many as they tell apart.
  void Create(std::vector<PointObservation> open, double max_angle_error_deg) {
    while (open.size() >= 2) {
      std::vector<PointView> views;
      std::vector<PointObservation> seen;
      double max_error_px = 0.0;
      for (const PointObservation& observation : open) {
        const IdealView& view = views_.Of(observation.image_id);
        const auto ideal = view.ToIdeal(SeenAt(observation));
        if (!ideal) continue;
        views.push_back({&view, *ideal});
        seen.push_back(observation);
        max_error_px =
            std::max(max_error_px, std::tan(DegToRad(max_angle_error_deg)) * view.focal());
      }
      const auto point = TriangulatePoint(
          views, {.max_error_px = max_error_px, .min_angle_deg = options_.min_angle_deg});
      if (!point) return;
      std::vector<PointObservation> track, rest;
      std::set<image_t> images;
      for (size_t i = 0; i < seen.size(); ++i) {
        // One observation of an image; a second one may be of another point.
        const bool is_of_it = point->is_inlier[i] && images.insert(seen[i].image_id).second;
        (is_of_it ? track : rest).push_back(seen[i]);
      }
      if (track.size() < 2) return;
      state_.AddPoint(point->xyz, track);
      ++changes_.created;
      changes_.continued += track.size() - 2;
      // Two that are left are as likely to be what did not fit.
      if (rest.size() < 3) return;
      open = std::move(rest);
    }
  }

  void CompleteTrack(point3D_t id) {
    const double max_squared = options_.complete_max_error_px * options_.complete_max_error_px;
    const Eigen::Vector3d xyz = model_.points3D.at(id).xyz;
    std::vector<PointObservation> front = model_.points3D.at(id).track;
    for (int depth = 0; depth < options_.complete_max_transitivity && !front.empty(); ++depth) {
      std::vector<PointObservation> added;
      for (const PointObservation& observation : front) {
        for (const Correspondence& match :
             state_.graph().CorrespondencesOf(observation.image_id, observation.point2D_idx)) {
          const PointObservation other{match.image_id, match.point2D_idx};
          if (!model_.images.contains(other.image_id) || PointOf(other) != kNoId) continue;
          const auto squared = SquaredErrorPx(other, xyz);
          if (!squared || *squared > max_squared) continue;
          state_.Observe(id, other);
          ++changes_.completed;
          added.push_back(other);
        }
      }
      front = std::move(added);
    }
  }

  // Whether all observations of both agree with one place.
  bool Agree(const Point3D& a, const Point3D& b, Eigen::Vector3d* xyz) const {
    const double na = static_cast<double>(a.track.size()), nb = static_cast<double>(b.track.size());
    *xyz = (na * a.xyz + nb * b.xyz) / (na + nb);
    const double max_squared = options_.merge_max_error_px * options_.merge_max_error_px;
    for (const Point3D* point : {&a, &b}) {
      for (const PointObservation& observation : point->track) {
        const auto squared = SquaredErrorPx(observation, *xyz);
        if (!squared || *squared > max_squared) return false;
      }
    }
    return true;
  }

  // The point that it and another became; empty: it stays alone.
  std::optional<point3D_t> MergeTrack(point3D_t id) {
    const Point3D& point = model_.points3D.at(id);
    for (const PointObservation& observation : point.track) {
      for (const Correspondence& match :
           state_.graph().CorrespondencesOf(observation.image_id, observation.point2D_idx)) {
        const point3D_t other = PointOf({match.image_id, match.point2D_idx});
        if (other == kNoId || other == id ||
            !tried_merges_.insert({std::min(id, other), std::max(id, other)}).second)
          continue;
        Eigen::Vector3d xyz;
        if (!Agree(point, model_.points3D.at(other), &xyz)) continue;
        state_.MergePoints(id, other);
        ++changes_.merged;
        // The merged point is one that has not been compared.
        std::erase_if(tried_merges_,
                      [&](const auto& pair) { return pair.first == id || pair.second == id; });
        return id;
      }
    }
    return std::nullopt;
  }

  void PairAgain(image_t id1, image_t id2) {
    const PointMatches matches = state_.graph().MatchesBetween(id1, id2);
    size_t num_triangulated = 0;
    for (const auto& [idx1, idx2] : matches) {
      const point3D_t a = PointOf({id1, idx1});
      num_triangulated += a != kNoId && a == PointOf({id2, idx2});
    }
    if (static_cast<double>(num_triangulated) >=
        options_.retriangulate_min_ratio * static_cast<double>(matches.size()))
      return;
    int& trials = state_.num_retriangulations[{id1, id2}];
    if (trials >= options_.retriangulate_max_trials) return;
    ++trials;
    const double min_cos = std::cos(DegToRad(options_.retriangulate_max_angle_error_deg));
    for (const auto& [idx1, idx2] : matches) {
      const PointObservation first{id1, idx1}, second{id2, idx2};
      const point3D_t a = PointOf(first), b = PointOf(second);
      if (a != kNoId && b != kNoId) continue;
      if (a == kNoId && b == kNoId) {
        Create({first, second}, options_.create_max_angle_error_deg);
        continue;
      }
      const PointObservation& open = a == kNoId ? first : second;
      const point3D_t id = a == kNoId ? b : a;
      const auto cos_angle = CosAngle(open, model_.points3D.at(id).xyz);
      if (!cos_angle || *cos_angle < min_cos) continue;
      state_.Observe(id, open);
      ++changes_.continued;
    }
  }

  const TriangulationOptions& options_;
  MapperState& state_;
  const Reconstruction& model_;
  ViewCache views_;
  std::set<std::pair<point3D_t, point3D_t>> tried_merges_;
  PointChanges changes_;
};

}  // namespace

PointChanges& PointChanges::operator+=(const PointChanges& other) {
  created += other.created;
  continued += other.continued;
  completed += other.completed;
  merged += other.merged;
  return *this;
}

PointChanges TriangulateImage(const TriangulationOptions& options, image_t image_id,
                              MapperState* state) {
  return Triangulator(options, state).OfImage(image_id);
}
PointChanges CompleteTracks(const TriangulationOptions& options,
                            std::span<const point3D_t> point_ids, MapperState* state) {
  return Triangulator(options, state).Complete(point_ids);
}
PointChanges MergeTracks(const TriangulationOptions& options, std::span<const point3D_t> point_ids,
                         MapperState* state) {
  return Triangulator(options, state).Merge(point_ids);
}
PointChanges Retriangulate(const TriangulationOptions& options, MapperState* state) {
  return Triangulator(options, state).Again();
}

}  // namespace holba
