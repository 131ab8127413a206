// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/map_adjustment.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "holba/base/timer.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/gauge.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"
#include "holba/scene/views.h"
#include "holba/sfm/choose_cameras.h"
#include "holba/sfm/extend_structure.h"
#include "holba/sfm/filter_model.h"
#include "holba/sfm/selection_backup.h"
#include "holba/sfm/triangulate_lines.h"
#include "holba/sfm/triangulate_points.h"

namespace holba {
namespace {

// Rounds of adjusting all before the next image.
constexpr int kRoundsInBetween = 2;
// Fewer do not measure a scale.
constexpr size_t kMinDistances = 50;

}  // namespace

void AdjustmentCounts::Add(const SolverSummary& solver, double seconds_of_all) {
  ++num_adjustments;
  num_iterations += static_cast<size_t>(solver.iterations);
  seconds += seconds_of_all;
  if (solver.iteration_seconds.empty()) return;
  first_iteration_seconds += solver.iteration_seconds.front();
  later_iteration_seconds +=
      std::accumulate(solver.iteration_seconds.begin() + 1, solver.iteration_seconds.end(), 0.0);
}

MapAdjuster::MapAdjuster(const MapperOptions& options, const SolverOptions& solver,
                         MapperState* state)
    : options_(options), local_solver_(solver), global_solver_(solver), state_(*state) {
  local_solver_.max_num_iterations = options.local.max_num_iterations;
  global_solver_.max_num_iterations = options.global.max_num_iterations;
  local_solver_.function_tolerance = options.local.function_tolerance;
  global_solver_.function_tolerance = options.global.function_tolerance;
}

BundleOptions MapAdjuster::Bundle() const {
  BundleOptions bundle;
  bundle.config = ConfigOf(options_.structure);
  bundle.refine_focal_length = options_.global.refine_focal_length;
  bundle.refine_principal_point = options_.global.refine_principal_point;
  bundle.refine_extra_params = options_.global.refine_extra_params;
  bundle.refine_sensor_from_rig = options_.global.refine_sensor_from_rig;
  bundle[TermFamily::kPoint].loss = bundle[TermFamily::kLine].loss = LossChoice::kCauchy;
  bundle[TermFamily::kPoint].loss_scale = loss_scale_px_;
  bundle[TermFamily::kLine].loss_scale = line_loss_scale_px_;
  return bundle;
}

size_t MapAdjuster::NumObservations() const {
  size_t count = 0;
  for (const auto& [id, point] : state_.model().points3D) count += point.track.size();
  return count;
}

std::vector<image_t> MapAdjuster::ImagesAround(const std::vector<image_t>& image_ids) const {
  const Reconstruction& model = state_.model();
  // Points shared with each other image, and how many of the image's own there are.
  std::unordered_map<image_t, std::vector<point3D_t>> shared;
  size_t num_points = 0;
  for (const image_t id : image_ids) {
    for (const Point2D& point : model.images.at(id).points2D) {
      if (point.point3D_id == kNoId) continue;
      ++num_points;
      for (const PointObservation& other : model.points3D.at(point.point3D_id).track) {
        if (std::find(image_ids.begin(), image_ids.end(), other.image_id) == image_ids.end())
          shared[other.image_id].push_back(point.point3D_id);
      }
    }
  }
  std::vector<std::pair<size_t, image_t>> ranked;
  for (const auto& [id, points] : shared) ranked.emplace_back(points.size(), id);
  std::sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second < b.second;
  });
  const size_t wanted = static_cast<size_t>(
      std::max(0, options_.local.num_images - static_cast<int>(image_ids.size())));
  std::vector<image_t> chosen = image_ids;
  if (ranked.size() <= wanted) {
    for (const auto& [count, id] : ranked) chosen.push_back(id);
    return chosen;
  }
  // COLMAP's thresholds, from strict to lax: overlap by the number of points, and the angle in
  // degrees that three quarters of the shared points are seen under at most.
  struct Threshold {
    double angle_deg, overlap;
  };
  constexpr Threshold kThresholds[] = {{6.0, 0.6},       {6.0 / 1.5, 0.6}, {6.0 / 2.0, 0.5},
                                       {6.0 / 2.5, 0.4}, {6.0 / 3.0, 0.3}, {6.0 / 4.0, 0.2},
                                       {6.0 / 5.0, 0.1}, {6.0 / 6.0, 0.1}};
  const Eigen::Vector3d centre = model.CameraCentre(image_ids.front());
  std::unordered_map<image_t, double> angle_of;
  const auto angle_deg = [&](image_t id) {
    const auto known = angle_of.find(id);
    if (known != angle_of.end()) return known->second;
    const Eigen::Vector3d other = model.CameraCentre(id);
    std::vector<double> angles;
    for (const point3D_t point_id : shared.at(id)) {
      const Eigen::Vector3d& X = model.points3D.at(point_id).xyz;
      const double cosine = (X - centre).normalized().dot((X - other).normalized());
      angles.push_back(RadToDeg(std::acos(std::clamp(cosine, -1.0, 1.0))));
    }
    const size_t at = angles.size() * 3 / 4;
    std::nth_element(angles.begin(), angles.begin() + at, angles.end());
    return angle_of[id] = angles[at];
  };
  for (const Threshold& threshold : kThresholds) {
    for (const auto& [count, id] : ranked) {
      if (chosen.size() == image_ids.size() + wanted) return chosen;
      if (static_cast<double>(count) < threshold.overlap * static_cast<double>(num_points)) break;
      if (std::find(chosen.begin(), chosen.end(), id) != chosen.end()) continue;
      if (angle_deg(id) >= threshold.angle_deg) chosen.push_back(id);
    }
  }
  for (const auto& [count, id] : ranked) {
    if (chosen.size() == image_ids.size() + wanted) break;
    if (std::find(chosen.begin(), chosen.end(), id) == chosen.end()) chosen.push_back(id);
  }
  return chosen;
}

