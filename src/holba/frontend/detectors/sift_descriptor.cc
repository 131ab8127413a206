// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/sift_descriptor.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace holba {
namespace {

constexpr int kNumCells = 4, kNumDirections = 8;
// Width of a cell in scales, and the window's deviation in cells.
constexpr double kCellScales = 3.0, kWindowCells = 2.0;
// No single gradient may say more.
constexpr float kMaxValue = 0.2f;

void Normalise(SiftDescriptor* values) {
  double squares = 0.0;
  for (const float value : *values) squares += static_cast<double>(value) * value;
  if (!(squares > 0.0)) return;
  const auto factor = static_cast<float>(1.0 / std::sqrt(squares));
  for (float& value : *values) value *= factor;
}

// Where slope * t + offset lies within +-limit: shortens [first, last].
void Within(double slope, double offset, double limit, double* first, double* last) {
  if (std::abs(slope) < 1e-9) {
    if (std::abs(offset) >= limit) *last = *first - 1.0;
    return;
  }
  const double a = (-limit - offset) / slope, b = (limit - offset) / slope;
  *first = std::max(*first, std::min(a, b));
  *last = std::min(*last, std::max(a, b));
}

}  // namespace

SiftDescriptor SiftDescriber::Describe(const cv::Mat& image, double x, double y, double sigma,
                                       double angle_rad) {
  const double cell = kCellScales * sigma;
  const double cosine = std::cos(angle_rad) / cell, sine = std::sin(angle_rad) / cell;
  // Samples within half a cell of the outermost ones count in them.
  constexpr double kLimit = 0.5 * (kNumCells + 1);
  const int radius = static_cast<int>(std::numbers::sqrt2 * kLimit * cell + 0.5);
  const int middle_x = static_cast<int>(std::lround(x)),
            middle_y = static_cast<int>(std::lround(y));
  const int first_x = std::max(1, middle_x - radius);
  const int last_x = std::min(image.cols - 2, middle_x + radius);
  const int first_y = std::max(1, middle_y - radius);
  const int last_y = std::min(image.rows - 2, middle_y + radius);
  SiftDescriptor values = {};
  if (last_x < first_x || last_y < first_y) return values;

  const auto num_columns = static_cast<size_t>(last_x - first_x + 1);
  const double factor = -0.5 / (kWindowCells * kWindowCells * cell * cell);
  weight_x_.resize(num_columns);
  for (size_t i = 0; i < num_columns; ++i) {
    const double d = first_x + static_cast<double>(i) - x;
    weight_x_[i] = static_cast<float>(std::exp(factor * d * d));
  }
  const size_t most = num_columns * static_cast<size_t>(last_y - first_y + 1);
  for (std::vector<float>* each : {&dx_, &dy_, &column_, &row_, &weight_, &magnitude_, &angle_}) {
    if (each->size() < most) each->resize(most);
  }
  size_t size = 0;
  for (int v = first_y; v <= last_y; ++v) {
    const double d = v - y;
    double first = first_x - x, last = last_x - x;
    Within(cosine, sine * d, kLimit, &first, &last);
    Within(-sine, cosine * d, kLimit, &first, &last);
    const int from = std::max(first_x, static_cast<int>(std::ceil(x + first)));
    const int num = std::min(last_x, static_cast<int>(std::floor(x + last))) - from + 1;
    if (num < 1) continue;
    const float* above = image.ptr<float>(v - 1) + from;
    const float* here = image.ptr<float>(v) + from;
    const float* below = image.ptr<float>(v + 1) + from;
    const float* weight_x = weight_x_.data() + (from - first_x);
    const auto weight_y = static_cast<float>(std::exp(factor * d * d));
    // Cells count from -0.5 in the middle of the first one: 0 is half a cell outside.
    const auto column_0 = static_cast<float>(cosine * (from - x) + sine * d + kLimit);
    const auto row_0 = static_cast<float>(-sine * (from - x) + cosine * d + kLimit);
    const auto step_column = static_cast<float>(cosine), step_row = static_cast<float>(-sine);
    float *dx = dx_.data() + size, *dy = dy_.data() + size, *weight = weight_.data() + size;
    float *column = column_.data() + size, *row = row_.data() + size;
    for (int i = 0; i < num; ++i) {
      dx[i] = here[i + 1] - here[i - 1];
      dy[i] = below[i] - above[i];
      weight[i] = weight_y * weight_x[i];
      column[i] = column_0 + step_column * static_cast<float>(i);
      row[i] = row_0 + step_row * static_cast<float>(i);
    }
    size += static_cast<size_t>(num);
  }
  if (size == 0) return values;

  const int num_samples = static_cast<int>(size);
  const cv::Mat gx(1, num_samples, CV_32FC1, dx_.data()), gy(1, num_samples, CV_32FC1, dy_.data());
  cv::Mat magnitude(1, num_samples, CV_32FC1, magnitude_.data());
  cv::Mat angle(1, num_samples, CV_32FC1, angle_.data());
  cv::cartToPolar(gx, gy, magnitude, angle, true);
  // With a rim that takes what lies outside of the cells.
  constexpr int kWithRim = kNumCells + 2;
  float histogram[kWithRim][kWithRim][kNumDirections] = {};
  const auto turn = static_cast<float>(angle_rad * kNumDirections / (2.0 * std::numbers::pi));
  for (size_t i = 0; i < size; ++i) {
    // Rounding may put a sample of the limit just beyond it.
    const float column = std::clamp(column_[i], 0.0f, kWithRim - 1.001f);
    const float row = std::clamp(row_[i], 0.0f, kWithRim - 1.001f);
    float direction = turn - angle_[i] * (kNumDirections / 360.0f);
    direction -= kNumDirections * std::floor(direction * (1.0f / kNumDirections));
    const int c = static_cast<int>(column), r = static_cast<int>(row);
    const int o = static_cast<int>(direction);
    const float fc = column - static_cast<float>(c), fr = row - static_cast<float>(r);
    const float fo = direction - static_cast<float>(o);
    const int o0 = o & (kNumDirections - 1), o1 = (o + 1) & (kNumDirections - 1);
    const float amount = weight_[i] * magnitude_[i];
    const float upper = amount * (1.0f - fr), lower = amount * fr;
    const float v00 = upper * (1.0f - fc), v01 = upper * fc;
    const float v10 = lower * (1.0f - fc), v11 = lower * fc;
    histogram[r][c][o0] += v00 * (1.0f - fo);
    histogram[r][c][o1] += v00 * fo;
    histogram[r][c + 1][o0] += v01 * (1.0f - fo);
    histogram[r][c + 1][o1] += v01 * fo;
    histogram[r + 1][c][o0] += v10 * (1.0f - fo);
    histogram[r + 1][c][o1] += v10 * fo;
    histogram[r + 1][c + 1][o0] += v11 * (1.0f - fo);
    histogram[r + 1][c + 1][o1] += v11 * fo;
  }
  for (int r = 0; r < kNumCells; ++r) {
    for (int c = 0; c < kNumCells; ++c) {
      std::copy_n(histogram[r + 1][c + 1], kNumDirections,
                  values.begin() + kNumDirections * (kNumCells * r + c));
    }
  }
  Normalise(&values);
  for (float& value : values) value = std::min(value, kMaxValue);
  Normalise(&values);
  return values;
}

}  // namespace holba
