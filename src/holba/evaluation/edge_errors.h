// SPDX-License-Identifier: BSD-3-Clause
// Lines of a model against the true edges of the scene. As geometry_errors.h has it for surfaces:
// samples at the middles of equal pieces; one is right if it is within the threshold of a true edge
// that runs along the line. The other way round, pieces of true edges are found if a line that runs
// along them is within the threshold.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "holba/base/options.h"
#include "holba/evaluation/geometry_errors.h"
#include "holba/evaluation/statistics.h"
#include "holba/scene/reconstruction.h"

namespace holba {

using Edge = std::array<Eigen::Vector3d, 2>;

struct EdgeOptions {
  // What merely crosses a line is not its edge: a line that crosses an edge at this angle is within
  // 10 mm of it for 58 mm to either side.
  double max_angle_deg = 10.0;

  void Describe(OptionTable* table) const;
};

struct LineEdgeError {
  line3D_t line3D_id = kNoId;
  double length_m = 0.0;
  std::vector<double> share;  // within each threshold of an edge
  // Of the edge that is nearest to the line's middle, if it is within the largest threshold.
  struct Match {
    uint32_t edge = 0;
    double angle_deg = 0.0;
    double offset_m = 0.0;  // of the line's middle from the edge's infinite line
  };
  std::optional<Match> match;
};

struct EdgeErrors {
  std::vector<LineEdgeError> lines;
  size_t num_edges = 0;
  double edge_length_m = 0.0, line_length_m = 0.0;
  std::vector<double> recall_m;           // length of edges that is found, for each threshold
  std::vector<double> recall_percent;     // of all edges
  std::vector<double> precision_percent;  // length of lines that is right, of all lines
  std::optional<ErrorStats> angle_deg, offset_m;  // of lines with a match
};

// Lines that enough images see (GeometryOptions), in the frame and unit of the edges.
EdgeErrors MeasureEdges(const Reconstruction& model, std::span<const Edge> edges,
                        const GeometryOptions& geometry, const EdgeOptions& options,
                        int num_threads);

}  // namespace holba
