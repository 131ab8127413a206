// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/onnx_points.h"

#include <fmt/format.h>

#include <cstring>

#include "holba/base/error.h"
#include "holba/frontend/detectors/onnx_image.h"

namespace holba {

SiftFeatures DetectOnnxPoints(const DescribedModel& model, const ColourImage& image,
                              const GreyImage* mask) {
  const OnnxDescription& described = model.description;
  const OnnxImage input = MakeOnnxImage(described, image);
  const bool has_scores = described.outputs.contains("scores");
  std::vector<std::string> names = {described.outputs.at("keypoints"),
                                    described.outputs.at("descriptors")};
  if (has_scores) names.push_back(described.outputs.at("scores"));
  const auto found = model.model.Run({{described.inputs.at("image"), input.tensor}}, names);
  const auto& path = model.model.path();
  const OnnxTable points = ToTable(path, names[0], found[0], 2, described.are_columns);
  const OnnxTable descriptors = ToTable(path, names[1], found[1], 0, described.are_columns);
  if (descriptors.num_rows != points.num_rows || descriptors.num_columns == 0) {
    throw InputError(
        path,
        fmt::format("output '{}': expected a descriptor for each key point ({}), "
                    "found {} of {} values",
                    names[1], points.num_rows, descriptors.num_rows, descriptors.num_columns));
  }
  std::vector<float> scores;
  if (has_scores) {
    scores = found[2].floats;
    if (scores.size() != points.num_rows) {
      throw InputError(path, fmt::format("output '{}': expected a score for each key point ({}), "
                                         "found {} floats",
                                         names[2], points.num_rows, scores.size()));
    }
  }
  SiftFeatures features;
  features.keypoints.num_cols = 2;
  features.descriptors.type = -1;
  features.descriptors.num_bytes = static_cast<int>(sizeof(float) * descriptors.num_columns);
  for (const size_t i : BestRows(described, points.num_rows, scores)) {
    const Eigen::Vector2d at = input.ToPhotograph(described, points.At(i, 0), points.At(i, 1));
    if (!(at.x() >= 0.0 && at.y() >= 0.0 && at.x() <= image.width && at.y() <= image.height))
      continue;
    if (mask != nullptr && !IsUnmasked(*mask, at)) continue;
    features.keypoints.data.push_back(static_cast<float>(at.x()));
    features.keypoints.data.push_back(static_cast<float>(at.y()));
    const auto* bytes =
        reinterpret_cast<const uint8_t*>(&descriptors.values[i * descriptors.num_columns]);
    features.descriptors.data.insert(features.descriptors.data.end(), bytes,
                                     bytes + features.descriptors.num_bytes);
  }
  return features;
}

}  // namespace holba
