// SPDX-License-Identifier: BSD-3-Clause
#include "apps/evaluate_geometry/geometry_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>

#include "holba/scene/selection.h"

namespace holba {
namespace {

using Json = nlohmann::ordered_json;

// {"1": a, "5": b}
Json ByThreshold(const std::vector<double>& thresholds, const std::vector<double>& values) {
  Json json = Json::object();
  for (size_t t = 0; t < thresholds.size(); ++t)
    json[fmt::format("{:g}", thresholds[t])] = values[t];
  return json;
}

Json ToJson(const PointSummary& points, const std::vector<double>& thresholds_mm) {
  return {{"count", points.count},
          {"median_mm", points.median_mm ? Json(*points.median_mm) : Json(nullptr)},
          {"inlier_percent", ByThreshold(thresholds_mm, points.inlier_percent)}};
}

Json ToJson(const LineSummary& lines, const std::vector<double>& thresholds_mm) {
  return {{"count", lines.count},
          {"length_m", lines.length_m},
          {"recall_m", ByThreshold(thresholds_mm, lines.recall_m)},
          {"precision_percent", ByThreshold(thresholds_mm, lines.precision_percent)}};
}

Json ToJson(const std::optional<ErrorStats>& stats, double factor = 1.0) {
  if (!stats) return nullptr;
  return {{"median", factor * stats->median},
          {"mean", factor * stats->mean},
          {"max", factor * stats->max}};
}

std::string OriginName(PointOrigin origin) {
  switch (origin) {
    case PointOrigin::kDetected:
      return "detected";
    case PointOrigin::kImported:
      return "imported";
    case PointOrigin::kJunction:
      return "junction";
    case PointOrigin::kCorner:
      return "corner";
  }
  return "";
}

Json PointsByOrigin(const std::vector<PointError>& points, const Reconstruction& model,
                    const std::vector<double>& thresholds_mm) {
  std::map<PointOrigin, std::vector<PointError>> of_origin;
  for (const PointError& point : points) {
    of_origin[model.points3D.at(point.point3D_id).origin].push_back(point);
  }
  Json json = Json::object();
  for (const auto& [origin, errors] : of_origin) {
    json[OriginName(origin)] = ToJson(SummarisePoints(errors, thresholds_mm), thresholds_mm);
  }
  return json;
}

Json ToJson(const EdgeErrors& edges, const std::vector<double>& thresholds_mm) {
  return {{"count", edges.num_edges},
          {"length_m", edges.edge_length_m},
          {"lines", edges.lines.size()},
          {"recall_m", ByThreshold(thresholds_mm, edges.recall_m)},
          {"recall_percent", ByThreshold(thresholds_mm, edges.recall_percent)},
          {"precision_percent", ByThreshold(thresholds_mm, edges.precision_percent)},
          {"angle_deg", ToJson(edges.angle_deg)},
          {"offset_mm", ToJson(edges.offset_m, 1000.0)}};
}

// "radius" in metres -> {"radius_mm", 1000}; angles keep their name.
std::pair<std::string, double> InPrintedUnit(const std::string& name, double metres_per_unit) {
  if (name.ends_with("_deg")) return {name, 1.0};
  return {name + "_mm", 1000.0 * metres_per_unit};
}

Json ToJson(const PrimitiveErrors& errors, const Reconstruction& model, const Reconstruction& truth,
            double metres_per_unit) {
  struct OfType {
    size_t num_true = 0, num_found = 0, num_extra = 0;
    std::map<std::string, std::vector<double>> errors;
  };
  std::map<int, OfType> types;  // by code
  std::map<int, std::string> names;
  const auto of_type = [&](const GroupType& type) -> OfType& {
    names[type.code] = std::string(type.name);
    return types[type.code];
  };
  for (const PrimitivePair& pair : errors.pairs) {
    OfType& type = of_type(*pair.type);
    ++type.num_true;
    ++type.num_found;
    for (const auto& [name, error] : pair.errors) {
      const auto [printed, factor] = InPrintedUnit(name, metres_per_unit);
      type.errors[printed].push_back(factor * error);
    }
    if (pair.radius_percent) type.errors["radius_percent"].push_back(*pair.radius_percent);
  }
  for (const group3D_t id : errors.missed) ++of_type(*truth.groups3D.at(id).type).num_true;
  for (const group3D_t id : errors.extra) ++of_type(*model.groups3D.at(id).type).num_extra;
  Json json = Json::object();
  for (const auto& [code, type] : types) {
    Json& entry = json[names[code]];
    entry = {{"true", type.num_true}, {"found", type.num_found}, {"extra", type.num_extra}};
    for (const auto& [name, values] : type.errors) entry[name] = ToJson(Summarise(values));
  }
  return json;
}

// "0.12 / 3.45 / 6.78" of the values of an object.
std::string Slashed(const Json& values, const char* format) {
  std::string text;
  for (const auto& [key, value] : values.items()) {
    if (!text.empty()) text += " / ";
    text += fmt::format(fmt::runtime(format), value.get<double>());
  }
  return text;
}

std::string Keys(const Json& values) {
  std::string text;
  for (const auto& [key, value] : values.items()) text += (text.empty() ? "" : " / ") + key;
  return text;
}

std::string PointLine(const std::string& name, const Json& points) {
  const Json& median = points["median_mm"];
  return fmt::format("{:<22} {:>8}   within {} mm: {} %, median {} mm\n", name,
                     points["count"].get<size_t>(), Keys(points["inlier_percent"]),
                     Slashed(points["inlier_percent"], "{:.1f}"),
                     median.is_null() ? "-" : fmt::format("{:.3f}", median.get<double>()));
}

std::string LineLine(const std::string& name, const Json& lines) {
  return fmt::format("{:<22} {:>8}   within {} mm: recall {} m, precision {} %\n", name,
                     lines["count"].get<size_t>(), Keys(lines["recall_m"]),
                     Slashed(lines["recall_m"], "{:.2f}"),
                     Slashed(lines["precision_percent"], "{:.1f}"));
}

std::string EdgeLine(const Json& edges) {
  std::string text =
      fmt::format("{:<22} {:>8}   within {} mm: recall {} % of {:.2f} m, precision {} %",
                  "true edges", edges["count"].get<size_t>(), Keys(edges["recall_percent"]),
                  Slashed(edges["recall_percent"], "{:.1f}"), edges["length_m"].get<double>(),
                  Slashed(edges["precision_percent"], "{:.1f}"));
  if (!edges["angle_deg"].is_null()) {
    text += fmt::format("; median angle {:.3f} deg, offset {:.3f} mm",
                        edges["angle_deg"]["median"].get<double>(),
                        edges["offset_mm"]["median"].get<double>());
  }
  return text + "\n";
}

std::string PrimitiveLines(const Json& primitives) {
  std::string text;
  for (const auto& [name, type] : primitives.items()) {
    text += fmt::format("{:<22} {:>8}   {} found, {} extra", name, type["true"].get<size_t>(),
                        type["found"].get<size_t>(), type["extra"].get<size_t>());
    for (const auto& [quantity, stats] : type.items()) {
      if (!stats.is_object()) continue;
      text += fmt::format("; {} median {:.3f}, max {:.3f}", quantity, stats["median"].get<double>(),
                          stats["max"].get<double>());
    }
    text += "\n";
  }
  return text;
}

}  // namespace

nlohmann::ordered_json GeometryToJson(const GeometryReport& report, const Reconstruction& model,
                                      const Reconstruction& truth, const GeometryOptions& options,
                                      const MultiViewOptions& multi_view) {
  const std::vector<double>& thresholds = options.thresholds_mm;
  Json json = Json::object();
  if (report.surface) {
    const auto& [points, lines] = *report.surface;
    json["points"] = ToJson(SummarisePoints(points, thresholds), thresholds);
    json["points_by_origin"] = PointsByOrigin(points, model, thresholds);
    json["lines"] = ToJson(SummariseLinesAsPaper(lines, thresholds.size()), thresholds);
    json["lines_limap"] = ToJson(
        SummariseLinesAsLimap(lines, thresholds.size(), options.limap_min_line_images), thresholds);
  }
  if (report.multi_view) {
    const MultiViewErrors& errors = *report.multi_view;
    const std::vector<double>& cm = multi_view.tolerances_cm;
    json["multi_view"] = {{"accuracy_percent", ByThreshold(cm, errors.accuracy_percent)},
                          {"completeness_percent", ByThreshold(cm, errors.completeness_percent)},
                          {"f1_percent", ByThreshold(cm, errors.f1_percent)}};
    Json& observed = json["multi_view"]["observed"];
    for (size_t t = 0; t < cm.size(); ++t) {
      observed[fmt::format("{:g}", cm[t])] = errors.num_observed[t];
    }
    json["multi_view"]["free_space"] = report.has_free_space;
  }
  if (report.edges) json["edges"] = ToJson(*report.edges, thresholds);
  if (report.primitives) {
    json["primitives"] = ToJson(*report.primitives, model, truth, options.metres_per_unit);
  }
  return json;
}

std::string GeometryToText(const nlohmann::ordered_json& json) {
  std::string text;
  if (json.contains("points")) {
    text += PointLine("points", json["points"]);
    for (const auto& [origin, points] : json["points_by_origin"].items()) {
      if (json["points_by_origin"].size() > 1) text += PointLine("  " + origin, points);
    }
    text += LineLine("lines", json["lines"]);
    text += LineLine("lines, as LIMAP counts", json["lines_limap"]);
  }
  if (json.contains("multi_view")) {
    const Json& errors = json["multi_view"];
    text += fmt::format("multi-view {}, within {} cm: accuracy {} %, completeness {} %, F1 {} %\n",
                        errors["free_space"].get<bool>() ? "with free space" : "without free space",
                        Keys(errors["f1_percent"]), Slashed(errors["accuracy_percent"], "{:.2f}"),
                        Slashed(errors["completeness_percent"], "{:.2f}"),
                        Slashed(errors["f1_percent"], "{:.2f}"));
  }
  if (json.contains("edges")) text += EdgeLine(json["edges"]);
  if (json.contains("primitives")) text += PrimitiveLines(json["primitives"]);
  return text;
}

}  // namespace holba
