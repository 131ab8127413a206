// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/onnx_image.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "holba/base/error.h"

namespace holba {
namespace {

// `pixels`: 8 bits, one or three channels.
OnnxImage Make(const OnnxDescription& description, const cv::Mat& pixels) {
  const double scale = std::min(
      1.0, description.max_image_size / static_cast<double>(std::max(pixels.cols, pixels.rows)));
  cv::Mat scaled = pixels;
  if (scale < 1.0) {
    const cv::Size size(std::max(1, static_cast<int>(std::lround(scale * pixels.cols))),
                        std::max(1, static_cast<int>(std::lround(scale * pixels.rows))));
    cv::resize(pixels, scaled, size, 0, 0, cv::INTER_AREA);
  }
  const int unit = description.multiple_of;
  const int width = (scaled.cols + unit - 1) / unit * unit;
  const int height = (scaled.rows + unit - 1) / unit * unit;
  OnnxImage result;
  result.photograph_from_model = {pixels.cols / static_cast<double>(scaled.cols),
                                  pixels.rows / static_cast<double>(scaled.rows)};
  std::vector<float> values(static_cast<size_t>(description.channels) * width * height);
  for (int channel = 0; channel < description.channels; ++channel) {
    const auto c = static_cast<size_t>(channel);
    const double mean = description.mean.empty() ? 0.0 : description.mean[c];
    const double deviation = description.deviation.empty() ? 1.0 : description.deviation[c];
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double value = 0.0;
        if (y < scaled.rows && x < scaled.cols) {
          const int from = scaled.channels() == 1 ? 0 : channel;
          value = scaled.ptr<uint8_t>(y)[x * scaled.channels() + from] * description.range / 255.0;
        }
        values[(c * height + y) * width + x] = static_cast<float>((value - mean) / deviation);
      }
    }
  }
  result.tensor = FloatTensor({1, description.channels, height, width}, std::move(values));
  return result;
}

}  // namespace

DescribedModel::DescribedModel(const std::filesystem::path& path, OnnxKind kind)
    : description(ReadOnnxDescription(path, kind)), model(description.model, description.library) {
  const auto check = [&](const auto& wanted, const std::vector<std::string>& known,
                         const char* what) {
    for (const auto& [role, name] : wanted) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      throw InputError(path, fmt::format("'{}': expected one of the model's {}s ({}), found '{}'",
                                         role, what, fmt::join(known, ", "), name));
    }
  };
  check(description.inputs, model.input_names(), "input");
  check(description.outputs, model.output_names(), "output");
}

std::shared_ptr<const DescribedModel> SharedOnnxModel(const std::string& path, OnnxKind kind) {
  static std::mutex mutex;
  static auto* models =
      new std::map<std::pair<std::string, OnnxKind>, std::shared_ptr<const DescribedModel>>();
  const std::lock_guard lock(mutex);
  auto& model = (*models)[{path, kind}];
  if (!model) model = std::make_shared<const DescribedModel>(path, kind);
  return model;
}

OnnxImage MakeOnnxImage(const OnnxDescription& description, const GreyImage& image) {
  return Make(description, cv::Mat(image.height, image.width, CV_8UC1,
                                   const_cast<uint8_t*>(image.pixels.data())));
}

OnnxImage MakeOnnxImage(const OnnxDescription& description, const ColourImage& image) {
  cv::Mat pixels(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data()));
  if (description.channels == 3) return Make(description, pixels);
  cv::Mat grey;
  cv::cvtColor(pixels, grey, cv::COLOR_RGB2GRAY);
  return Make(description, grey);
}

OnnxTable ToTable(const std::filesystem::path& model, const std::string& name,
                  const OnnxTensor& tensor, size_t num_columns, bool are_columns) {
  const auto fail = [&](const std::string& expected) {
    throw InputError(model, fmt::format("output '{}': expected {}, found the shape ({})", name,
                                        expected, fmt::join(tensor.shape, ", ")));
  };
  std::vector<int64_t> shape = tensor.shape;
  while (shape.size() > 2 && shape.front() == 1) shape.erase(shape.begin());
  // Segments as two points each.
  if (shape.size() == 3 && num_columns == static_cast<size_t>(shape[1] * shape[2]))
    shape = {shape[0], shape[1] * shape[2]};
  if (shape.size() != 2) fail("a table");
  if (are_columns) std::swap(shape[0], shape[1]);
  OnnxTable table{static_cast<size_t>(shape[0]), static_cast<size_t>(shape[1]), {}};
  if (num_columns != 0 && table.num_columns != num_columns)
    fail(fmt::format("{} values a row", num_columns));
  table.values.resize(table.num_rows * table.num_columns);
  for (size_t row = 0; row < table.num_rows; ++row) {
    for (size_t column = 0; column < table.num_columns; ++column) {
      const size_t from =
          are_columns ? column * table.num_rows + row : row * table.num_columns + column;
      const float value =
          tensor.is_float ? tensor.floats[from] : static_cast<float>(tensor.integers[from]);
      if (!std::isfinite(value)) {
        throw InputError(model,
                         fmt::format("output '{}': expected finite numbers, found others", name));
      }
      table.values[row * table.num_columns + column] = value;
    }
  }
  return table;
}

std::vector<size_t> BestRows(const OnnxDescription& description, size_t num_rows,
                             const std::vector<float>& scores) {
  std::vector<size_t> rows(num_rows);
  std::iota(rows.begin(), rows.end(), size_t{0});
  const auto max_num = static_cast<size_t>(description.max_num);
  if (!scores.empty()) {
    std::erase_if(rows, [&](size_t i) { return !(scores[i] >= description.min_score); });
    if (rows.size() > max_num) {
      std::stable_sort(rows.begin(), rows.end(),
                       [&](size_t a, size_t b) { return scores[a] > scores[b]; });
    }
  }
  if (rows.size() > max_num) rows.resize(max_num);
  std::sort(rows.begin(), rows.end());
  return rows;
}

}  // namespace holba
