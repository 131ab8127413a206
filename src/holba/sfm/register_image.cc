// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/register_image.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "holba/estimation/pose/absolute_pose.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/estimation/two_view/two_view_refinement.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/sfm/calibrated_pair.h"
#include "holba/sfm/filter_model.h"

namespace holba {
namespace {

struct ModelMatches {
  AbsolutePoseMatches sightings;
  // Of each sighting.
  std::vector<std::pair<point2D_t, point3D_t>> points;
  std::vector<std::pair<line2D_t, line3D_t>> lines;
};

// What of the model the features of an image match, each pair once.
ModelMatches FindModelMatches(image_t image_id, const MapperState& state) {
  const Reconstruction& model = state.model();
  const Image& image = model.unregistered_images.at(image_id);
  ModelMatches matches;
  std::vector<uint64_t> seen;  // by the feature at hand
  for (point2D_t idx = 0; idx < image.points2D.size(); ++idx) {
    seen.clear();
    for (const Correspondence& other : state.graph().CorrespondencesOf(image_id, idx)) {
      const Image* registered = model.images.Find(other.image_id);
      if (registered == nullptr) continue;
      const point3D_t id = registered->points2D[other.point2D_idx].point3D_id;
      if (id == kNoId || std::find(seen.begin(), seen.end(), id) != seen.end()) continue;
      seen.push_back(id);
      matches.points.emplace_back(idx, id);
      matches.sightings.points.push_back({image.points2D[idx].xy, model.points3D.at(id).xyz});
    }
  }
  for (line2D_t idx = 0; idx < state.graph().NumSegments(image_id); ++idx) {
    seen.clear();
    for (const LineCorrespondence& other : state.graph().LineCorrespondencesOf(image_id, idx)) {
      const Image* registered = model.images.Find(other.image_id);
      if (registered == nullptr) continue;
      const line3D_t id = registered->lines2D[other.line2D_idx].line3D_id;
      if (id == kNoId || std::find(seen.begin(), seen.end(), id) != seen.end()) continue;
      seen.push_back(id);
      matches.lines.emplace_back(idx, id);
      matches.sightings.lines.push_back({image.lines2D[idx].segment, model.lines3D.at(id).line});
    }
  }
  // Which vanishing point of the model an image's is, its matches of lines do not say surely: any
  // may be any.
  const auto features = state.input().features.find(image_id);
  if (features == state.input().features.end()) return matches;
  for (const auto& [id, group] : model.groups3D) {
    if (!IsVanishingPoint(*group.type)) continue;
    const Eigen::Vector3d in_world = Eigen::Vector3d(group.params.data()).normalized();
    for (const ImageVanishingPoint& vp : features->second.vanishing_points)
      matches.sightings.directions.push_back({vp.direction_in_cam, in_world});
  }
  return matches;
}

// Matches that agree with the pose become observations: each keypoint of one point, each point seen
// once.
void ObserveInliers(image_t image_id, const ModelMatches& matches, const AbsolutePose& pose,
                    MapperState* state) {
  const Image& image = state->model().images.at(image_id);
  std::set<point3D_t> points;
  for (size_t i = 0; i < matches.points.size(); ++i) {
    const auto& [idx, id] = matches.points[i];
    if (!pose.inliers.points[i] || image.points2D[idx].point3D_id != kNoId ||
        !points.insert(id).second)
      continue;
    state->Observe(id, PointObservation{image_id, idx});
  }
  for (size_t i = 0; i < matches.lines.size(); ++i) {
    const auto& [idx, id] = matches.lines[i];
    if (!pose.inliers.lines[i] || image.lines2D[idx].line3D_id != kNoId) continue;
    state->Observe(id, LineObservation{image_id, idx});
  }
}

void RegisterFrameOf(image_t image_id, const Rigid3d& cam_from_world, MapperState* state) {
  const Reconstruction& model = state->model();
  const Image& image = model.unregistered_images.at(image_id);
  state->RegisterFrame(image.frame_id, model.SensorFromRig(image).Inverse() * cam_from_world);
}

// A neighbour of the image in the model, and what its matches with the image say.
struct RelativeView {
  image_t image_id;
  MatchedRays rays;                   // neighbour first
  Eigen::Quaterniond rotation;        // of the image
  Eigen::Vector3d centre, direction;  // the image's centre is on this ray from the neighbour's
};

class StructureLess {
 public:
  StructureLess(const MapperOptions& options, image_t image_id, MapperState* state)
      : options_(options), image_id_(image_id), state_(*state), model_(state->model()) {}

