// SPDX-License-Identifier: BSD-3-Clause
#include "apps/refine/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "apps/camera_choices.h"
#include "apps/report.h"
#include "holba/base/memory.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

using nlohmann::json;

// What the model holds, counted from the model itself.
struct ModelCounts {
  size_t lines_in_4_images = 0;
  std::map<std::string, size_t> groups;  // by type
  size_t points_on_planes = 0, lines_on_planes = 0, lines_with_vp = 0;
  size_t junctions = 0, corners = 0;
};

ModelCounts Count(const RefineOutput& output, const Reconstruction& model) {
  ModelCounts counts;
  for (const auto& [id, line] : model.lines3D) {
    std::set<image_t> images;
    for (const LineObservation& o : line.track) images.insert(o.image_id);
    counts.lines_in_4_images += images.size() >= 4;
  }
  std::set<point3D_t> on_planes;
  std::set<line3D_t> lines_on_planes, lines_with_vp;
  for (const auto& [id, group] : model.groups3D) {
    ++counts.groups[std::string(group.type->name)];
    if (IsPlane(*group.type)) {
      on_planes.insert(group.point3D_ids.begin(), group.point3D_ids.end());
      lines_on_planes.insert(group.line3D_ids.begin(), group.line3D_ids.end());
    }
    if (group.type->IsParallelism())
      lines_with_vp.insert(group.line3D_ids.begin(), group.line3D_ids.end());
  }
  counts.points_on_planes = on_planes.size();
  counts.lines_on_planes = lines_on_planes.size();
  counts.lines_with_vp = lines_with_vp.size();
  for (const Junction& junction : output.refine.structure.junctions.junctions)
    counts.junctions += model.points3D.contains(junction.point3D_id);
  for (point3D_t id : output.refine.structure.corners.point3D_ids)
    counts.corners += model.points3D.contains(id);
  return counts;
}

// Everything that was not taken, by step and reason, most frequent first in text.
std::map<std::string, std::map<std::string, size_t>> Refusals(const RefineOutput& output) {
  const StructureReport& s = output.refine.structure;
  std::map<std::string, std::map<std::string, size_t>> refusals;
  const auto add = [&](const char* step, const std::map<std::string, size_t>& dropped) {
    for (const auto& [reason, count] : dropped) {
      if (count) refusals[step][reason] = count;
    }
  };
  std::map<std::string, size_t> imports = output.detection.dropped;
  for (const auto& [reason, count] : output.matching.dropped) imports[reason] += count;
  add("import", imports);
  add("vanishing points", s.vps.dropped);
  add("planes", s.planes.dropped);
  add("planes among corners and junctions", s.small_planes.dropped);
  add("regions of images", output.regions.dropped);
  add("groups of regions", s.regions.dropped);
  add("lines", s.lines.dropped);
  add("lines of vanishing points", s.line_labels.dropped);
  add("lines on planes", s.plane_lines.dropped);
  add("points on planes", s.plane_points.dropped);
  add("members of groups", s.members.dropped);
  add("junctions", s.junctions.dropped);
  add("corners", s.corners.dropped);
  add("wireframe", s.wireframe.dropped);
  add("relations", s.relations.dropped);
  add("uncertain features", output.refine.reliability.reasons);
  add("associations that failed their test", output.refine.rejected);
  return refusals;
}

// Null: not asked for.
json PrincipalPointToJson(const RefineReport& report) {
  if (!report.principal_point) return nullptr;
  return {{"held", report.principal_point_held},
          {"cost_if_free", report.principal_point->mean},
          {"standard_error", report.principal_point->standard_error}};
}

std::string PrincipalPointToText(const RefineReport& report) {
  if (!report.principal_point_held) return "";
  return fmt::format(
      "principal points stay where they were: free, they would move too far or predict points left "
      "out "
      "worse ({:+.4f} +- {:.4f})\n",
      report.principal_point->mean, report.principal_point->standard_error);
}

}  // namespace

