// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/model_sightings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <unordered_map>

#include "holba/group/known_types.h"

namespace holba {
namespace {

// Programs round key points to single precision and shift them by fractions of a pixel; beyond a
// pixel it is another point.
constexpr double kSameKeypointPx = 1.0;
// Ends of segments are less certain along them.
constexpr double kSameSegmentPx = 3.0;
// Vanishing points of an image, those with the most segments, that are paired with directions of
// the model, those with the most lines.
constexpr size_t kMaxVanishingPoints = 6, kMaxDirections = 8;

int64_t CellOf(double x, double y) {
  return (static_cast<int64_t>(std::floor(x)) << 32) ^
         (static_cast<int64_t>(std::floor(y)) & 0xffffffff);
}

// Nearest keypoints of positions, in cells of a pixel.
class KeypointGrid {
 public:
  explicit KeypointGrid(const Keypoints& keypoints) : keypoints_(keypoints) {
    for (size_t i = 0; i < keypoints.size(); ++i) {
      const Eigen::Vector2d x = keypoints.Position(i);
      cells_[CellOf(x.x(), x.y())].push_back(static_cast<point2D_t>(i));
    }
  }
  // kInvalidId32: none within kSameKeypointPx.
  point2D_t Nearest(const Eigen::Vector2d& x) const {
    point2D_t nearest = kInvalidId32;
    double best = kSameKeypointPx;
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        const auto cell = cells_.find(CellOf(x.x() + dx, x.y() + dy));
        if (cell == cells_.end()) continue;
        for (point2D_t i : cell->second) {
          const double distance = (keypoints_.Position(i) - x).norm();
          if (distance > best || (distance == best && i > nearest)) continue;
          best = distance;
          nearest = i;
        }
      }
    }
    return nearest;
  }

 private:
  const Keypoints& keypoints_;
  std::unordered_map<int64_t, std::vector<point2D_t>> cells_;
};

double Difference(const LineSegment2d& a, const LineSegment2d& b) {
  return std::max((a.start - b.start).norm(), (a.end - b.end).norm());
}

}  // namespace

FeaturesOfModel::FeaturesOfModel(const Reconstruction& model, const Database& database,
                                 const std::map<image_t, image_t>& database_id)
    : model_(model) {
  for (const auto& [id, image] : model.images) {
    const auto known = database_id.find(id);
    if (known == database_id.end()) continue;
    OfImage features;
    if (const auto keypoints = database.ReadKeypoints(known->second))
      AddPoints(image, *keypoints, &features);
    const auto settings = database.ReadSegmentSettings(known->second);
    const auto segments = settings ? database.ReadSegments(known->second, *settings) : std::nullopt;
    if (segments) AddLines(image, *segments, &features);
    if (features.point_of_keypoint.empty() && features.line_of_segment.empty()) continue;
    images_.push_back(known->second);
    features_.emplace(known->second, std::move(features));
  }
  std::sort(images_.begin(), images_.end());
}

void FeaturesOfModel::AddPoints(const Image& image, const Keypoints& keypoints, OfImage* features) {
  features->point_of_keypoint.assign(keypoints.size(), kNoId);
  const KeypointGrid grid(keypoints);
  for (size_t idx = 0; idx < image.points2D.size(); ++idx) {
    const Point2D& point = image.points2D[idx];
    if (point.point3D_id == kNoId || IsOfStructure(model_.points3D.at(point.point3D_id).origin))
      continue;
    // Several keypoints may be at one place: the model's own is the one of its index.
    const bool is_own =
        idx < keypoints.size() && (keypoints.Position(idx) - point.xy).norm() < kSameKeypointPx;
    const point2D_t keypoint = is_own ? static_cast<point2D_t>(idx) : grid.Nearest(point.xy);
    if (keypoint == kInvalidId32) {
      ++num_without_;
      continue;
    }
    ++num_with_;
    features->point_of_keypoint[keypoint] = point.point3D_id;
  }
}

