// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/scene_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

constexpr double kMinDepth = 0.5;
constexpr double kMinSegmentPx = 15.0;  // as detectors of segments have it
constexpr size_t kFeaturesOfTask = 256;

double FocalPx(const Camera& camera) {
  const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
  return std::sqrt(k.fx * k.fy);
}

std::vector<Eigen::Vector3d> Centres(const PhotoScene& scene) {
  std::vector<Eigen::Vector3d> centres;
  for (const Rigid3d& pose : scene.cam_from_world) centres.push_back(pose.OriginInA());
  return centres;
}

std::vector<double> FocalsOfViews(const PhotoScene& scene) {
  std::vector<double> focals;
  for (const uint32_t camera : scene.camera_of_view)
    focals.push_back(FocalPx(scene.cameras[camera]));
  return focals;
}

// Whether the segment from a to b meets the inside of the box (slabs).
bool Meets(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  double enter = 0.0, leave = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double d = b[k] - a[k];
    if (d == 0.0) {
      if (a[k] <= box.min()[k] || a[k] >= box.max()[k]) return false;
      continue;
    }
    const double t1 = (box.min()[k] - a[k]) / d, t2 = (box.max()[k] - a[k]) / d;
    enter = std::max(enter, std::min(t1, t2));
    leave = std::min(leave, std::max(t1, t2));
  }
  return enter < leave;
}

class Viewer {
 public:
  Viewer(const PhotoScene& scene, const VisibilityOptions& options)
      : scene_(scene),
        options_(options),
        min_cosine_(std::cos(DegToRad(options.max_view_angle_deg))),
        centres_(Centres(scene)),
        focal_px_(FocalsOfViews(scene)) {
    for (const Rigid3d& pose : scene.cam_from_world) rotations_.push_back(pose.RotationMatrix());
  }

  std::vector<SeenPixel> SeePoint(size_t point, Random* random) const {
    const Eigen::Vector3d& X = scene_.content.structure.points[point];
    std::vector<SeenPixel> seen;
    for (uint32_t view = 0; view < centres_.size(); ++view) {
      if (!IsTurnedTo(view, X, scene_.content.point_normals[point])) continue;
      if (!HasRightSize(view, X, scene_.content.point_sizes[point])) continue;
      const auto pixel = Project(view, X);
      if (pixel && !IsHidden(view, X, scene_.content.point_normals[point]))
        seen.push_back({view, *pixel});
    }
    return Choose(X, scene_.content.point_favourites[point], std::move(seen), random);
  }

  std::vector<SeenSegment> SeeLine(size_t line, Random* random) const {
    const Segment3d& ends = scene_.content.structure.segments[line];
    const Eigen::Vector3d& normal = scene_.content.segment_normals[line];
    const Eigen::Vector3d middle = 0.5 * (ends[0] + ends[1]);
    std::vector<SeenSegment> seen;
    for (uint32_t view = 0; view < centres_.size(); ++view) {
      if (!IsTurnedTo(view, middle, normal)) continue;
      if (const auto segment = VisiblePart(view, ends, normal)) seen.push_back({view, *segment});
    }
    return Choose(middle, scene_.content.segment_favourites[line], std::move(seen), random);
  }

 private:
  bool IsTurnedTo(uint32_t view, const Eigen::Vector3d& X, const Eigen::Vector3d& normal) const {
    const Eigen::Vector3d to_camera = centres_[view] - X;
    const double along = normal.dot(to_camera);
    return along > 0.0 && along * along > min_cosine_ * min_cosine_ * to_camera.squaredNorm();
  }

  bool HasRightSize(uint32_t view, const Eigen::Vector3d& X, double size) const {
    if (size == 0.0) return true;
    const double depth = rotations_[view].row(2).dot(X - centres_[view]);
    if (depth < kMinDepth) return false;
    const double size_px = focal_px_[view] * size / depth;
    return size_px >= options_.min_size_px && size_px <= options_.max_size_px;
  }