  RegistrationReport Run() {
    RegistrationReport report;
    FindNeighbours();
    if (neighbours_.size() < 2) {
      report.failure = "it has relative poses to fewer than two images of the model";
      return report;
    }
    std::optional<std::pair<double, Rigid3d>> best;
    for (size_t a = 0; a < neighbours_.size(); ++a) {
      for (size_t b = 0; b < neighbours_.size(); ++b) {
        if (a == b) continue;
        const auto pose = PoseOf(neighbours_[a], neighbours_[b]);
        if (!pose) continue;
        const double gain = GainOfAll(*pose);
        if (!best || gain > best->first) best = {gain, *pose};
      }
    }
    if (!best) {
      report.failure = "its relative poses do not meet in one place";
      return report;
    }
    for (const RelativeView& view : neighbours_) {
      report.num_points += view.rays.size();
      report.num_point_inliers += Inliers(view, best->second).size();
    }
    const auto needed =
        2 * static_cast<size_t>(options_.registration.pose.abs_pose_min_num_inliers);
    if (report.num_point_inliers < needed ||
        static_cast<double>(report.num_point_inliers) <
            options_.registration.pose.abs_pose_min_inlier_ratio *
                static_cast<double>(report.num_points)) {
      report.failure = "too few of its matches agree with a pose";
      return report;
    }
    RegisterFrameOf(image_id_, best->second, &state_);
    report.accepted = true;
    return report;
  }

 private:
  // All pairs of them are tried.
  static constexpr size_t kMaxNeighbours = 8;
  // Rays that meet at less place the image by several times their own error of a degree or so.
  static constexpr double kMinMeetingAngleDeg = 2.0;

  void FindNeighbours() {
    const auto min_matches = static_cast<size_t>(options_.min_num_matches);
    std::vector<MatchedImage> matched;
    for (const MatchedImage& other : state_.graph().MatchedImages(image_id_)) {
      if (model_.images.contains(other.image_id) && other.num_matches >= min_matches)
        matched.push_back(other);
    }
    std::stable_sort(matched.begin(), matched.end(),
                     [](const auto& a, const auto& b) { return a.num_matches > b.num_matches; });
    if (matched.size() > kMaxNeighbours) matched.resize(kMaxNeighbours);
    const Image& image = model_.unregistered_images.at(image_id_);
    const Camera& camera = model_.cameras.at(image.camera_id);
    for (const MatchedImage& other : matched) {
      const Image& neighbour = model_.images.at(other.image_id);
      const Camera& of_neighbour = model_.cameras.at(neighbour.camera_id);
      std::vector<Eigen::Vector2d> pixels1, pixels2;
      for (const auto& [idx1, idx2] : state_.graph().MatchesBetween(other.image_id, image_id_)) {
        pixels1.push_back(neighbour.points2D[idx1].xy);
        pixels2.push_back(image.points2D[idx2].xy);
      }
      const TwoViewResult result = EstimateCalibratedPair(
          {.max_error_px = options_.initial.max_error_px, .random_seed = options_.random_seed},
          state_, other.image_id, image_id_);
      if (!result.geometry.cam2_from_cam1 ||
          !(result.geometry.cam2_from_cam1->translation.norm() > 0.0))
        continue;
      const Rigid3d& relative = *result.geometry.cam2_from_cam1;
      const Eigen::Quaterniond of_other = neighbour.cam_from_world.rotation.normalized();
      neighbours_.push_back({other.image_id, MatchedRays(of_neighbour, pixels1, camera, pixels2),
                             relative.rotation.normalized() * of_other,
                             neighbour.cam_from_world.OriginInA(),
                             of_other.conjugate() * relative.OriginInA().normalized()});
    }
  }

