// SPDX-License-Identifier: BSD-3-Clause
// Photographs as a user's ONNX model wants them, and back to their pixels what it says.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "holba/frontend/onnx/onnx_description.h"
#include "holba/frontend/onnx/onnx_runtime.h"
#include "holba/frontend/photographs/photograph.h"

namespace holba {

// A model with its description, read once for each file however often it is asked for; may be used
// by several threads. Throws InputError.
struct DescribedModel {
  DescribedModel(const std::filesystem::path& path, OnnxKind kind);

  OnnxDescription description;
  OnnxModel model;
};
std::shared_ptr<const DescribedModel> SharedOnnxModel(const std::string& path, OnnxKind kind);

// (1, channels, height, width), scaled as described.
struct OnnxImage {
  OnnxTensor tensor;
  Eigen::Vector2d photograph_from_model;  // scale of pixels

  // In pixels of the photograph, the centre of the first one at 0.5.
  Eigen::Vector2d ToPhotograph(const OnnxDescription& description, double x, double y) const {
    return Eigen::Vector2d(x - description.first_pixel + 0.5, y - description.first_pixel + 0.5)
        .cwiseProduct(photograph_from_model);
  }
};
// Grey photographs are the same in all channels. Colours are made grey.
OnnxImage MakeOnnxImage(const OnnxDescription& description, const GreyImage& image);
OnnxImage MakeOnnxImage(const OnnxDescription& description, const ColourImage& image);

// A table of `num_columns` values in each row (0: any number), whatever dimensions of size 1 the
// model puts before it: (1, N, D), (N, D). Throws InputError for other shapes and values that are
// not finite.
struct OnnxTable {
  size_t num_rows = 0, num_columns = 0;
  std::vector<float> values;
  float At(size_t row, size_t column) const { return values[row * num_columns + column]; }
};
OnnxTable ToTable(const std::filesystem::path& model, const std::string& name,
                  const OnnxTensor& tensor, size_t num_columns, bool are_columns);

// Indices of the at most `max_num` rows of the highest scores, from min_score on, in the order of
// the rows. Without scores: the first ones.
std::vector<size_t> BestRows(const OnnxDescription& description, size_t num_rows,
                             const std::vector<float>& scores);

}  // namespace holba
