// SPDX-License-Identifier: BSD-3-Clause
// LSD, the line segment detector of Grompone von Gioi et al. (IPOL 2012), by OpenCV: without its
// refinement, which cuts long segments to pieces that are found again less often.
#pragma once

#include <vector>

#include "holba/frontend/detectors/segment_detector.h"

namespace holba {

std::vector<LineSegment2d> DetectWithLsd(const SegmentOptions& options, const GreyImage& image);

}  // namespace holba
