// SPDX-License-Identifier: BSD-3-Clause
// Line segments of a user's ONNX model (DeepLSD, M-LSD and the like), options.model_path.
#pragma once

#include <vector>

#include "holba/frontend/detectors/segment_detector.h"

namespace holba {

std::vector<LineSegment2d> DetectWithOnnx(const SegmentOptions& options, const GreyImage& image);

}  // namespace holba
