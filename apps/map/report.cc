// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/report.h"

#include <fmt/format.h>

#include "holba/base/words.h"

namespace holba {
namespace {

nlohmann::json ToJson(const AdjustmentCounts& counts) {
  const double num_later =
      static_cast<double>(counts.num_iterations) - static_cast<double>(counts.num_adjustments);
  return {{"adjustments", counts.num_adjustments},
          {"iterations", counts.num_iterations},
          {"seconds", counts.seconds},
          {"ms_per_first_iteration",
           counts.num_adjustments > 0
               ? 1e3 * counts.first_iteration_seconds / static_cast<double>(counts.num_adjustments)
               : 0.0},
          {"ms_per_later_iteration",
           num_later > 0.0 ? 1e3 * counts.later_iteration_seconds / num_later : 0.0}};
}

double Ratio(double a, size_t b) { return b > 0 ? a / static_cast<double>(b) : 0.0; }

std::string Line(const char* name, const AdjustmentCounts& counts) {
  return fmt::format("  {}: {} of {:.1f} iterations and {:.1f} ms per iteration\n", name,
                     Counted(counts.num_adjustments, "adjustment"),
                     Ratio(static_cast<double>(counts.num_iterations), counts.num_adjustments),
                     1e3 * Ratio(counts.seconds, counts.num_iterations));
}

}  // namespace

MapOutput::OfModel CountsOf(const Reconstruction& model) {
  MapOutput::OfModel counts;
  counts.num_images = model.images.size();
  counts.num_points = model.points3D.size();
  counts.num_lines = model.lines3D.size();
  counts.num_groups = model.groups3D.size();
  double sum = 0.0;
  for (const auto& [id, point] : model.points3D) {
    counts.num_observations += point.track.size();
    sum += point.error * static_cast<double>(point.track.size());
  }
  counts.mean_error_px = Ratio(sum, counts.num_observations);
  return counts;
}

nlohmann::json MapToJson(const MapOutput& output) {
  nlohmann::json models = nlohmann::json::array();
  for (const MapOutput::OfModel& model : output.models) {
    const MapReport& map = model.map;
    models.push_back({{"images", model.num_images},
                      {"points", model.num_points},
                      {"observations", model.num_observations},
                      {"lines", model.num_lines},
                      {"groups", model.num_groups},
                      {"mean_error_px", model.mean_error_px},
                      {"initial_pair",
                       {{"image_id1", map.initial_pair.image_id1},
                        {"image_id2", map.initial_pair.image_id2},
                        {"inliers", map.initial_pair.num_inliers},
                        {"median_angle_deg", map.initial_pair.median_angle_deg}}},
                      {"registered_without_structure", map.num_registered_without_structure},
                      {"failed_registrations", map.num_failed_registrations},
                      {"joined_images", map.num_joined},
                      {"contradicted_images", map.num_contradicted},
                      {"points_created", map.points.created},
                      {"observations_continued", map.points.continued},
                      {"group_seconds", map.adjustments.group_seconds},
                      {"observations_filtered", map.adjustments.num_filtered},
                      {"local", ToJson(map.adjustments.local)},
                      {"global", ToJson(map.adjustments.global)},
                      {"seconds_by_stage", map.seconds},
                      {"seconds", map.total_seconds}});
  }
  nlohmann::json left_out = nlohmann::json::array();
  for (const auto& [name, reason] : output.left_out)
    left_out.push_back({{"name", name}, {"reason", reason}});
  return {{"images", output.num_images},
          {"models", std::move(models)},
          {"left_out", std::move(left_out)},
          {"initial_pairs_tried", output.initial_pairs.num_tried},
          {"initial_pairs_refused", output.initial_pairs.dropped},
          {"seconds",
           {{"read", output.read_seconds},
            {"map", output.map_seconds},
            {"refine", output.refine_seconds},
            {"total", output.total_seconds}}}};
}

std::string MapToText(const MapOutput& output) {
  std::string text;
  for (size_t i = 0; i < output.models.size(); ++i) {
    const MapOutput::OfModel& model = output.models[i];
    const MapReport& map = model.map;
    text += fmt::format("Model {}: {} of {} images, {} with {}, {}, {}, mean error {:.3f} px\n", i,
                        model.num_images, output.num_images, Counted(model.num_points, "point"),
                        Counted(model.num_observations, "observation"),
                        Counted(model.num_lines, "line"), Counted(model.num_groups, "group"),
                        model.mean_error_px);
    text += Line("local", map.adjustments.local) + Line("global", map.adjustments.global);
    text += "  seconds:";
    for (const auto& [stage, seconds] : map.seconds)
      text += fmt::format(" {} {:.2f},", stage, seconds);
    text.back() = '\n';
  }
  for (const auto& [name, reason] : output.left_out)
    text += fmt::format("  not in a model: {}: {}\n", name, reason);
  text += fmt::format("{:.1f} s: reading {:.1f}, mapping {:.1f}, refinement {:.1f}\n",
                      output.total_seconds, output.read_seconds, output.map_seconds,
                      output.refine_seconds);
  return text;
}

}  // namespace holba