  // Inside of the image. Distortion far outside of it would fold points back into it.
  std::optional<Eigen::Vector2d> Project(uint32_t view, const Eigen::Vector3d& X) const {
    const Camera& camera = scene_.cameras[scene_.camera_of_view[view]];
    const Eigen::Vector3d in_cam = rotations_[view] * (X - centres_[view]);
    const double width = static_cast<double>(camera.width);
    const double height = static_cast<double>(camera.height);
    const double reach = 0.6 * (width + height) / focal_px_[view] * in_cam.z();
    if (in_cam.z() < kMinDepth || std::abs(in_cam.x()) > reach || std::abs(in_cam.y()) > reach)
      return std::nullopt;
    Eigen::Vector2d pixel;
    if (!camera.model->project(camera.params.data(), in_cam, &pixel)) return std::nullopt;
    if (!(pixel.minCoeff() > 0.0 && pixel.x() < width && pixel.y() < height)) return std::nullopt;
    return pixel;
  }

  bool IsHidden(uint32_t view, const Eigen::Vector3d& X, const Eigen::Vector3d& normal) const {
    constexpr double kClearance = 0.05;  // from the wall that the feature is on
    const Eigen::Vector3d before = X + kClearance * normal;
    return std::any_of(scene_.boxes.begin(), scene_.boxes.end(),
                       [&](const auto& box) { return Meets(box, centres_[view], before); });
  }

  // The longest run of visible ones of nine places along the line.
  std::optional<LineSegment2d> VisiblePart(uint32_t view, const Segment3d& ends,
                                           const Eigen::Vector3d& normal) const {
    constexpr int kNumSteps = 8;
    std::array<std::optional<Eigen::Vector2d>, kNumSteps + 1> pixels;
    for (int k = 0; k <= kNumSteps; ++k) {
      const Eigen::Vector3d X = ends[0] + (ends[1] - ends[0]) * k / kNumSteps;
      pixels[k] = Project(view, X);
      if (pixels[k] && IsHidden(view, X, normal)) pixels[k].reset();
    }
    int best_begin = 0, best_length = 0;
    for (int begin = 0; begin <= kNumSteps; ++begin) {
      int end = begin;
      while (end <= kNumSteps && pixels[end]) ++end;
      if (end - begin > best_length) {
        best_begin = begin;
        best_length = end - begin;
      }
      begin = std::max(begin, end);
    }
    if (best_length < 2) return std::nullopt;
    const LineSegment2d part{*pixels[best_begin], *pixels[best_begin + best_length - 1]};
    if (part.Length() < kMinSegmentPx) return std::nullopt;
    return part;
  }

  // Of the views that could see X those of a track, some of which miss it.
  template <typename Sighting>
  std::vector<Sighting> Choose(const Eigen::Vector3d& X, const Eigen::Vector3d& favourite,
                               std::vector<Sighting> seen, Random* random) const {
    if (seen.size() < 2) return seen;
    const double u = 1.0 - random->Uniform();
    const double further = std::max(options_.mean_track_length - 2.0, 1e-6);
    const double length = 2.0 + std::log(u) / std::log(further / (1.0 + further));
    const double wanted = std::min(length, static_cast<double>(options_.max_track_length));
    const size_t pool = std::max<size_t>(2, static_cast<size_t>(wanted / options_.detection_rate));
    if (seen.size() > pool) {
      const uint32_t anchor = BestView(X, favourite, seen);
      std::vector<std::pair<double, size_t>> by_difference;
      for (size_t i = 0; i < seen.size(); ++i)
        by_difference.emplace_back(Difference(anchor, seen[i].view, X), i);
      std::nth_element(by_difference.begin(), by_difference.begin() + static_cast<long>(pool),
                       by_difference.end());
      by_difference.resize(pool);
      std::sort(by_difference.begin(), by_difference.end(),
                [](const auto& a, const auto& b) { return a.second < b.second; });
      std::vector<Sighting> nearest;
      for (const auto& [difference, i] : by_difference) nearest.push_back(seen[i]);
      seen = std::move(nearest);
    }
    std::erase_if(seen,
                  [&](const Sighting&) { return random->Uniform() >= options_.detection_rate; });
    return seen;
  }

  template <typename Sighting>
  uint32_t BestView(const Eigen::Vector3d& X, const Eigen::Vector3d& favourite,
                    const std::vector<Sighting>& seen) const {
    const auto cosine = [&](const Sighting& s) {
      return favourite.dot((centres_[s.view] - X).normalized());
    };
    return std::max_element(seen.begin(), seen.end(),
                            [&](const auto& a, const auto& b) { return cosine(a) < cosine(b); })
        ->view;
  }

