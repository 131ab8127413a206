// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/geometry_errors.h"

#include <algorithm>
#include <set>

#include "holba/base/threads.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

template <typename Observation>
size_t NumImages(const std::vector<Observation>& track) {
  std::set<image_t> images;
  for (const Observation& observation : track) images.insert(observation.image_id);
  return images.size();
}

LineError MeasureLine(line3D_t id, const Line3D& line, const NearestDistance& surface,
                      const GeometryOptions& options) {
  LineError error;
  error.line3D_id = id;
  error.num_images = NumImages(line.track);
  error.length_m = options.metres_per_unit * (line.end - line.start).norm();
  std::vector<Eigen::Vector3d> samples;
  AppendSamples(line.start, line.end, options.num_samples, &samples);
  const std::vector<double> distances = surface.Of(samples, 1, /*is_sorted=*/true);
  error.share.assign(options.thresholds_mm.size(), 0.0);
  std::array<size_t, kNumPieces> num_in_piece{};
  error.piece_mean_m.fill(0.0);
  for (size_t i = 0; i < distances.size(); ++i) {
    const double distance_m = options.metres_per_unit * distances[i];
    const size_t piece = i * kNumPieces / distances.size();
    ++num_in_piece[piece];
    error.piece_mean_m[piece] += distance_m;
    error.mean_m += distance_m / static_cast<double>(distances.size());
    error.max_m = std::max(error.max_m, distance_m);
    for (size_t t = 0; t < error.share.size(); ++t) {
      if (distance_m <= options.thresholds_mm[t] / 1000.0) error.share[t] += 1.0;
    }
  }
  for (double& share : error.share) share /= static_cast<double>(distances.size());
  for (int piece = 0; piece < kNumPieces; ++piece) {
    // With fewer samples than pieces some pieces have none.
    error.piece_mean_m[piece] =
        num_in_piece[piece] > 0
            ? error.piece_mean_m[piece] / static_cast<double>(num_in_piece[piece])
            : error.mean_m;
  }
  return error;
}

double Percent(double part, double whole) { return whole > 0.0 ? 100.0 * part / whole : 0.0; }

}  // namespace

size_t NumImagesOf(const Point3D& point) { return NumImages(point.track); }
size_t NumImagesOf(const Line3D& line) { return NumImages(line.track); }

void GeometryOptions::Describe(OptionTable* table) const {
  table->Field("thresholds_mm", &thresholds_mm, GreaterThan(0),
               "Distances from the truth within which points and lines are right, millimetres.");
  table->Field("metres_per_unit", &metres_per_unit, GreaterThan(0),
               "Length of the unit of model and truth, metres.");
  table->Section("Geometry");
  table->Field("num_samples", &num_samples, AtLeast(1),
               "Samples along each line (1000 in LIMAP's evaluation).");
  table->Field("min_point_images", &min_point_images, AtLeast(0),
               "Points that fewer images see do not count.");
  table->Field("min_line_images", &min_line_images, AtLeast(0),
               "Lines that fewer images see do not count.");
  table->Field("limap_min_line_images", &limap_min_line_images, AtLeast(0),
               "The same for the figures in LIMAP's definition (4 in its evaluation).");
  table->Section("");
}

void AppendSamples(const Eigen::Vector3d& start, const Eigen::Vector3d& end, int num_samples,
                   std::vector<Eigen::Vector3d>* samples) {
  for (int i = 0; i < num_samples; ++i) {
    const double t = (i + 0.5) / num_samples;
    samples->push_back((1.0 - t) * start + t * end);
  }
}

GeometryErrors MeasureGeometry(const Reconstruction& model, const NearestDistance& surface,
                               const GeometryOptions& options, int num_threads) {
  GeometryErrors errors;
  std::vector<Eigen::Vector3d> positions;
  for (const auto& [id, point] : model.points3D) {
    if (NumImages(point.track) < static_cast<size_t>(options.min_point_images)) continue;
    errors.points.push_back({id, 0.0});
    positions.push_back(point.xyz);
  }
  const std::vector<double> distances = surface.Of(positions, num_threads);
  for (size_t i = 0; i < distances.size(); ++i) {
    errors.points[i].distance_m = options.metres_per_unit * distances[i];
  }

  std::vector<line3D_t> line_ids;
  for (const auto& [id, line] : model.lines3D) {
    if (NumImages(line.track) >= static_cast<size_t>(options.min_line_images)) {
      line_ids.push_back(id);
    }
  }
  errors.lines.resize(line_ids.size());
  ParallelTasks(num_threads, line_ids.size(), [&](size_t i) {
    errors.lines[i] = MeasureLine(line_ids[i], model.lines3D.at(line_ids[i]), surface, options);
  });
  return errors;
}

PointSummary SummarisePoints(const std::vector<PointError>& points,
                             const std::vector<double>& thresholds_mm) {
  PointSummary summary;
  summary.count = points.size();
  std::vector<double> distances_mm;
  for (const PointError& point : points) distances_mm.push_back(1000.0 * point.distance_m);
  if (const auto stats = Summarise(distances_mm)) summary.median_mm = stats->median;
  for (const double threshold : thresholds_mm) {
    const auto num_inliers = std::count_if(points.begin(), points.end(), [&](const PointError& p) {
      return p.distance_m <= threshold / 1000.0;
    });
    summary.inlier_percent.push_back(
        Percent(static_cast<double>(num_inliers), static_cast<double>(points.size())));
  }
  return summary;
}

LineSummary SummariseLinesAsPaper(const std::vector<LineError>& lines, size_t num_thresholds) {
  LineSummary summary;
  summary.count = lines.size();
  summary.recall_m.assign(num_thresholds, 0.0);
  for (const LineError& line : lines) {
    summary.length_m += line.length_m;
    for (size_t t = 0; t < num_thresholds; ++t)
      summary.recall_m[t] += line.length_m * line.share[t];
  }
  for (const double recall_m : summary.recall_m) {
    summary.precision_percent.push_back(Percent(recall_m, summary.length_m));
  }
  return summary;
}

LineSummary SummariseLinesAsLimap(const std::vector<LineError>& lines, size_t num_thresholds,
                                  int min_line_images) {
  std::vector<LineError> seen;
  for (const LineError& line : lines) {
    if (line.num_images >= static_cast<size_t>(min_line_images)) seen.push_back(line);
  }
  LineSummary summary = SummariseLinesAsPaper(seen, num_thresholds);
  for (size_t t = 0; t < num_thresholds; ++t) {
    const auto num_touching = std::count_if(
        seen.begin(), seen.end(), [&](const LineError& line) { return line.share[t] > 0.0; });
    summary.precision_percent[t] =
        Percent(static_cast<double>(num_touching), static_cast<double>(seen.size()));
  }
  return summary;
}

}  // namespace holba