json RefineToJson(const RefineOutput& output, const Reconstruction& model) {
  const ModelCounts counts = Count(output, model);
  const StructureReport& s = output.refine.structure;
  const DetectionReport& d = output.detection;
  const MatchLinesReport& m = output.matching;
  json proposals = json::object();
  for (int kind = 0; kind < kNumProposalKinds; ++kind) {
    proposals[std::string(kProposalNames[kind])] = {{"made", s.lines.proposals[kind]},
                                                    {"best", s.lines.best_proposals[kind]}};
  }
  json left_out = json::array();
  for (const LeftOutPhotograph& photograph : d.left_out)
    left_out.push_back({{"image_id", photograph.image_id}, {"reason", photograph.reason}});
  return {{"images", d.num_images},
          {"photographs_left_out", left_out},
          {"database",
           {{"images_reused", d.images_reused},
            {"images_detected", d.num_images - d.images_reused},
            {"pairs_reused", m.pairs_reused},
            {"pairs_matched", m.num_pairs - m.pairs_reused}}},
          {"segments", d.num_segments},
          {"image_vanishing_points", d.num_vanishing_points},
          {"image_corners", d.num_corners},
          {"line_matches", m.num_line_matches},
          {"regions",
           {{"labelled", d.num_labelled_regions},
            {"groups2D", output.regions.num_groups2D},
            {"matches", output.regions.num_matches},
            {"groups3D", s.regions.formed_by_type}}},
          {"lines",
           {{"all", model.lines3D.size()},
            {"in_4_or_more_images", counts.lines_in_4_images},
            {"reliable_1_percent", s.lines.num_reliable_with_4_images},
            {"held_to_direction", s.lines.num_held_to_direction},
            {"held_to_plane", s.lines.num_held_to_plane},
            {"with_vanishing_point", counts.lines_with_vp},
            {"on_planes", counts.lines_on_planes},
            {"leave_one_out_median_px", output.leave_one_out.median_px},
            {"leave_one_out_share_below_1_px", output.leave_one_out.share_below_1_px},
            {"proposals", proposals}}},
          {"groups", counts.groups},
          {"points_on_planes", counts.points_on_planes},
          {"junctions", counts.junctions},
          {"corners", counts.corners},
          {"edges", model.wireframe.size()},
          {"relations", model.relations.size()},
          {"refused", Refusals(output)},
          {"shared_cameras", SharedCamerasToJson(output.refine.shared_cameras)},
          {"camera_models", CameraModelsToJson(output.refine.camera_models)},
          {"principal_point", PrincipalPointToJson(output.refine)},
          {"points_alone", SummaryToJson(output.refine.points_alone)},
          {"stage1", SummaryToJson(output.refine.stage1)},
          {"stage2", SummaryToJson(output.refine.stage2)},
          {"seconds",
           {{"detect", d.detect_seconds},
            {"match", m.match_seconds},
            {"structure", output.refine.structure_seconds},
            {"structure_steps", s.seconds},
            {"adjust", output.refine.adjust_seconds},
            {"write", output.write_seconds},
            {"total", output.total_seconds}}},
          {"peak_memory_mb", PeakMemoryMb()}};
}

std::string RefineToText(const RefineOutput& output, const Reconstruction& model) {
  const ModelCounts counts = Count(output, model);
  const StructureReport& s = output.refine.structure;
  const std::string vp_name(VanishingPointType().name);
  std::string text = fmt::format(
      "lines            {} ({} in 4 or more images, {} of these with ends known to 1 % of their "
      "depth)\n                 left-out images are predicted to {:.2f} px (median)\nvanishing "
      "points {} with {} lines\n",
      model.lines3D.size(), counts.lines_in_4_images, s.lines.num_reliable_with_4_images,
      output.leave_one_out.median_px,
      counts.groups.contains(vp_name) ? counts.groups.at(vp_name) : 0, counts.lines_with_vp);
  for (const auto& [type, count] : counts.groups) {
    if (type != vp_name) text += fmt::format("{:<16} {}\n", type, count);
  }
  text += fmt::format(
      "on planes        {} points, {} lines\n"
      "junctions        {}\n"
      "corners          {}\n"
      "wireframe edges  {}\n"
      "relations        {}\n",
      counts.points_on_planes, counts.lines_on_planes, counts.junctions, counts.corners,
      model.wireframe.size(), model.relations.size());
  if (!output.detection.left_out.empty()) {
    text += fmt::format("photographs left out {} of {}\n", output.detection.left_out.size(),
                        output.detection.num_images);
  }
  text += "\nNot taken, and why:\n";
  for (const auto& [step, reasons] : Refusals(output)) {
    text += fmt::format("  {}\n", step);
    std::vector<std::pair<size_t, std::string>> sorted;
    for (const auto& [reason, count] : reasons) sorted.emplace_back(count, reason);
    std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    for (const auto& [count, reason] : sorted) text += fmt::format("  {:>8}  {}\n", count, reason);
  }
  text += "\nLast adjustment of cameras, reliable features, groups and wireframe:\n" +
          CameraChoicesToText(output.refine.shared_cameras, output.refine.camera_models) +
          PrincipalPointToText(output.refine) + SummaryToText(output.refine.stage1);
  text += fmt::format(
      "\n{:.1f} s: detect {:.1f}, match {:.1f}, structure {:.1f}, adjust {:.1f}, write {:.1f}\n",
      output.total_seconds, output.detection.detect_seconds, output.matching.match_seconds,
      output.refine.structure_seconds, output.refine.adjust_seconds, output.write_seconds);
  return text;
}

}  // namespace holba