void MapAdjuster::HoldExisting(BundleSelection* selection, const BundleOptions& bundle) const {
  if (!options_.fix_existing_frames || state_.existing_frames.empty()) return;
  for (auto& frame : selection->frames)
    frame.constant = frame.constant || state_.existing_frames.contains(frame.id);
  selection->SetGauges(ChooseGaugesOfParts(state_.model(), bundle, *selection));
}

void MapAdjuster::FreeIntrinsicsOf(BundleSelection* selection, const BundleOptions& bundle) const {
  if (!bundle.refine_focal_length && !bundle.refine_principal_point && !bundle.refine_extra_params)
    return;
  std::unordered_map<frame_t, bool> is_constant;
  for (const auto& frame : selection->frames) is_constant[frame.id] = frame.constant;
  std::unordered_map<camera_t, size_t> num_moving;
  for (const auto& [id, image] : ImagesOf(state_.model(), *selection)) {
    if (!is_constant.at(image->frame_id)) ++num_moving[image->camera_id];
  }
  for (auto& camera : selection->cameras) {
    const auto found = num_moving.find(camera.id);
    camera.constant = found == num_moving.end() || found->second < state_.NumRegistered(camera.id);
  }
}

LocalSummary MapAdjuster::Adjust(const BundleOptions& bundle, const SolverOptions& solver,
                                 BundleSelection* selection) {
  Reconstruction& model = *state_.mutable_model();
  const bool moves_intrinsics = std::any_of(selection->cameras.begin(), selection->cameras.end(),
                                            [](const auto& camera) { return !camera.constant; });
  if (!moves_intrinsics) return AdjustLocal(bundle, solver, *selection, &workspace_, &model);
  const SelectionBackup backup(model, *selection);
  LocalSummary summary = AdjustLocal(bundle, solver, *selection, &workspace_, &model);
  bool is_wrong = false;
  for (auto& camera : selection->cameras) {
    if (camera.constant || IsPlausible(options_.filter, model.cameras.at(camera.id))) continue;
    camera.constant = is_wrong = true;
    ++report_.num_held_intrinsics;
  }
  if (!is_wrong) return summary;
  // The images do not determine them yet: a walk straight ahead, a plane.
  backup.Restore(&model);
  return AdjustLocal(bundle, solver, *selection, &workspace_, &model);
}

