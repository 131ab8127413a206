// SPDX-License-Identifier: BSD-3-Clause
// Points and lines of a model against surfaces: how many are near them, and how much of the lines.
// Model and surface are in one frame. Distances in metres, thresholds in millimetres.
//
// Two definitions of what is right about lines stand side by side; in both a line is its extent,
// sampled at the middles of `num_samples` equal pieces, and a sample is right if it is within the
// threshold of the surface.
//   The paper's (Table 2): recall is the length of the right pieces, precision its share of all
//   length.
//   LIMAP's (Liu et al., "3D Line Mapping Revisited", CVPR 2023): lines that at least 4 images see;
//   recall is the length of the right pieces, precision the share of lines with any right sample.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/evaluation/nearest_distance.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct GeometryOptions {
  std::vector<double> thresholds_mm = {1, 5, 10};  // those of the paper's Table 2
  double metres_per_unit = 1.0;                    // of model and truth
  int num_samples = 1000;                          // LIMAP's
  int min_point_images = 0;
  int min_line_images = 0;
  int limap_min_line_images = 4;

  void Describe(OptionTable* table) const;
};

struct PointError {
  point3D_t point3D_id = kNoId;
  double distance_m = 0.0;
};

// Pieces of a line that are coloured apart.
inline constexpr int kNumPieces = 20;

struct LineError {
  line3D_t line3D_id = kNoId;
  size_t num_images = 0;
  double length_m = 0.0;
  double mean_m = 0.0, max_m = 0.0;             // of the samples' distances
  std::vector<double> share;                    // of its samples within each threshold
  std::array<double, kNumPieces> piece_mean_m;  // of the samples of each of kNumPieces pieces
};

struct GeometryErrors {
  std::vector<PointError> points;  // in the order of the model
  std::vector<LineError> lines;
};

// How many images see a feature.
size_t NumImagesOf(const Point3D& point);
size_t NumImagesOf(const Line3D& line);

// Of all points and lines that enough images see.
GeometryErrors MeasureGeometry(const Reconstruction& model, const NearestDistance& surface,
                               const GeometryOptions& options, int num_threads);

struct PointSummary {
  size_t count = 0;
  std::optional<double> median_mm;     // empty: no points
  std::vector<double> inlier_percent;  // for each threshold; 0 without points
};
struct LineSummary {
  size_t count = 0;
  double length_m = 0.0;                  // of all of them
  std::vector<double> recall_m;           // for each threshold
  std::vector<double> precision_percent;  // 0 without lines
};

PointSummary SummarisePoints(const std::vector<PointError>& points,
                             const std::vector<double>& thresholds_mm);
LineSummary SummariseLinesAsPaper(const std::vector<LineError>& lines, size_t num_thresholds);
LineSummary SummariseLinesAsLimap(const std::vector<LineError>& lines, size_t num_thresholds,
                                  int min_line_images);

// The middles of `num_samples` equal pieces of the segment.
void AppendSamples(const Eigen::Vector3d& start, const Eigen::Vector3d& end, int num_samples,
                   std::vector<Eigen::Vector3d>* samples);

}  // namespace holba
