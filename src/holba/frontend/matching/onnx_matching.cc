// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/onnx_matching.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <set>

#include "holba/base/error.h"
#include "holba/frontend/onnx/onnx_description.h"
#include "holba/frontend/onnx/onnx_runtime.h"

namespace holba {
namespace {

size_t LengthOf(const Descriptors& descriptors) {
  return static_cast<size_t>(descriptors.num_bytes) / (AreFloats(descriptors) ? 4 : 1);
}

// (1, N, D), or (1, D, N).
OnnxTensor DescriptorTensor(const Descriptors& descriptors, size_t num, bool are_columns) {
  const size_t length = LengthOf(descriptors);
  const bool are_floats = AreFloats(descriptors);
  std::vector<float> values(num * length);
  for (size_t i = 0; i < num; ++i) {
    const uint8_t* from = descriptors.data.data() + i * descriptors.num_bytes;
    for (size_t k = 0; k < length; ++k) {
      // Bytes have the length 512; floats stay as the detector gave them.
      float value = 0.0f;
      if (are_floats) {
        std::memcpy(&value, from + 4 * k, 4);
      } else {
        value = from[k] / 512.0f;
      }
      values[are_columns ? k * num + i : i * length + k] = value;
    }
  }
  const auto n = static_cast<int64_t>(num), d = static_cast<int64_t>(length);
  return are_columns ? FloatTensor({1, d, n}, std::move(values))
                     : FloatTensor({1, n, d}, std::move(values));
}

OnnxTensor KeypointTensor(const OnnxDescription& description, const OnnxMatchEnd& end, size_t num) {
  const double half = 0.5 * end.image_size.maxCoeff();
  std::vector<float> values;
  for (size_t i = 0; i < num; ++i) {
    Eigen::Vector2d p = end.keypoints->Position(i);
    p.array() += description.first_pixel - 0.5;
    if (description.are_normalised) p = (p - 0.5 * end.image_size) / half;
    values.push_back(static_cast<float>(p.x()));
    values.push_back(static_cast<float>(p.y()));
  }
  return FloatTensor({1, static_cast<int64_t>(num), 2}, std::move(values));
}

}  // namespace

struct OnnxMatcher::Model {
  explicit Model(const std::string& path)
      : description(ReadOnnxDescription(path, OnnxKind::kMatcher)),
        model(description.model, description.library) {}

  OnnxDescription description;
  OnnxModel model;
};

OnnxMatcher::OnnxMatcher(const std::string& path) : model_(std::make_unique<Model>(path)) {}
OnnxMatcher::~OnnxMatcher() = default;

DescriptorMatches OnnxMatcher::Match(const OnnxMatchEnd& end1, const OnnxMatchEnd& end2,
                                     size_t max_num) const {
  const OnnxDescription& described = model_->description;
  const size_t num1 = std::min(end1.descriptors->size(), max_num);
  const size_t num2 = std::min(end2.descriptors->size(), max_num);
  DescriptorMatches result;
  if (num1 == 0 || num2 == 0 || LengthOf(*end1.descriptors) != LengthOf(*end2.descriptors))
    return result;
  std::vector<std::string> names = {described.outputs.at("matches")};
  const bool has_scores = described.outputs.contains("scores");
  if (has_scores) names.push_back(described.outputs.at("scores"));
  const auto found =
      model_->model.Run({{described.inputs.at("keypoints1"), KeypointTensor(described, end1, num1)},
                         {described.inputs.at("keypoints2"), KeypointTensor(described, end2, num2)},
                         {described.inputs.at("descriptors1"),
                          DescriptorTensor(*end1.descriptors, num1, described.are_columns)},
                         {described.inputs.at("descriptors2"),
                          DescriptorTensor(*end2.descriptors, num2, described.are_columns)}},
                        names);

  // Rows (i, j) or (0, i, j), or for each point of the first image that of the second one, or -1.
  const OnnxTensor& matches = found[0];
  const int64_t last = matches.shape.empty() ? 0 : matches.shape.back();
  const bool is_list = !described.is_of_first;
  const bool fits =
      is_list ? matches.shape.size() == 2 && (last == 2 || last == 3) : matches.size() == num1;
  if (matches.is_float || !fits) {
    throw InputError(
        model_->model.path(),
        fmt::format("output '{}': expected whole numbers, {}, found the shape ({})", names[0],
                    is_list ? "(N, 2) or (N, 3)" : fmt::format("one for each of {} points", num1),
                    fmt::join(matches.shape, ", ")));
  }
  const size_t num = is_list ? static_cast<size_t>(matches.shape[0]) : num1;
  if (has_scores && (!found[1].is_float || found[1].size() != num)) {
    throw InputError(model_->model.path(),
                     fmt::format("output '{}': expected {} floats as scores, found {}", names[1],
                                 num, found[1].floats.size()));
  }
  struct Scored {
    float score;
    std::array<point2D_t, 2> match;
  };
  std::vector<Scored> scored;
  for (size_t k = 0; k < num; ++k) {
    const size_t end = (k + 1) * static_cast<size_t>(last);
    const int64_t i = is_list ? matches.integers[end - 2] : static_cast<int64_t>(k);
    const int64_t j = is_list ? matches.integers[end - 1] : matches.integers[k];
    if (!is_list && j == -1) continue;
    if (i < 0 || j < 0 || static_cast<size_t>(i) >= num1 || static_cast<size_t>(j) >= num2) {
      throw InputError(model_->model.path(),
                       fmt::format("output '{}': expected points below {} and {}, found {} and {}",
                                   names[0], num1, num2, i, j));
    }
    const float score = has_scores ? found[1].floats[k] : 1.0f;
    if (has_scores && !(score >= described.min_score)) continue;
    scored.push_back({score, {static_cast<point2D_t>(i), static_cast<point2D_t>(j)}});
  }
  result.num_candidates = scored.size();
  std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
    return a.score != b.score ? a.score > b.score : a.match < b.match;
  });
  std::set<point2D_t> used1, used2;
  for (const Scored& s : scored) {
    if (used1.contains(s.match[0]) || used2.contains(s.match[1])) continue;
    used1.insert(s.match[0]);
    used2.insert(s.match[1]);
    result.matches.push_back(s.match);
  }
  return result;
}

}  // namespace holba
