// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/corner_tracks.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>

#include "holba/base/threads.h"
#include "holba/base/union_find.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/estimation/wireframe/corner_matching.h"
#include "holba/robust/median.h"
#include "holba/scene/covisibility.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// A corner of an image: positions of both, in the model's images and in the image's field.
struct Corner {
  uint32_t image, corner;
};

// Joins matched corners, best matches first, never two of one image.
class TrackBuilder {
 public:
  explicit TrackBuilder(const std::vector<CornerField>& fields)
      : first_(FirstOfEach(fields)), sets_(first_.back()), members_(first_.back()) {
    for (uint32_t i = 0; i < fields.size(); ++i) {
      for (uint32_t k = 0; k < fields[i].size(); ++k) members_[first_[i] + k] = {{i, k}};
    }
  }

  void Join(const Corner& a, const Corner& b) {
    uint32_t into = sets_.Root(first_[a.image] + a.corner);
    uint32_t from = sets_.Root(first_[b.image] + b.corner);
    if (into == from) return;
    if (members_[into].size() < members_[from].size()) std::swap(into, from);
    for (const Corner& c : members_[from]) {
      for (const Corner& other : members_[into]) {
        if (c.image == other.image) return;
      }
    }
    members_[into].insert(members_[into].end(), members_[from].begin(), members_[from].end());
    members_[from].clear();
    sets_.Join(into, from);
  }

  // Of at least `min_size` corners, ordered by image; in a fixed order.
  std::vector<std::vector<Corner>> Tracks(size_t min_size) {
    std::vector<std::vector<Corner>> tracks;
    for (std::vector<Corner>& members : members_) {
      if (members.size() < min_size) continue;
      std::sort(members.begin(), members.end(),
                [](const Corner& a, const Corner& b) { return a.image < b.image; });
      tracks.push_back(std::move(members));
    }
    return tracks;
  }

 private:
  static std::vector<uint32_t> FirstOfEach(const std::vector<CornerField>& fields) {
    std::vector<uint32_t> first(fields.size() + 1, 0);
    for (size_t i = 0; i < fields.size(); ++i) {
      first[i + 1] = first[i] + static_cast<uint32_t>(fields[i].size());
    }
    return first;
  }

  const std::vector<uint32_t> first_;  // number of each image's first corner
  UnionFind sets_;
  std::vector<std::vector<Corner>> members_;  // of roots
};

class CornerTriangulator {
 public:
  CornerTriangulator(const CornerTrackOptions& options, const ImageFeatureMap& features,
                     int num_threads, Reconstruction* model)
      : options_(options),
        features_(features),
        num_threads_(num_threads),
        model_(model),
        views_(*model) {
    triangulation_.max_error_px = options.max_error_px;
    triangulation_.min_angle_deg = options.min_triangulation_angle_deg;
    triangulation_.min_num_views = static_cast<size_t>(std::max(2, options.min_num_images));
  }

  CornerTrackReport Run(std::span<const point3D_t> junction_ids) {
    MakeFields();
    FindDepths();
    TrackBuilder builder(fields_);
    for (const Match& match : MatchPairs(NeighbouringPairs())) builder.Join(match.a, match.b);
    const std::vector<std::vector<Corner>> tracks = builder.Tracks(triangulation_.min_num_views);
    report_.num_tracks = tracks.size();

    std::vector<std::optional<TriangulatedPoint>> points(tracks.size());
    std::vector<PointTriangulationFailure> failures(tracks.size());
    ParallelTasks(num_threads_, tracks.size(), [&](size_t i) {
      std::vector<PointView> views;
      for (const Corner& c : tracks[i]) views.push_back({&views_[c.image], Ideal(c)});
      points[i] = TriangulatePoint(views, triangulation_, &failures[i]);
    });
    for (PointTriangulationFailure failure : failures) {
      if (failure == PointTriangulationFailure::kFewViews) {
        ++report_.dropped["tracks that are not one point"];
      } else if (failure == PointTriangulationFailure::kSmallAngle) {
        ++report_.dropped["tracks seen under a small angle of triangulation"];
      }
    }
    ListJunctions(junction_ids);
    for (size_t i = 0; i < tracks.size(); ++i) {
      if (points[i]) Add(tracks[i], *points[i]);
    }
    FinishJunctions();
    Summarise();
    return std::move(report_);
  }

 private:
  struct Match {
    Corner a, b;
    float distance;
  };
  struct JunctionView {
    Eigen::Vector2d ideal;
    point3D_t point3D_id;
  };

  const Eigen::Vector2d& Ideal(const Corner& c) const { return fields_[c.image].ideal(c.corner); }
  image_t ImageId(uint32_t image) const { return views_.ImageId(image); }
  const Eigen::Vector2d& Pixel(const Corner& c) const {
    return features_.at(ImageId(c.image)).corners[fields_[c.image].FeatureIdx(c.corner)];
  }

