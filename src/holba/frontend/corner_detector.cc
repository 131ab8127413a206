// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/corner_detector.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace {

// Half sizes of the neighbourhoods that find a corner and that place it.
constexpr int kBlockSize = 3;
constexpr int kHalfWindowPx = 4;
// A corner that moves farther lies in no junction of straight edges.
constexpr double kMaxMovePx = 2.0;
// Diameter of SIFT's key point. Computed on the image of half the size, which shows at this size
// all that the descriptor resolves.
constexpr float kKeyPointSizePx = 9.0f;
constexpr int kOctave = 1;

}  // namespace

void CornerOptions::Describe(OptionTable* table) {
  table->Section("Corners");
  table->Field("max_num_corners", &max_num_corners, AtLeast(0),
               "Most corners of an image; the strongest are kept, 0: none.");
  table->Field("quality", &quality, Between(1e-6, 1.0),
               "Weakest corner, as a share of the strongest one's smaller eigenvalue.");
  table->Field("min_distance_px", &min_distance_px, AtLeast(1.0),
               "Least distance between corners, pixels.");
}

Corners DetectCorners(const CornerOptions& options, const GreyImage& image) {
  Corners corners;
  if (options.max_num_corners == 0) return corners;
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<uint8_t*>(image.pixels.data()));
  std::vector<cv::Point2f> found;
  cv::goodFeaturesToTrack(grey, found, options.max_num_corners, options.quality,
                          options.min_distance_px, cv::noArray(), kBlockSize);
  if (found.empty()) return corners;
  std::vector<cv::Point2f> moved = found;
  cv::cornerSubPix(grey, moved, cv::Size(kHalfWindowPx, kHalfWindowPx), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.005));

  std::vector<cv::KeyPoint> key_points;
  for (size_t i = 0; i < found.size(); ++i) {
    const cv::Point2f move = moved[i] - found[i];
    // OpenCV puts a corner back, exactly, that ran out of the window.
    if (move.dot(move) > kMaxMovePx * kMaxMovePx || moved[i] == found[i]) continue;
    if (!(moved[i].x >= 0.0f && moved[i].x <= static_cast<float>(image.width - 1) &&
          moved[i].y >= 0.0f && moved[i].y <= static_cast<float>(image.height - 1)))
      continue;
    key_points.emplace_back(moved[i], kKeyPointSizePx, 0.0f, 0.0f, kOctave);
  }
  if (key_points.empty()) return corners;
  const size_t num_key_points = key_points.size();
  cv::Mat descriptors;
  cv::SIFT::create()->compute(grey, key_points, descriptors);
  HOLBA_CHECK_MSG(key_points.size() == num_key_points && descriptors.cols == kCornerDescriptorSize,
                  "SIFT describes every corner");
  corners.positions.reserve(num_key_points);
  corners.descriptors.reserve(num_key_points * kCornerDescriptorSize);
  for (size_t i = 0; i < num_key_points; ++i) {
    const int row = static_cast<int>(i);
    // OpenCV counts from the centre of the first pixel.
    corners.positions.emplace_back(key_points[i].pt.x + 0.5, key_points[i].pt.y + 0.5);
    for (int k = 0; k < kCornerDescriptorSize; ++k)
      corners.descriptors.push_back(cv::saturate_cast<uint8_t>(descriptors.at<float>(row, k)));
  }
  return corners;
}

}  // namespace holba
