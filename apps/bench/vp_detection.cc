// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/vp_detection.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/timer.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return RadToDeg(std::atan2(a.cross(b).norm(), std::abs(a.dot(b))));
}

// 90 without directions.
double NearestDeg(const Eigen::Vector3d& direction, const std::vector<Eigen::Vector3d>& others) {
  double least = 90.0;
  for (const Eigen::Vector3d& other : others) least = std::min(least, AngleDeg(direction, other));
  return least;
}

LabelledSegments ReadImage(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw CannotBeRead(path, SystemFault());
  LabelledSegments image;
  image.name = path.stem().string();
  bool has_calibration = false;
  std::string text;
  for (uint64_t line = 1; std::getline(file, text); ++line) {
    std::istringstream words(text);
    std::string kind;
    if (!(words >> kind)) continue;
    if (kind == "K") {
      double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
      if (!(words >> fx >> fy >> cx >> cy) || !(fx > 0.0) || !(fy > 0.0))
        throw InputError::AtLine(path, line, "expected K FX FY CX CY WIDTH HEIGHT");
      image.K << fx, 0, cx, 0, fy, cy, 0, 0, 1;
      has_calibration = true;
    } else if (kind == "vp") {
      Eigen::Vector3d d;
      if (!(words >> d.x() >> d.y() >> d.z()) || !(d.norm() > 0.0))
        throw InputError::AtLine(path, line, "expected vp X Y Z, a direction");
      image.directions.push_back(d.normalized());
    } else if (kind == "seg") {
      LineSegment2d s;
      int label = -1;
      if (!(words >> s.start.x() >> s.start.y() >> s.end.x() >> s.end.y() >> label) || label < -1)
        throw InputError::AtLine(path, line, "expected seg X1 Y1 X2 Y2 LABEL");
      image.segments.push_back(s);
      image.labels.push_back(label);
    } else {
      throw InputError::AtLine(
          path, line, "expected K, vp or seg at the start of the line, found '" + kind + "'");
    }
  }
  if (!has_calibration)
    throw InputError(path, "expected a line K FX FY CX CY WIDTH HEIGHT, found none");
  for (const int label : image.labels) {
    if (label >= static_cast<int>(image.directions.size())) {
      throw InputError(
          path, fmt::format("expected a label of a segment below {1} (lines vp) or -1, found {0}",
                            label, image.directions.size()));
    }
  }
  return image;
}

void Count(const LabelledSegments& image, const VanishingPoints& found, VpDetectionResult* result) {
  std::vector<Eigen::Vector3d> directions;
  for (const ImageVanishingPoint& point : found.points) {
    directions.push_back(point.direction_in_cam);
  }
  for (const Eigen::Vector3d& labelled : image.directions) {
    const double nearest_deg = NearestDeg(labelled, directions);
    for (size_t i = 0; i < std::size(kVpRecallDeg); ++i) {
      result->num_recalled[i] += nearest_deg <= kVpRecallDeg[i];
    }
  }
  for (const Eigen::Vector3d& direction : directions) {
    result->num_false += NearestDeg(direction, image.directions) > kVpFalseDeg;
  }
  for (size_t k = 0; k < image.segments.size(); ++k) {
    if (image.labels[k] < 0 || found.vp_of_segment[k] < 0) continue;
    ++result->num_labelled_segments;
    result->num_right_segments += AngleDeg(image.directions[image.labels[k]],
                                           directions[found.vp_of_segment[k]]) <= kVpFalseDeg;
  }
  ++result->num_images;
  result->num_labelled += image.directions.size();
  result->num_found += directions.size();
}

