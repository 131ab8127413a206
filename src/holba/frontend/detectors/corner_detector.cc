// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/corner_detector.h"

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace {

// Half sizes of the neighbourhoods that find a corner and that place it.
constexpr int kBlockSize = 3;
constexpr int kHalfWindowPx = 2;
// A corner that moves farther lies in no junction of straight edges.
constexpr double kMaxCornerMovePx = 2.0;
// Diameter of SIFT's key point; described on the image of half the size, which shows at this size
// all that the descriptor resolves.
constexpr float kKeyPointSizePx = 9.0f;

}  // namespace

void CornerOptions::Describe(OptionTable* table) const {
  table->Section("Corners");
  table->Field("max_num_corners", &max_num_corners, AtLeast(0),
               "Most corners of an image; the strongest are kept, 0: none.");
  table->Field("quality", &quality, Between(1e-6, 1.0),
               "Weakest corner, as a share of the strongest one's smaller eigenvalue.");
  table->Field("min_distance_px", &min_distance_px, AtLeast(1.0),
               "Least distance between corners, pixels.");
}

Corners DetectCorners(const CornerOptions& options, const GreyImage& image, const GreyImage* mask) {
  Corners corners;
  if (options.max_num_corners == 0) return corners;
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat allowed;
  if (mask != nullptr)
    allowed =
        cv::Mat(mask->height, mask->width, CV_8UC1, const_cast<uint8_t*>(mask->pixels.data()));
  std::vector<cv::Point2f> found;
  cv::goodFeaturesToTrack(grey, found, options.max_num_corners, options.quality,
                          options.min_distance_px, allowed, kBlockSize);
  if (found.empty()) return corners;
  std::vector<cv::Point2f> moved = found;
  cv::cornerSubPix(grey, moved, cv::Size(kHalfWindowPx, kHalfWindowPx), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.005));

  cv::Mat half;
  cv::resize(grey, half, cv::Size((grey.cols + 1) / 2, (grey.rows + 1) / 2), 0, 0, cv::INTER_AREA);
  const float scale_x = static_cast<float>(half.cols) / static_cast<float>(grey.cols);
  const float scale_y = static_cast<float>(half.rows) / static_cast<float>(grey.rows);
  std::vector<cv::KeyPoint> key_points;
  for (size_t i = 0; i < found.size(); ++i) {
    const cv::Point2f move = moved[i] - found[i];
    // OpenCV puts a corner back, exactly, that ran out of the window.
    if (move.dot(move) > kMaxCornerMovePx * kMaxCornerMovePx || moved[i] == found[i]) continue;
    if (!(moved[i].x >= 0.0f && moved[i].x <= static_cast<float>(image.width - 1) &&
          moved[i].y >= 0.0f && moved[i].y <= static_cast<float>(image.height - 1)))
      continue;
    // OpenCV counts from the centre of the first pixel.
    const float x = moved[i].x + 0.5f, y = moved[i].y + 0.5f;
    if (mask != nullptr && !IsUnmasked(*mask, {x, y})) continue;
    key_points.emplace_back(scale_x * x - 0.5f, scale_y * y - 0.5f, 0.5f * kKeyPointSizePx, 0.0f);
    corners.positions.emplace_back(x, y);
  }
  if (key_points.empty()) return corners;
  cv::Mat descriptors;
  // Of SIFT's pyramid only the first image is used: the fewest layers.
  cv::SIFT::create(0, 1)->compute(half, key_points, descriptors);
  HOLBA_CHECK_MSG(key_points.size() == corners.positions.size() &&
                      descriptors.cols == kCornerDescriptorSize && descriptors.isContinuous(),
                  "SIFT describes every corner");
  corners.descriptors.reserve(descriptors.total());
  for (const float value : cv::Mat_<float>(descriptors))
    corners.descriptors.push_back(cv::saturate_cast<uint8_t>(value));
  return corners;
}

}  // namespace holba
