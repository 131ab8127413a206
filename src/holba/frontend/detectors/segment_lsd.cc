// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_lsd.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace holba {

std::vector<LineSegment2d> DetectWithLsd(const SegmentOptions& options, const GreyImage& image) {
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<uint8_t*>(image.pixels.data()));
  const cv::Ptr<cv::LineSegmentDetector> lsd =
      cv::createLineSegmentDetector(cv::LSD_REFINE_NONE, options.lsd_scale);
  std::vector<cv::Vec4f> found;
  lsd->detect(grey, found);
  // The gradient of 2 x 2 pixels belongs to the corner between them, at 1 if the first pixel is at
  // 0.5; OpenCV has it at 0.5. Half a pixel of the scale of the search is missing.
  const double shift = 0.5 / options.lsd_scale;
  std::vector<LineSegment2d> segments;
  segments.reserve(found.size());
  for (const cv::Vec4f& s : found)
    segments.push_back({{s[0] + shift, s[1] + shift}, {s[2] + shift, s[3] + shift}});
  return segments;
}

}  // namespace holba