  void MakeFields() {
    const ImageFeatures none;
    for (uint32_t i = 0; i < views_.size(); ++i) {
      const auto found = features_.find(ImageId(i));
      fields_.emplace_back(views_[i], found == features_.end() ? none : found->second);
      if (fields_.back().size() == 0) ++report_.dropped["images without described corners"];
    }
  }

  // Range of depths of an image, from the points that it sees. It is wider than theirs, because
  // corners may lie somewhat beyond them.
  void FindDepths() {
    depths_.resize(views_.size());
    for (size_t i = 0; i < views_.size(); ++i) {
      std::vector<double> depths;
      for (const Point2D& point2D : model_->images.begin()[i].second.points2D) {
        if (point2D.point3D_id == kNoId) continue;
        const double depth = views_[i].Depth(model_->points3D.at(point2D.point3D_id).xyz);
        if (depth > 0.0) depths.push_back(depth);
      }
      if (depths.empty()) {
        if (fields_[i].size() > 0) ++report_.dropped["images without points"];
        continue;
      }
      const auto quantile = [&](double share) {
        const auto nth = depths.begin() + static_cast<ptrdiff_t>(share * (depths.size() - 1));
        std::nth_element(depths.begin(), nth, depths.end());
        return *nth;
      };
      depths_[i] = DepthRange{0.5 * quantile(0.02), 2.0 * quantile(0.98)};
    }
  }

  // Each image with those that share most points with it.
  std::vector<std::pair<uint32_t, uint32_t>> NeighbouringPairs() const {
    const Covisibility covisibility(*model_);
    const auto has_corners = [&](uint32_t i) { return fields_[i].size() > 0 && depths_[i]; };
    std::vector<std::pair<uint32_t, uint32_t>> pairs;
    for (uint32_t i = 0; i < views_.size(); ++i) {
      if (!has_corners(i)) continue;
      const auto neighbours = covisibility.NeighboursOf(i);
      std::vector<Covisibility::Neighbour> others(neighbours.begin(), neighbours.end());
      std::erase_if(others, [&](const auto& other) { return !has_corners(other.image_idx); });
      std::stable_sort(others.begin(), others.end(), [](const auto& a, const auto& b) {
        return a.num_points > b.num_points;
      });
      if (others.size() > static_cast<size_t>(options_.num_neighbours)) {
        others.resize(static_cast<size_t>(options_.num_neighbours));
      }
      for (const auto& other : others) {
        pairs.emplace_back(std::min(i, other.image_idx), std::max(i, other.image_idx));
      }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
  }

  // Matches of all pairs of images, best first.
  std::vector<Match> MatchPairs(const std::vector<std::pair<uint32_t, uint32_t>>& pairs) {
    std::vector<std::vector<CornerMatch>> by_pair(pairs.size());
    ParallelTasks(num_threads_, pairs.size(), [&](size_t i) {
      const auto [a, b] = pairs[i];
      by_pair[i] = MatchCorners(fields_[a], *depths_[a], fields_[b], *depths_[b], options_);
    });
    std::vector<Match> matches;
    for (size_t i = 0; i < pairs.size(); ++i) {
      for (const CornerMatch& m : by_pair[i]) {
        matches.push_back({{pairs[i].first, m.corner1}, {pairs[i].second, m.corner2}, m.distance});
      }
    }
    std::sort(matches.begin(), matches.end(), [](const Match& m, const Match& n) {
      return std::tie(m.distance, m.a.image, m.a.corner, m.b.image, m.b.corner) <
             std::tie(n.distance, n.a.image, n.a.corner, n.b.image, n.b.corner);
    });
    report_.num_image_pairs = pairs.size();
    report_.num_matches = matches.size();
    return matches;
  }

  void ListJunctions(std::span<const point3D_t> junction_ids) {
    junctions_.resize(views_.size());
    for (point3D_t id : junction_ids) {
      for (const PointObservation& observation : model_->points3D.at(id).track) {
        const size_t i = views_.IndexOf(observation.image_id);
        const auto x = views_[i].ToIdeal(
            model_->images.begin()[i].second.points2D.at(observation.point2D_idx).xy);
        if (x) junctions_[i].push_back({*x, id});
      }
    }
  }

  // The junction that a track coincides with in all images that they share, two at least.
  std::optional<point3D_t> JunctionOf(const std::vector<Corner>& track,
                                      const TriangulatedPoint& point) const {
    std::map<point3D_t, std::pair<size_t, size_t>> counts;  // near, shared
    for (size_t k = 0; k < track.size(); ++k) {
      if (!point.is_inlier[k]) continue;
      for (const JunctionView& junction : junctions_[track[k].image]) {
        const bool is_near =
            (junction.ideal - Ideal(track[k])).norm() < options_.max_junction_distance_px;
        auto& [near, shared] = counts[junction.point3D_id];
        near += is_near;
        ++shared;
      }
    }
    std::optional<point3D_t> best;
    size_t most = 1;
    for (const auto& [id, count] : counts) {
      if (count.first == count.second && count.first > most) {
        most = count.first;
        best = id;
      }
    }
    return best;
  }

  void Add(const std::vector<Corner>& track, const TriangulatedPoint& point) {
    if (const auto junction = JunctionOf(track, point)) {
      ++report_.num_in_junctions;
      AddToJunction(track, point, *junction);
      return;
    }
    std::vector<std::pair<image_t, Eigen::Vector2d>> observations;
    for (size_t k = 0; k < track.size(); ++k) {
      if (point.is_inlier[k]) {
        observations.emplace_back(ImageId(track[k].image), Pixel(track[k]));
      } else {
        ++report_.dropped["observations far from their point"];
      }
    }
    report_.point3D_ids.push_back(
        AddPointOfStructure(point.xyz, PointOrigin::kCorner, {0, 0, 0}, observations, model_));
    report_.num_observations += observations.size();
  }

  // Where the junction has an observation, that one stays: the intersection of two segments is the
  // more precise.
  void AddToJunction(const std::vector<Corner>& track, const TriangulatedPoint& point,
                     point3D_t junction) {
    for (size_t k = 0; k < track.size(); ++k) {
      const image_t image_id = ImageId(track[k].image);
      const Point3D& known = model_->points3D.at(junction);
      const bool is_seen =
          std::any_of(known.track.begin(), known.track.end(),
                      [&](const PointObservation& o) { return o.image_id == image_id; });
      if (is_seen || !point.is_inlier[k]) continue;
      const auto x = views_[track[k].image].Project(known.xyz);
      if (!x || (*x - Ideal(track[k])).norm() > options_.max_error_px) {
        ++report_.dropped["observations far from their junction"];
        continue;
      }
      model_->AddObservation(junction,
                             PointObservation{image_id, model_->AddPoint2D(image_id, Pixel(track[k]))});
      ++report_.num_junction_observations;
      extended_.push_back(junction);
    }
  }

  // Refines the junctions that have new observations on all of their observations.
  void FinishJunctions() {
    std::sort(extended_.begin(), extended_.end());
    extended_.erase(std::unique(extended_.begin(), extended_.end()), extended_.end());
    for (point3D_t id : extended_) {
      Point3D& point = model_->points3D.at(id);
      std::vector<PointView> views;
      for (const PointObservation& observation : point.track) {
        const size_t i = views_.IndexOf(observation.image_id);
        const auto x = views_[i].ToIdeal(
            model_->images.begin()[i].second.points2D.at(observation.point2D_idx).xy);
        if (x) views.push_back({&views_[i], *x});
      }
      if (const auto refined = RefinePoint(views, point.xyz)) point.xyz = *refined;
      point.error = MeanReprojectionErrorPx(*model_, point).value_or(-1.0);
    }
  }

  void Summarise() {
    std::vector<double> errors;
    for (point3D_t id : report_.point3D_ids) errors.push_back(model_->points3D.at(id).error);
    report_.median_error_px = Median(std::move(errors));
  }

  const CornerTrackOptions& options_;
  const ImageFeatureMap& features_;
  const int num_threads_;
  Reconstruction* model_;
  PointTriangulationOptions triangulation_;
  const ViewMap views_;  // these by position of the image
  std::vector<CornerField> fields_;
  std::vector<std::optional<DepthRange>> depths_;
  std::vector<std::vector<JunctionView>> junctions_;
  std::vector<point3D_t> extended_;  // junctions with new observations
  CornerTrackReport report_;
};

}  // namespace

