// SPDX-License-Identifier: BSD-3-Clause
// Segments on the edges they stand for: which side is brighter, and where exactly the edge runs.
#pragma once

#include <optional>
#include <vector>

#include "holba/frontend/detectors/segment_gradients.h"
#include "holba/geometry/line.h"

namespace holba {

// Turns segments so that the brighter side is where Line() is positive.
void OrientSegments(const GradientImage& gradients, std::vector<LineSegment2d>* segments);

// The line through the maxima of the gradient across an oriented segment, fitted robustly; the ends
// move across the segment only. Empty: too few maxima agree, or they are not where the segment is.
std::optional<LineSegment2d> RefineSegment(const GradientImage& gradients,
                                           const LineSegment2d& segment);

}  // namespace holba