void MapAdjuster::AdjustAround(const std::vector<image_t>& image_ids) {
  for (int round = 0; round < options_.local.max_refinements; ++round) {
    const Timer timer;
    const BundleOptions bundle = Bundle();
    BundleSelection selection =
        BundleSelection::Around(state_.model(), bundle, ImagesAround(image_ids), AroundOptions());
    HoldExisting(&selection, bundle);
    FreeIntrinsicsOf(&selection, bundle);
    selection.HoldUncertainIntrinsics(state_.model(), bundle);
    const LocalSummary summary = Adjust(bundle, local_solver_, &selection);
    report_.local.Add(summary.solver, timer.Seconds());

    std::vector<point3D_t> points;
    size_t num_observations = 0;
    for (const auto& point : selection.points) {
      points.push_back(point.id);
      num_observations += state_.model().points3D.at(point.id).track.size();
    }
    const std::vector<point3D_t> modified = state_.TakeModifiedPoints();
    const PointChanges merged = MergeTracks(options_.triangulation, modified, &state_);
    PointChanges completed = CompleteTracks(options_.triangulation, modified, &state_);
    for (const image_t id : image_ids) {
      if (state_.model().images.contains(id))
        completed += TriangulateImage(options_.triangulation, id, &state_);
    }
    points.insert(points.end(), modified.begin(), modified.end());
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    const size_t num_filtered = FilterPoints(options_.filter, points, &state_);
    report_.num_merged += merged.merged;
    report_.num_completed += completed.Observations();
    report_.num_filtered += num_filtered;
    std::vector<line3D_t> lines;
    for (const auto& line : selection.lines) lines.push_back(line.id);
    UpdateLines(image_ids, std::move(lines));
    const double changed =
        static_cast<double>(merged.Observations() + completed.Observations() + num_filtered);
    if (changed <= options_.local.max_refinement_change * static_cast<double>(num_observations))
      break;
  }
}

size_t MapAdjuster::UpdateLines(const std::vector<image_t>& image_ids,
                                std::vector<line3D_t> line_ids) {
  if (!HasLines()) return 0;
  const LineOptions& options = options_.structure_options.lines;
  LineChanges changes;
  for (const image_t id : image_ids) {
    if (!state_.model().images.contains(id)) continue;
    changes += TriangulateLines(options, id, &state_);
    for (const Line2D& line : state_.model().images.at(id).lines2D) {
      if (line.line3D_id != kNoId) line_ids.push_back(line.line3D_id);
    }
  }
  std::sort(line_ids.begin(), line_ids.end());
  line_ids.erase(std::unique(line_ids.begin(), line_ids.end()), line_ids.end());
  changes += MergeLines(options, line_ids, &state_);
  const size_t num_filtered = FilterLines(options, line_ids, &state_);
  report_.num_lines_continued += changes.continued;
  report_.num_lines_merged += changes.merged;
  report_.num_lines_filtered += num_filtered;
  if (options_.structure >= MapperStructure::kGroups)
    LabelNewLines(options_.structure_options, line_ids, &state_);
  return 2 * changes.created + changes.continued + changes.merged + num_filtered;
}

void MapAdjuster::AdjustOnce() {
  const Timer timer;
  const BundleOptions bundle = Bundle();
  BundleSelection selection = BundleSelection::Everything(state_.model(), bundle);
  HoldExisting(&selection, bundle);
  selection.HoldUncertainIntrinsics(state_.model(), bundle);
  if (selection.points.empty() && selection.lines.empty()) return;
  const LocalSummary summary = Adjust(bundle, global_solver_, &selection);
  report_.global.Add(summary.solver, timer.Seconds());
}