  // The rotation of the first, the centre where both rays come closest.
  static std::optional<Rigid3d> PoseOf(const RelativeView& a, const RelativeView& b) {
    const Eigen::Vector3d normal = a.direction.cross(b.direction);
    if (normal.norm() < std::sin(DegToRad(kMinMeetingAngleDeg))) return std::nullopt;
    const Eigen::Vector3d between = b.centre - a.centre;
    const double s = between.cross(b.direction).dot(normal) / normal.squaredNorm();
    const double u = between.cross(a.direction).dot(normal) / normal.squaredNorm();
    if (!(s > 0.0) || !(u > 0.0)) return std::nullopt;
    const Eigen::Vector3d centre = 0.5 * (a.centre + s * a.direction + b.centre + u * b.direction);
    return Rigid3d(a.rotation, -(a.rotation * centre));
  }

  Rigid3d Relative(const RelativeView& view, const Rigid3d& pose) const {
    return pose * model_.images.at(view.image_id).cam_from_world.Inverse();
  }

  double GainOfAll(const Rigid3d& pose) const {
    double gain = 0.0;
    for (const RelativeView& view : neighbours_) {
      gain += GainOf(TwoViewKind::kEssential, EssentialMatrix(Relative(view, pose)), view.rays,
                     options_.initial.max_error_px);
    }
    return gain;
  }

  std::vector<uint32_t> Inliers(const RelativeView& view, const Rigid3d& pose) const {
    const Rigid3d relative = Relative(view, pose);
    std::vector<uint32_t> inliers = InliersOf(TwoViewKind::kEssential, EssentialMatrix(relative),
                                              view.rays, options_.initial.max_error_px);
    const std::vector<uint8_t> in_front =
        AreInFront(relative, view.rays, options_.initial.max_error_px);
    std::erase_if(inliers, [&](uint32_t i) { return !in_front[i]; });
    return inliers;
  }

  const MapperOptions& options_;
  const image_t image_id_;
  MapperState& state_;
  const Reconstruction& model_;
  std::vector<RelativeView> neighbours_;
};

}  // namespace

RegistrationReport RegisterImage(const MapperOptions& options, image_t image_id,
                                 MapperState* state) {
  RegistrationReport report;
  const ModelMatches matches = FindModelMatches(image_id, *state);
  report.num_points = matches.points.size();
  report.num_lines = matches.lines.size();
  const camera_t camera_id = state->model().unregistered_images.at(image_id).camera_id;
  Camera& camera = state->mutable_model()->cameras.at(camera_id);
  // Other images of the camera have told its intrinsics.
  const bool is_first = state->NumRegistered(camera_id) == 0;
  AbsolutePoseOptions pose_options = options.registration.pose;
  pose_options.abs_pose_refine_focal_length =
      pose_options.abs_pose_refine_focal_length && is_first && options.global.refine_focal_length;
  pose_options.abs_pose_refine_extra_params =
      pose_options.abs_pose_refine_extra_params && is_first && options.global.refine_extra_params;
  const bool focal_is_known =
      !is_first || state->IsFocalLengthKnown(camera_id) || !options.global.refine_focal_length;
  const auto pose =
      EstimateAbsolutePose(pose_options, camera, focal_is_known, matches.sightings,
                           (static_cast<uint64_t>(options.random_seed) << 32) + image_id);
  if (!pose) {
    report.failure = "no pose that enough matches with the model agree with";
    return report;
  }
  report.num_point_inliers = pose->num_inliers.points;
  report.num_line_inliers = pose->num_inliers.lines;
  Camera refined = camera;
  refined.params = pose->params;
  if (is_first && !IsPlausible(options.filter, refined)) {
    report.failure = "the intrinsics that fit best are those of no lens";
    return report;
  }
  if (is_first) camera.params = refined.params;
  RegisterFrameOf(image_id, pose->cam_from_world, state);
  ObserveInliers(image_id, matches, *pose, state);
  report.accepted = true;
  return report;
}

RegistrationReport RegisterWithoutStructure(const MapperOptions& options, image_t image_id,
                                            MapperState* state) {
  return StructureLess(options, image_id, state).Run();
}

}  // namespace holba
