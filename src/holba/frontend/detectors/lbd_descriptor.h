// SPDX-License-Identifier: BSD-3-Clause
// Line band descriptor after Zhang and Koch (An efficient and robust line segment matching approach
// based on LBD descriptor and pairwise geometric consistency, 2013): the gradients in bands
// parallel to a segment, in the segment's own frame. Says the same of an image whose brightness is
// scaled or shifted, and of a turned one.
#pragma once

#include <vector>

#include "holba/frontend/detectors/segment_gradients.h"
#include "holba/geometry/line.h"

namespace holba {

// kSegmentDescriptorSize values for each oriented segment, of unit norm (all zero: no gradient
// there).
std::vector<float> DescribeSegments(const GradientImage& gradients,
                                    const std::vector<LineSegment2d>& segments);

}  // namespace holba