void MapAdjuster::MeasureNoise() {
  const auto sigma = MeasurePointSigmaPx(state_.model(), ViewMap(state_.model()));
  if (sigma) loss_scale_px_ = std::clamp(2.0 * *sigma, 0.1, options_.filter.max_error_px);
  if (!HasLines() || state_.model().lines3D.empty()) return;
  // Each segment has two distances; four of a line are its own unknowns.
  ViewCache views(state_.model());
  std::vector<double> distances_px;
  for (const auto& [id, line] : state_.model().lines3D) {
    const double redundancy = 1.0 - 4.0 / (2.0 * static_cast<double>(line.track.size()));
    if (!(redundancy > 0.0)) continue;
    for (const LineObservation& observation : line.track) {
      const IdealView& view = views.Of(observation.image_id);
      const auto ideal = view.ToIdeal(
          state_.model().images.at(observation.image_id).lines2D[observation.line2D_idx].segment);
      const auto image = view.Project(line.line);
      if (!ideal || !image) continue;
      for (const Eigen::Vector2d& end : {ideal->start, ideal->end})
        distances_px.push_back(std::abs(image->dot(end.homogeneous())) / std::sqrt(redundancy));
    }
  }
  if (distances_px.size() < kMinDistances) return;
  const double line_sigma = kSigmaPerMedian * Median(std::move(distances_px));
  line_loss_scale_px_ = std::clamp(2.0 * line_sigma, 0.1, options_.filter.max_error_px);
}

std::vector<image_t> MapAdjuster::AdjustAll(bool is_last) {
  const Reconstruction& model = state_.model();
  const auto all_points = [&] {
    std::vector<point3D_t> ids;
    for (const auto& [id, point] : model.points3D) ids.push_back(id);
    return ids;
  };
  const auto complete_and_merge = [&] {
    PointChanges changes = CompleteTracks(options_.triangulation, all_points(), &state_);
    changes += MergeTracks(options_.triangulation, all_points(), &state_);
    report_.num_completed += changes.completed;
    report_.num_merged += changes.merged;
    return changes.Observations();
  };
  const size_t num_frames = model.frames.size();
  if (num_frames >= options_.global.min_images_for_cameras &&
      static_cast<double>(num_frames) >= (is_last ? 1.0 : options_.global.cameras_ratio) *
                                             static_cast<double>(frames_at_cameras_) &&
      num_frames != frames_at_cameras_) {
    frames_at_cameras_ = num_frames;
    ChooseCameras(options_, global_solver_, &state_);
  }
  complete_and_merge();
  report_.num_retriangulated += Retriangulate(options_.triangulation, &state_).Observations();
  const int max_refinements = is_last ? options_.global.max_refinements
                                      : std::min(kRoundsInBetween, options_.global.max_refinements);
  for (int round = 0; round < max_refinements; ++round) {
    MeasureNoise();
    AdjustOnce();
    size_t num_changed = complete_and_merge();
    const size_t num_filtered = FilterAllPoints(options_.filter, &state_);
    report_.num_filtered += num_filtered;
    num_changed += num_filtered;
    if (HasLines()) {
      std::vector<line3D_t> lines;
      for (const auto& [id, line] : model.lines3D) lines.push_back(id);
      num_changed += UpdateLines({}, std::move(lines));
    }
    const auto num_observations = static_cast<double>(NumObservations());
    if (static_cast<double>(num_changed) <=
        options_.global.max_refinement_change * num_observations)
      break;
  }
  state_.TakeModifiedPoints();
  // Better poses may bring together what was apart; and what was tried is no part of a snapshot.
  state_.line_merges_tried.clear();
  if (static_cast<double>(model.frames.size()) >=
      options_.global.groups_ratio * static_cast<double>(frames_at_groups_)) {
    const Timer group_timer;
    RebuildGroups(options_, &state_);
    report_.group_seconds += group_timer.Seconds();
    frames_at_groups_ = model.frames.size();
  }
  std::vector<image_t> removed = FilterFrames(options_.filter, &state_);
  frames_at_global_ = model.frames.size();
  points_at_global_ = model.points3D.size();
  return removed;
}

bool MapAdjuster::IsGlobalDone() const { return state_.model().frames.size() == frames_at_global_; }

bool MapAdjuster::IsGlobalDue() const {
  if (state_.model().images.size() <= static_cast<size_t>(options_.local.num_images)) return false;
  const auto grown = [](size_t now, size_t before, double ratio, int freq) {
    return static_cast<double>(now) >= ratio * static_cast<double>(before) ||
           now >= before + static_cast<size_t>(freq);
  };
  const GlobalAdjustmentOptions& global = options_.global;
  return grown(state_.model().frames.size(), frames_at_global_, global.frames_ratio,
               global.frames_freq) ||
         grown(state_.model().points3D.size(), points_at_global_, global.points_ratio,
               global.points_freq);
}

}  // namespace holba
