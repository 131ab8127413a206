// SPDX-License-Identifier: BSD-3-Clause
// Matches of key points by a user's ONNX model (LightGlue and the like).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "holba/frontend/matching/descriptor_matching.h"

namespace holba {

struct OnnxMatchEnd {
  Eigen::Vector2d image_size;  // width, height, pixels
  const Keypoints* keypoints = nullptr;
  const Descriptors* descriptors = nullptr;  // floats (types -1, 1 and 2), or bytes
};

class OnnxMatcher {
 public:
  // The model that the JSON file describes. Throws InputError.
  explicit OnnxMatcher(const std::string& path);
  ~OnnxMatcher();

  // Best scores first, each key point once. No more than `max_num` key points of each image take
  // part. May be called from several threads. Throws InputError if the model cannot be run on
  // these, or gives something else.
  DescriptorMatches Match(const OnnxMatchEnd& end1, const OnnxMatchEnd& end2, size_t max_num) const;

 private:
  struct Model;
  std::unique_ptr<Model> model_;
};

}  // namespace holba