void FeaturesOfModel::AddLines(const Image& image, const std::vector<LineSegment2d>& segments,
                               OfImage* features) {
  features->line_of_segment.assign(segments.size(), kNoId);
  for (size_t idx = 0; idx < image.lines2D.size(); ++idx) {
    const Line2D& line = image.lines2D[idx];
    if (line.line3D_id == kNoId) continue;
    size_t same = segments.size();
    double best = kSameSegmentPx;
    if (idx < segments.size() && Difference(segments[idx], line.segment) < best) {
      same = idx;
    } else {
      for (size_t k = 0; k < segments.size(); ++k) {
        const double difference = Difference(segments[k], line.segment);
        if (!(difference < best)) continue;
        best = difference;
        same = k;
      }
    }
    if (same < segments.size()) features->line_of_segment[same] = line.line3D_id;
  }
}

ModelSightings FeaturesOfModel::Find(const Database& database, image_t image_id, MatchesTaken taken,
                                     const LineMatchMap& line_matches) const {
  ModelSightings sightings;
  std::set<std::pair<point2D_t, point3D_t>> points;
  std::set<std::pair<line2D_t, line3D_t>> lines;
  for (image_t other : images_) {
    const OfImage& features = features_.at(other);
    bool has_match = false;
    std::optional<PointMatches> matches;
    if (taken == MatchesTaken::kAll) {
      matches = database.ReadMatches(image_id, other);
    } else if (auto geometry = database.ReadTwoViewGeometry(image_id, other)) {
      matches = std::move(geometry->inlier_matches);
    }
    for (const auto& [own, theirs] : matches.value_or(PointMatches())) {
      if (theirs >= features.point_of_keypoint.size()) continue;
      const point3D_t id = features.point_of_keypoint[theirs];
      if (id == kNoId) continue;
      points.emplace(own, id);
      has_match = true;
    }
    const auto of_pair = line_matches.find(std::minmax(image_id, other));
    if (of_pair != line_matches.end()) {
      for (const LineMatch& match : of_pair->second) {
        const line2D_t own = image_id < other ? match.idx1 : match.idx2;
        const line2D_t theirs = image_id < other ? match.idx2 : match.idx1;
        if (theirs >= features.line_of_segment.size()) continue;
        const line3D_t id = features.line_of_segment[theirs];
        if (id == kNoId) continue;
        lines.emplace(own, id);
        has_match = true;
      }
    }
    sightings.num_images += has_match;
  }

  if (!points.empty()) {
    const auto keypoints = database.ReadKeypoints(image_id);
    for (const auto& [idx, id] : points)
      sightings.matches.points.push_back({keypoints->Position(idx), model_.points3D.at(id).xyz});
    sightings.points.assign(points.begin(), points.end());
  }
  if (!lines.empty()) {
    const auto settings = database.ReadSegmentSettings(image_id);
    const auto segments = database.ReadSegments(image_id, *settings);
    for (const auto& [idx, id] : lines)
      sightings.matches.lines.push_back({segments->at(idx), model_.lines3D.at(id).line});
    sightings.lines.assign(lines.begin(), lines.end());
  }
  return sightings;
}

std::vector<DirectionSighting> FeaturesOfModel::PairDirections(
    const std::vector<ImageVanishingPoint>& vanishing_points) const {
  std::vector<const Group3D*> directions;
  for (const auto& [id, group] : model_.groups3D) {
    if (IsVanishingPoint(*group.type)) directions.push_back(&group);
  }
  std::stable_sort(directions.begin(), directions.end(), [](const Group3D* a, const Group3D* b) {
    return a->line3D_ids.size() > b->line3D_ids.size();
  });
  directions.resize(std::min(directions.size(), kMaxDirections));
  std::vector<const ImageVanishingPoint*> seen;
  for (const ImageVanishingPoint& point : vanishing_points) seen.push_back(&point);
  std::stable_sort(seen.begin(), seen.end(),
                   [](const ImageVanishingPoint* a, const ImageVanishingPoint* b) {
                     return a->num_segments > b->num_segments;
                   });
  seen.resize(std::min(seen.size(), kMaxVanishingPoints));
  std::vector<DirectionSighting> pairs;
  for (const ImageVanishingPoint* point : seen) {
    for (const Group3D* group : directions) {
      const Eigen::Map<const Eigen::Vector3d> direction(group->params.data());
      pairs.push_back({point->direction_in_cam.normalized(), direction.normalized()});
    }
  }
  return pairs;
}

}  // namespace holba
