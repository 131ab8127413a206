// SPDX-License-Identifier: BSD-3-Clause
// Key points and descriptors of a user's ONNX model (ALIKED, SuperPoint and the like).
#pragma once

#include <string>

#include "holba/frontend/detectors/sift_detector.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

struct DescribedModel;

// Of COLMAP's type "undefined", descriptors in single precision; key points of two columns, the
// centre of the first pixel at 0.5, the best scores first kept where there are too many. No key
// point lies outside of the photograph or where `mask` (of its size; null: none) is 0. Throws
// InputError if the model cannot be run on it or gives something else.
SiftFeatures DetectOnnxPoints(const DescribedModel& model, const ColourImage& image,
                              const GreyImage* mask = nullptr);

}  // namespace holba
