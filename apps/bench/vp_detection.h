// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `vp_detection`: vanishing points found in the segments of photographs against
// labelled ones (YUD+, Kluger et al. 2020: the York Urban database with all vanishing points).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/table.h"
#include "holba/estimation/directions/vanishing_points.h"

namespace holba {

// A photograph's calibration, its segments, and the directions in the camera that they were
// labelled with. As a file, in any order:
//   K FX FY CX CY WIDTH HEIGHT
//   vp X Y Z                       direction in the camera, y down
//   seg X1 Y1 X2 Y2 LABEL          index of its direction, -1: none
struct LabelledSegments {
  std::string name;
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> directions;  // unit
  std::vector<LineSegment2d> segments;
  std::vector<int> labels;  // of the segments
};

// The *.txt files of a folder by name. Throws InputError with file and line.
std::vector<LabelledSegments> ReadLabelledSegments(const std::filesystem::path& folder);

struct VpDetectionOptions {
  VanishingPointOptions detection;
  int num_seeds = 10;  // detection.seed and the following ones
};

inline constexpr double kVpRecallDeg[] = {2.0, 5.0, 10.0};
// A found one further than this from all labelled ones is false.
inline constexpr double kVpFalseDeg = 5.0;

// Of all images with one seed.
struct VpDetectionResult {
  uint64_t seed = 0;
  size_t num_images = 0, num_labelled = 0, num_found = 0, num_false = 0;
  size_t num_recalled[3] = {0, 0, 0};  // labelled ones with a found one within kVpRecallDeg
  // Segments with a label and a found vanishing point, and those of them whose two directions are
  // within kVpFalseDeg.
  size_t num_labelled_segments = 0, num_right_segments = 0;
  double mean_ms = 0.0, max_ms = 0.0;  // of an image, wall time
};

std::vector<VpDetectionResult> MeasureVpDetection(const VpDetectionOptions& options,
                                                  const std::vector<LabelledSegments>& images);

Table VpDetectionTable(const std::vector<VpDetectionResult>& results);
nlohmann::json VpDetectionToJson(const std::vector<VpDetectionResult>& results);

}  // namespace holba