  // How different X looks: angle between the rays in radians, logarithm of the ratio of scales.
  double Difference(uint32_t view1, uint32_t view2, const Eigen::Vector3d& X) const {
    const Eigen::Vector3d ray1 = X - centres_[view1], ray2 = X - centres_[view2];
    const double distance1 = ray1.norm(), distance2 = ray2.norm();
    const double angle = std::atan2(ray1.cross(ray2).norm(), ray1.dot(ray2));
    const double scale = std::log(focal_px_[view1] * distance2 / (focal_px_[view2] * distance1));
    return angle * angle + scale * scale;
  }

  const PhotoScene& scene_;
  const VisibilityOptions& options_;
  const double min_cosine_;
  const std::vector<Eigen::Vector3d> centres_;
  const std::vector<double> focal_px_;
  std::vector<Eigen::Matrix3d> rotations_;
};

// Every feature draws from a stream of its own, so that threads may take them in any order.
template <typename Track, typename SeeOne>
std::vector<Track> SeeAll(size_t num_features, uint64_t seed, int num_threads,
                          const SeeOne& see_one) {
  std::vector<Track> tracks(num_features);
  const size_t num_tasks = (num_features + kFeaturesOfTask - 1) / kFeaturesOfTask;
  ParallelTasks(num_threads, num_tasks, [&](size_t task) {
    const size_t end = std::min(num_features, (task + 1) * kFeaturesOfTask);
    for (size_t i = task * kFeaturesOfTask; i < end; ++i) {
      Random random(seed + 0x9e3779b97f4a7c15ULL * (i + 1));
      tracks[i] = see_one(i, &random);
    }
  });
  return tracks;
}

}  // namespace

void VisibilityOptions::Describe(OptionTable* table) const {
  table->Field("mean_track_length", &mean_track_length, Between(3, 1000),
               "Mean number of images that a feature is found in, where so many could see it.");
  table->Field("max_track_length", &max_track_length, AtLeast(3),
               "Most images that a feature is found in.");
  table->Field("max_view_angle_deg", &max_view_angle_deg, Between(10, 89),
               "Most oblique view in which a feature is found, from the normal of its surface.");
  table->Field("min_size_px", &min_size_px, GreaterThan(0),
               "Size in the image below which a point of street or collection is not found.");
  table->Field("max_size_px", &max_size_px, GreaterThan(0),
               "Size in the image above which a point of street or collection is not found.");
  table->Field("detection_rate", &detection_rate, Between(0.05, 1),
               "Share of the views of a track in which the feature is found.");
}

size_t SceneViews::NumPointSightings() const {
  size_t count = 0;
  for (const auto& track : points) count += track.size();
  return count;
}

SceneViews See(const PhotoScene& scene, const VisibilityOptions& options, uint64_t seed,
               int num_threads) {
  const Viewer viewer(scene, options);
  const SyntheticStructure& structure = scene.content.structure;
  SceneViews sightings;
  sightings.points = SeeAll<std::vector<SeenPixel>>(
      structure.points.size(), seed, num_threads,
      [&](size_t i, Random* random) { return viewer.SeePoint(i, random); });
  sightings.lines = SeeAll<std::vector<SeenSegment>>(
      structure.segments.size(), ~seed, num_threads,
      [&](size_t i, Random* random) { return viewer.SeeLine(i, random); });
  return sightings;
}

Likeness::Likeness(const PhotoScene& scene, double max_angle_deg, double max_scale)
    : min_cosine_(std::cos(DegToRad(max_angle_deg))),
      max_scale_(max_scale),
      centres_(Centres(scene)),
      focal_px_(FocalsOfViews(scene)) {}

bool Likeness::LookAlike(uint32_t view1, const Eigen::Vector3d& X1, uint32_t view2,
                         const Eigen::Vector3d& X2, const Eigen::Matrix3d& turn2_from_1) const {
  const Eigen::Vector3d ray1 = turn2_from_1 * (X1 - centres_[view1]), ray2 = X2 - centres_[view2];
  const double distance1 = ray1.norm(), distance2 = ray2.norm();
  if (ray1.dot(ray2) < min_cosine_ * distance1 * distance2) return false;
  const double scale = focal_px_[view1] * distance2 / (focal_px_[view2] * distance1);
  return scale < max_scale_ && scale * max_scale_ > 1.0;
}

}  // namespace holba