double Share(size_t part, size_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

struct Measure {
  std::string name;
  bool larger_is_better;
  std::function<double(const VpDetectionResult&)> value;
};

std::vector<Measure> Measures() {
  std::vector<Measure> measures;
  for (size_t i = 0; i < std::size(kVpRecallDeg); ++i) {
    measures.push_back(
        {fmt::format("recall {:g} deg, %", kVpRecallDeg[i]), true, [i](const VpDetectionResult& r) {
           return 100.0 * Share(r.num_recalled[i], r.num_labelled);
         }});
  }
  measures.push_back({"false per image", false,
                      [](const VpDetectionResult& r) { return Share(r.num_false, r.num_images); }});
  measures.push_back({"right segments, %", true, [](const VpDetectionResult& r) {
                        return 100.0 * Share(r.num_right_segments, r.num_labelled_segments);
                      }});
  measures.push_back({"ms per image", false, [](const VpDetectionResult& r) { return r.mean_ms; }});
  measures.push_back({"most ms", false, [](const VpDetectionResult& r) { return r.max_ms; }});
  return measures;
}

}  // namespace

std::vector<LabelledSegments> ReadLabelledSegments(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder)) throw FolderIsWanted(folder);
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".txt") paths.push_back(entry.path());
  }
  if (paths.empty())
    throw InputError(folder, "expected .txt files of labelled segments in this folder, found none");
  std::sort(paths.begin(), paths.end());
  std::vector<LabelledSegments> images;
  for (const std::filesystem::path& path : paths) images.push_back(ReadImage(path));
  return images;
}

std::vector<VpDetectionResult> MeasureVpDetection(const VpDetectionOptions& options,
                                                  const std::vector<LabelledSegments>& images) {
  std::vector<VpDetectionResult> results;
  for (int i = 0; i < options.num_seeds; ++i) {
    VanishingPointOptions detection = options.detection;
    detection.seed += i;
    VpDetectionResult result;
    result.seed = detection.seed;
    double sum_ms = 0.0;
    for (const LabelledSegments& image : images) {
      const Timer timer;
      const VanishingPoints found = DetectVanishingPoints(detection, image.segments, image.K);
      const double ms = 1e3 * timer.Seconds();
      sum_ms += ms;
      result.max_ms = std::max(result.max_ms, ms);
      Count(image, found, &result);
    }
    result.mean_ms = images.empty() ? 0.0 : sum_ms / static_cast<double>(images.size());
    results.push_back(result);
  }
  return results;
}

Table VpDetectionTable(const std::vector<VpDetectionResult>& results) {
  Table table;
  if (results.empty()) return table;
  table.title = fmt::format("{} images with {} labelled vanishing points; seeds {} to {}",
                            results[0].num_images, results[0].num_labelled, results.front().seed,
                            results.back().seed);
  table.header = {"seeds"};
  std::vector<std::string> mean = {"mean"}, worst = {"worst"}, best = {"best"};
  for (const Measure& measure : Measures()) {
    table.header.push_back(measure.name);
    double sum = 0.0;
    std::vector<double> values;
    for (const VpDetectionResult& result : results) {
      values.push_back(measure.value(result));
      sum += values.back();
    }
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    mean.push_back(ThreeDigits(sum / static_cast<double>(values.size())));
    worst.push_back(ThreeDigits(measure.larger_is_better ? *low : *high));
    best.push_back(ThreeDigits(measure.larger_is_better ? *high : *low));
  }
  table.rows = {mean, worst, best};
  return table;
}

nlohmann::json VpDetectionToJson(const std::vector<VpDetectionResult>& results) {
  nlohmann::json list = nlohmann::json::array();
  for (const VpDetectionResult& r : results) {
    list.push_back(
        {{"seed", r.seed},
         {"images", r.num_images},
         {"labelled", r.num_labelled},
         {"found", r.num_found},
         {"false", r.num_false},
         {"recalled",
          {{"2", r.num_recalled[0]}, {"5", r.num_recalled[1]}, {"10", r.num_recalled[2]}}},
         {"labelled_segments", r.num_labelled_segments},
         {"right_segments", r.num_right_segments},
         {"ms_per_image", r.mean_ms},
         {"ms_per_image_max", r.max_ms}});
  }
  return list;
}

}  // namespace holba