void CornerTrackOptions::Describe(OptionTable* table) const {
  table->Section("CornerTracks");
  table->Field("num_neighbours", &num_neighbours, AtLeast(1),
               "Images that the corners of each image are matched with.");
  table->Field("max_epipolar_error_px", &max_epipolar_error_px, GreaterThan(0),
               "Farthest corner from the epipolar line of its match, pixels.");
  table->Field("max_descriptor_distance", &max_descriptor_distance, GreaterThan(0),
               "Largest distance of the unit descriptors of a match.");
  table->Field("max_ratio", &max_ratio, Between(0, 1),
               "Largest ratio of that distance to the one of the second best corner on the line.");
  table->Field("min_num_images", &min_num_images, AtLeast(2),
               "Images that must observe a point made of corners.");
  table->Field("max_error_px", &max_error_px, GreaterThan(0),
               "Largest reprojection error of an observation, pixels.");
  table->Field("min_triangulation_angle_deg", &min_triangulation_angle_deg, Between(0, 90),
               "Least angle between two rays of a point.");
  table->Field("max_junction_distance_px", &max_junction_distance_px, AtLeast(0),
               "Corners nearer than this to a junction in all images are that junction, pixels.");
}

CornerTrackReport TriangulateCorners(const CornerTrackOptions& options,
                                     const ImageFeatureMap& features, int num_threads,
                                     Reconstruction* model,
                                     std::span<const point3D_t> junction_ids) {
  return CornerTriangulator(options, features, num_threads, model).Run(junction_ids);
}

}  // namespace holba
