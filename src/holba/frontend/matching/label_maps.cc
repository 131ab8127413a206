// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/label_maps.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"

namespace holba {
namespace {

// A photograph's pixels in a label map, with the distance to the rim in the photograph's pixels.
class RegionLookup {
 public:
  RegionLookup(const LabelMap& map, uint64_t image_width, uint64_t image_height)
      : map_(map),
        distance_(DistanceToRim(map)),
        scale_x_(map.width / static_cast<double>(image_width)),
        scale_y_(map.height / static_cast<double>(image_height)) {}

  // 0: outside of the image, or too close to the rim (margin in map pixels).
  uint16_t Label(const Eigen::Vector2d& pixel, const std::map<uint16_t, float>& margins) const {
    const double x = std::floor(pixel.x() * scale_x_), y = std::floor(pixel.y() * scale_y_);
    if (!(x >= 0.0 && y >= 0.0 && x < map_.width && y < map_.height)) return 0;
    const size_t at = static_cast<size_t>(y) * map_.width + static_cast<size_t>(x);
    const uint16_t label = map_.labels[at];
    const auto margin = margins.find(label);
    return margin == margins.end() || distance_[at] < margin->second ? 0 : label;
  }

 private:
  const LabelMap& map_;
  std::vector<float> distance_;
  double scale_x_, scale_y_;
};

// Planes, and solids of planes: what takes lines and is no direction.
bool IsFlat(const GroupType& type) { return type.TakesLines() && !type.IsParallelism(); }

// The one label of at least the share of a segment; 0: none.
uint16_t LabelOfSegment(const RegionLookup& lookup, const std::map<uint16_t, float>& margins,
                        const LineSegment2d& segment, double min_share) {
  constexpr double kStepPx = 2.0;
  constexpr int kMinSamples = 10;
  const int n = std::max(kMinSamples, static_cast<int>(segment.Length() / kStepPx));
  std::map<uint16_t, int> counts;
  for (int i = 0; i < n; ++i) {
    ++counts[lookup.Label(segment.start + (i + 0.5) / n * (segment.end - segment.start), margins)];
  }
  for (const auto& [label, count] : counts) {
    if (label != 0 && count >= min_share * n) return label;
  }
  return 0;
}

}  // namespace

void RegionGroupOptions::Describe(OptionTable* table) const {
  table->Section("RegionGroups");
  table->Field("curved_margin_px", &curved_margin_px, AtLeast(0),
               "Features this close to the rim of a curved region do not belong to it, in pixels "
               "of an image whose long side is 800.");
  table->Field("flat_margin_px", &flat_margin_px, AtLeast(0),
               "The same for regions of planes and cuboids.");
  table->Field("min_segment_share", &min_segment_share, Between(0.51, 1),
               "Share of a segment that must be in a region.");
}

std::vector<float> DistanceToRim(const LabelMap& map) {
  HOLBA_CHECK(map.labels.size() == static_cast<size_t>(map.width) * map.height);
  const cv::Mat labels(map.height, map.width, CV_16UC1, const_cast<uint16_t*>(map.labels.data()));
  cv::Mat not_rim(map.height, map.width, CV_8UC1, cv::Scalar(255));
  for (int y = 0; y < map.height; ++y) {
    const uint16_t* row = labels.ptr<uint16_t>(y);
    for (int x = 0; x < map.width; ++x) {
      if (x + 1 < map.width && row[x] != row[x + 1]) {
        not_rim.at<uint8_t>(y, x) = not_rim.at<uint8_t>(y, x + 1) = 0;
      }
      if (y + 1 < map.height && row[x] != labels.at<uint16_t>(y + 1, x)) {
        not_rim.at<uint8_t>(y, x) = not_rim.at<uint8_t>(y + 1, x) = 0;
      }
    }
  }
  std::vector<float> distance(map.labels.size());
  if (distance.empty()) return distance;
  cv::Mat result(map.height, map.width, CV_32FC1, distance.data());
  // Without any rim the transform would be that to a far corner of nothing.
  if (cv::countNonZero(not_rim) == map.width * map.height) {
    result.setTo(static_cast<float>(map.width + map.height));
  } else {
    cv::distanceTransform(not_rim, result, cv::DIST_L2, cv::DIST_MASK_PRECISE, CV_32F);
  }
  return distance;
}

RegionGroups GroupsOfLabelMap(const LabelMap& map, const Image& image, uint64_t image_width,
                              uint64_t image_height, const RegionGroupOptions& options) {
  HOLBA_CHECK(image_width > 0 && image_height > 0);
  RegionGroups result;
  if (map.empty()) return result;
  const double map_scale = std::max(map.width, map.height) / kReferenceLongSidePx;
  std::map<uint16_t, float> margins;  // pixels of the map
  for (const auto& [label, type] : map.types) {
    const double margin_px = IsFlat(*type) ? options.flat_margin_px : options.curved_margin_px;
    if (label != 0) margins[label] = static_cast<float>(margin_px * map_scale);
  }
  const RegionLookup lookup(map, image_width, image_height);
  std::map<uint16_t, Group2D> by_label;
  for (const auto& [label, margin] : margins) by_label[label].type = map.types.at(label);
  for (size_t i = 0; i < image.points2D.size(); ++i) {
    const uint16_t label = lookup.Label(image.points2D[i].xy, margins);
    if (label == 0 || !map.types.at(label)->TakesPoints()) continue;
    by_label.at(label).point2D_idxs.push_back(static_cast<point2D_t>(i));
  }
  for (size_t i = 0; i < image.lines2D.size(); ++i) {
    const uint16_t label =
        LabelOfSegment(lookup, margins, image.lines2D[i].segment, options.min_segment_share);
    if (label == 0 || !IsFlat(*map.types.at(label))) continue;
    by_label.at(label).line2D_idxs.push_back(static_cast<line2D_t>(i));
  }
  for (auto& [label, group] : by_label) {
    if (group.point2D_idxs.empty() && group.line2D_idxs.empty()) {
      ++result.dropped["no feature in the region"];
      continue;
    }
    result.groups.push_back(std::move(group));
    result.labels.push_back(label);
  }
  return result;
}

}  // namespace holba
