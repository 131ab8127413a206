// SPDX-License-Identifier: BSD-3-Clause
#include "apps/map/report.h"

#include <fmt/format.h>

#include "holba/base/words.h"

namespace holba {
namespace {

double Ratio(double a, double b) { return b > 0.0 ? a / b : 0.0; }

// The first iteration of an adjustment analyses the problem, later ones only factorise.
struct PerIteration {
  explicit PerIteration(const AdjustmentCounts& counts) {
    const auto adjustments = static_cast<double>(counts.num_adjustments);
    const auto iterations = static_cast<double>(counts.num_iterations);
    iterations_per_adjustment = Ratio(iterations, adjustments);
    first_ms = 1e3 * Ratio(counts.first_iteration_seconds, adjustments);
    later_ms = 1e3 * Ratio(counts.later_iteration_seconds, iterations - adjustments);
    mean_ms = 1e3 * Ratio(counts.seconds, iterations);
  }
  double iterations_per_adjustment, first_ms, later_ms, mean_ms;
};

nlohmann::json ToJson(const AdjustmentCounts& counts) {
  const PerIteration per(counts);
  return {{"adjustments", counts.num_adjustments},
          {"iterations", counts.num_iterations},
          {"iterations_per_adjustment", per.iterations_per_adjustment},
          {"seconds", counts.seconds},
          {"ms_per_iteration", per.mean_ms},
          {"ms_per_first_iteration", per.first_ms},
          {"ms_per_later_iteration", per.later_ms}};
}

nlohmann::json ToJson(const PositionAlignment& alignment) {
  nlohmann::json json = {{"positions", alignment.num_positions},
                         {"left_out", alignment.num_left_out},
                         {"median_error", alignment.median_error},
                         {"moved", alignment.why_not.empty()}};
  if (!alignment.why_not.empty()) json["reason"] = alignment.why_not;
  if (alignment.why_not.empty()) json["scale"] = alignment.scale;
  if (alignment.origin) {
    json["latitude_longitude_altitude"] = {alignment.origin->x(), alignment.origin->y(),
                                           alignment.origin->z()};
  }
  return json;
}

// The paper's table of runtime and reconstruction, a row for each model.
std::string MapTable(const MapOutput& output) {
  std::string text =
      fmt::format("{:>5} {:>11} {:>8} {:>8} {:>9} {:>7} {:>7} {:>9}\n", "model", "images",
                  "minutes", "points", "observed", "lines", "groups", "error px");
  for (size_t i = 0; i < output.models.size(); ++i) {
    const MapOutput::OfModel& model = output.models[i];
    text += fmt::format("{:>5} {:>11} {:>8.2f} {:>8} {:>9} {:>7} {:>7} {:>9.3f}\n", i,
                        fmt::format("{} / {}", model.num_images, output.num_images),
                        model.map.total_seconds / 60.0, model.num_points, model.num_observations,
                        model.num_lines, model.num_groups, model.mean_error_px);
  }
  text += fmt::format("\n{:>5} {:>11} {:>8} {:>8} {:>9} {:>7} {:>7}\n", "model", "adjustments",
                      "number", "seconds", "iter./adj", "ms 1st", "ms then");
  for (size_t i = 0; i < output.models.size(); ++i) {
    const AdjustmentReport& report = output.models[i].map.adjustments;
    for (const auto& [name, counts] :
         {std::pair("local", &report.local), std::pair("global", &report.global)}) {
      const PerIteration per(*counts);
      text += fmt::format("{:>5} {:>11} {:>8} {:>8.2f} {:>9.1f} {:>7.1f} {:>7.1f}\n", i, name,
                          counts->num_adjustments, counts->seconds, per.iterations_per_adjustment,
                          per.first_ms, per.later_ms);
    }
  }
  return text + "\n";
}

std::string AlignmentText(const PositionAlignment& alignment) {
  if (!alignment.why_not.empty()) {
    return fmt::format("  not moved to the positions of {}: {} (median error {:.3g})\n",
                       Counted(alignment.num_positions, "image"), alignment.why_not,
                       alignment.median_error);
  }
  std::string text = fmt::format(
      "  moved to the positions of {} ({} left out), median error {:.3g}",
      Counted(alignment.num_positions, "image"), alignment.num_left_out, alignment.median_error);
  if (alignment.origin) {
    text += fmt::format(" m; east, north and up about {:.7f}, {:.7f}, {:.2f} m",
                        alignment.origin->x(), alignment.origin->y(), alignment.origin->z());
  }
  return text + "\n";
}

}  // namespace

void CountModel(const Reconstruction& model, MapOutput::OfModel* output) {
  MapOutput::OfModel& counts = *output;
  counts.num_images = model.images.size();
  counts.num_points = model.points3D.size();
  counts.num_lines = model.lines3D.size();
  counts.num_groups = model.groups3D.size();
  double sum = 0.0;
  for (const auto& [id, point] : model.points3D) {
    counts.num_observations += point.track.size();
    sum += point.error * static_cast<double>(point.track.size());
  }
  counts.mean_error_px = Ratio(sum, static_cast<double>(counts.num_observations));
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
    if (model.alignment) models.back()["positions"] = ToJson(*model.alignment);
  }
  nlohmann::json left_out = nlohmann::json::array();
  for (const auto& [name, reason] : output.left_out)
    left_out.push_back({{"name", name}, {"reason", reason}});
  nlohmann::json continued;  // null: a model was begun
  if (output.continued) {
    continued = {{"images", output.continued->num_images},
                 {"points", output.continued->num_points},
                 {"observations", output.continued->num_observations},
                 {"observations_left_out", output.continued->num_foreign_observations},
                 {"points_left_out", output.continued->num_points_left_out},
                 {"structure_built_anew", output.continued->num_lines_and_groups_left_out}};
  }
  return {{"images", output.num_images},
          {"continued", std::move(continued)},
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
  if (output.continued) {
    text += fmt::format("Continued: {} with {}\n\n", Counted(output.continued->num_images, "image"),
                        Counted(output.continued->num_points, "point"));
  }
  text += MapTable(output);
  for (size_t i = 0; i < output.models.size(); ++i) {
    const MapOutput::OfModel& model = output.models[i];
    text += fmt::format("Model {}, seconds:", i);
    for (const auto& [stage, seconds] : model.map.seconds)
      text += fmt::format(" {} {:.2f},", stage, seconds);
    text.back() = '\n';
    if (model.alignment) text += AlignmentText(*model.alignment);
  }
  for (const auto& [name, reason] : output.left_out)
    text += fmt::format("Not in a model: {}: {}\n", name, reason);
  text += fmt::format("{:.1f} s: reading {:.1f}, mapping {:.1f}, refinement {:.1f}\n",
                      output.total_seconds, output.read_seconds, output.map_seconds,
                      output.refine_seconds);
  return text;
}

}  // namespace holba
