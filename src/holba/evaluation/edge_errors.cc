// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/edge_errors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "holba/base/threads.h"
#include "holba/evaluation/group_comparison.h"
#include "holba/evaluation/nearest_distance.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

// The share of a segment's samples that is within each threshold of the others.
std::vector<double> SharesAlong(const Edge& segment, const NearestDistance& others,
                                const GeometryOptions& geometry, double min_cosine) {
  std::vector<size_t> count(geometry.thresholds_mm.size(), 0);
  const Eigen::Vector3d direction = (segment[1] - segment[0]).normalized();
  std::vector<Eigen::Vector3d> samples;
  AppendSamples(segment[0], segment[1], geometry.num_samples, &samples);
  for (const Eigen::Vector3d& x : samples) {
    const auto nearest = others.Along(x, direction, min_cosine);
    if (!nearest) continue;
    for (size_t t = 0; t < count.size(); ++t) {
      const double distance_m = geometry.metres_per_unit * nearest->distance;
      if (distance_m <= geometry.thresholds_mm[t] / 1000.0) ++count[t];
    }
  }
  std::vector<double> share;
  for (const size_t n : count) share.push_back(static_cast<double>(n) / geometry.num_samples);
  return share;
}

std::optional<LineEdgeError::Match> MatchOf(const Edge& line, std::span<const Edge> edges,
                                            const NearestDistance& to_edges,
                                            const GeometryOptions& geometry, double min_cosine) {
  const Eigen::Vector3d along = line[1] - line[0], middle = 0.5 * (line[0] + line[1]);
  const auto nearest = to_edges.Along(middle, along.normalized(), min_cosine);
  const double max_mm =
      *std::max_element(geometry.thresholds_mm.begin(), geometry.thresholds_mm.end());
  if (!nearest || geometry.metres_per_unit * nearest->distance > max_mm / 1000.0) {
    return std::nullopt;
  }
  const Edge& edge = edges[nearest->index];
  const Eigen::Vector3d edge_along = edge[1] - edge[0];
  LineEdgeError::Match match;
  match.edge = nearest->index;
  match.angle_deg = UnsignedAngleDeg(along, edge_along);
  match.offset_m =
      geometry.metres_per_unit * (middle - edge[0]).cross(edge_along.normalized()).norm();
  return match;
}

}  // namespace

void EdgeOptions::Describe(OptionTable* table) const {
  table->Section("Edges");
  table->Field("max_angle_deg", &max_angle_deg, Between(0, 90),
               "A true edge that a line does not run along within this angle is not the line's, "
               "degrees.");
  table->Section("");
}

EdgeErrors MeasureEdges(const Reconstruction& model, std::span<const Edge> edges,
                        const GeometryOptions& geometry, const EdgeOptions& options,
                        int num_threads) {
  const double min_cosine = std::cos(DegToRad(options.max_angle_deg));
  EdgeErrors errors;
  errors.num_edges = edges.size();
  std::vector<Edge> lines;
  for (const auto& [id, line] : model.lines3D) {
    if (NumImagesOf(line) < static_cast<size_t>(geometry.min_line_images)) continue;
    LineEdgeError error;
    error.line3D_id = id;
    error.length_m = geometry.metres_per_unit * (line.end - line.start).norm();
    errors.line_length_m += error.length_m;
    errors.lines.push_back(error);
    lines.push_back({line.start, line.end});
  }
  const auto to_edges = NearestDistance::ToSegments(edges);
  const auto to_lines = NearestDistance::ToSegments(lines);
  ParallelTasks(num_threads, lines.size(), [&](size_t i) {
    errors.lines[i].share = SharesAlong(lines[i], to_edges, geometry, min_cosine);
    errors.lines[i].match = MatchOf(lines[i], edges, to_edges, geometry, min_cosine);
  });
  std::vector<std::vector<double>> found(edges.size());
  ParallelTasks(num_threads, edges.size(), [&](size_t i) {
    found[i] = SharesAlong(edges[i], to_lines, geometry, min_cosine);
  });

  const size_t num_thresholds = geometry.thresholds_mm.size();
  errors.recall_m.assign(num_thresholds, 0.0);
  for (size_t i = 0; i < edges.size(); ++i) {
    const double length_m = geometry.metres_per_unit * (edges[i][1] - edges[i][0]).norm();
    errors.edge_length_m += length_m;
    for (size_t t = 0; t < num_thresholds; ++t) errors.recall_m[t] += length_m * found[i][t];
  }
  std::vector<double> angles_deg, offsets_m;
  std::vector<double> right_m(num_thresholds, 0.0);
  for (const LineEdgeError& line : errors.lines) {
    for (size_t t = 0; t < num_thresholds; ++t) right_m[t] += line.length_m * line.share[t];
    if (!line.match) continue;
    angles_deg.push_back(line.match->angle_deg);
    offsets_m.push_back(line.match->offset_m);
  }
  const auto percent = [](double part, double whole) {
    return whole > 0.0 ? 100.0 * part / whole : 0.0;
  };
  for (size_t t = 0; t < num_thresholds; ++t) {
    errors.recall_percent.push_back(percent(errors.recall_m[t], errors.edge_length_m));
    errors.precision_percent.push_back(percent(right_m[t], errors.line_length_m));
  }
  errors.angle_deg = Summarise(angles_deg);
  errors.offset_m = Summarise(offsets_m);
  return errors;
}

}  // namespace holba
