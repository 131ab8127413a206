// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/lines_from_segments.h"

#include <utility>

#include "holba/base/timer.h"
#include "holba/estimation/lines/line_scene.h"
#include "holba/estimation/lines/line_tracks.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

void SetSegments(const ImageFeatureMap& features, Reconstruction* model) {
  model->DeleteLines3D([](line3D_t, const Line3D&) { return true; });
  // Their ids begin with 1 again.
  model->lines3D = {};
  for (auto& [image_id, image] : model->images) {
    model->RemoveLines2D(image_id, [](line2D_t) { return true; });
    const auto found = features.find(image_id);
    if (found == features.end()) continue;
    for (const LineSegment2d& segment : found->second.segments) model->AddLine2D(image_id, segment);
  }
}

}  // namespace

LineReport BuildLines(const LineOptions& options, const ImageFeatureMap& features,
                      const LineMatchMap* matches, int num_threads, Reconstruction* model) {
  LineReport report;
  const Timer candidates_timer;
  SetSegments(features, model);
  const LineScene scene = MakeLineScene(options, *model, features, num_threads, &report.dropped);
  for (const auto& [image_id, image] : model->images) report.num_segments += image.lines2D.size();
  for (const SceneView& view : scene.views) {
    report.num_usable_segments += view.segments.size();
    report.mean_neighbours += static_cast<double>(view.neighbours.size()) / scene.views.size();
  }
  NodeCounts node_counts;
  const std::vector<std::vector<SegmentNode>> nodes =
      PlaceSegments(options, scene, matches, num_threads, &node_counts);
  report.num_candidates = node_counts.candidates;
  report.proposals = node_counts.proposals;
  report.best_proposals = node_counts.best;
  for (size_t placed : node_counts.best) report.num_placed_segments += placed;
  for (const auto& [reason, count] : node_counts.dropped) report.dropped[reason] += count;
  report.seconds_candidates = candidates_timer.Seconds();

  const Timer tracks_timer;
  TrackCounts track_counts;
  std::vector<LineTrack> tracks = JoinSegments(options, scene, nodes, &track_counts);
  report.num_tracks = tracks.size();
  RefineTracks(options, scene, num_threads, &tracks, &track_counts);
  report.num_merged = track_counts.merged;
  report.num_claimed = track_counts.claimed;
  report.num_held_to_direction = track_counts.held_to_direction;
  report.num_held_to_plane = track_counts.held_to_plane;
  for (const auto& [reason, count] : track_counts.dropped) report.dropped[reason] += count;

  std::vector<double> errors_px;
  for (const LineTrack& track : tracks) {
    std::vector<LineObservation> observations;
    std::vector<LineSupport> supports;
    for (const SegmentKey& key : track.members) {
      const SceneView& view = scene.views[key.view];
      const line2D_t idx = view.segments[key.segment].line2D_idx;
      observations.push_back({view.image_id, idx});
      supports.push_back(view.supports[key.segment]);
    }
    const line3D_t id = model->AddLine3D(track.line.Pluecker(), track.Start(), track.End(), observations);
    model->lines3D.at(id).error = track.rms_px;
    errors_px.push_back(track.rms_px);
    const auto uncertainty = UncertaintyOfFit(supports, LinePrior(), options.sigma_px, track.line,
                                              track.t_start, track.t_end);
    const bool reliable = uncertainty && uncertainty->RelativeSigma() < options.max_relative_sigma;
    const bool four = NumImages(track.members) >= 4;
    ++report.num_lines;
    report.num_lines_with_4_images += four;
    report.num_reliable += reliable;
    report.num_reliable_with_4_images += reliable && four;
    report.num_observations += track.members.size();
    if (track.direction >= 0) report.vp_of_line[id] = scene.direction_ids[track.direction];
    if (track.plane >= 0) report.plane_of_line[id] = scene.planes[track.plane].id;
  }
  report.median_error_px = Median(std::move(errors_px));
  report.seconds_tracks = tracks_timer.Seconds();
  return report;
}

}  // namespace holba
