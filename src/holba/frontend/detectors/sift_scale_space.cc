// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/sift_scale_space.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace holba {
namespace {

// Blur of a photograph as it is taken, pixels.
constexpr double kCameraSigma = 0.5;
// Extrema of the samples below this share of the threshold do not reach it between the samples.
constexpr double kSampleShare = 0.8;
constexpr int kMaxNumMoves = 5;
// The parabola's vertex: beyond this the next sample is nearer; beyond the second it is no vertex.
constexpr double kMoveBeyond = 0.6, kMaxOffset = 1.5;
constexpr int kNumBins = 36;
constexpr double kPeakShare = 0.8;
constexpr int kMaxNumPeaks = 4;

// Twice the size: samples stay where they are, those between are means, so that x of the image is
// 2 x of the result.
cv::Mat Double(const cv::Mat& image) {
  const int width = image.cols, height = image.rows;
  cv::Mat result(2 * height, 2 * width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    const float* in = image.ptr<float>(y);
    float* out = result.ptr<float>(2 * y);
    for (int x = 0; x + 1 < width; ++x) {
      out[2 * x] = in[x];
      out[2 * x + 1] = 0.5f * (in[x] + in[x + 1]);
    }
    out[2 * width - 2] = out[2 * width - 1] = in[width - 1];
  }
  for (int y = 0; y < height; ++y) {
    const float* above = result.ptr<float>(2 * y);
    const float* below = result.ptr<float>(std::min(2 * y + 2, 2 * height - 2));
    float* out = result.ptr<float>(2 * y + 1);
    for (int x = 0; x < 2 * width; ++x) out[x] = 0.5f * (above[x] + below[x]);
  }
  return result;
}

cv::Mat Halve(const cv::Mat& image) {
  cv::Mat result((image.rows + 1) / 2, (image.cols + 1) / 2, CV_32FC1);
  for (int y = 0; y < result.rows; ++y) {
    const float* in = image.ptr<float>(2 * y);
    float* out = result.ptr<float>(y);
    for (int x = 0; x < result.cols; ++x) out[x] = in[2 * x];
  }
  return result;
}

void Blur(const cv::Mat& image, double sigma, cv::Mat* result) {
  cv::GaussianBlur(image, *result, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
}

// One octave: Gaussians 0 to resolution + 2, differences of neighbours.
class Octave {
 public:
  Octave(const ScaleSpaceOptions& options, const cv::Mat& first)
      : options_(options), gaussians_(options.octave_resolution + 3) {
    gaussians_[0] = first;
    const double step = std::exp2(1.0 / options.octave_resolution);
    for (size_t i = 1; i < gaussians_.size(); ++i) {
      const double before = kScaleSpaceSigma * std::pow(step, static_cast<double>(i - 1));
      Blur(gaussians_[i - 1], before * std::sqrt(step * step - 1.0), &gaussians_[i]);
    }
  }

  // The blur is that of the next octave's first level.
  cv::Mat NextFirst() const { return Halve(gaussians_[options_.octave_resolution]); }

  void Find(int octave, std::vector<ScaleSpacePoint>* points) {
    const int width = gaussians_[0].cols, height = gaussians_[0].rows;
    if (width < 3 || height < 3) return;
    // Three at a time.
    for (int i = 0; i < 2; ++i) differences_[i] = gaussians_[i + 1] - gaussians_[i];
    for (int level = 1; level <= options_.octave_resolution; ++level) {
      differences_[(level + 1) % 3] = gaussians_[level + 2] - gaussians_[level + 1];
      for (int y = 1; y + 1 < height; ++y) FindInRow(octave, level, y, points);
    }
  }

 private:
  const cv::Mat& Difference(int level) const { return differences_[level % 3]; }
  double Threshold() const { return 255.0 * options_.peak_threshold; }

  void FindInRow(int octave, int level, int y, std::vector<ScaleSpacePoint>* points) {
    const auto threshold = static_cast<float>(kSampleShare * Threshold());
    const float* rows[3][3];
    for (int l = 0; l < 3; ++l) {
      for (int r = 0; r < 3; ++r) rows[l][r] = Difference(level + l - 1).ptr<float>(y + r - 1);
    }
    const float* row = rows[1][1];
    const int end = gaussians_[0].cols - 1;
    for (int x = 1; x < end; ++x) {
      const float value = row[x];
      const bool is_high = value >= threshold && value > row[x - 1] && value > row[x + 1];
      const bool is_low = value <= -threshold && value < row[x - 1] && value < row[x + 1];
      if (!is_high && !is_low) continue;
      bool is_extremum = true;
      for (int l = 0; l < 3 && is_extremum; ++l) {
        for (int r = 0; r < 3 && is_extremum; ++r) {
          const float* p = rows[l][r] + x - 1;
          for (int k = 0; k < 3; ++k) {
            if (l == 1 && r == 1 && k == 1) continue;
            is_extremum = is_extremum && (is_high ? value > p[k] : value < p[k]);
          }
        }
      }
      if (is_extremum) Refine(octave, level, x, y, points);
    }
  }

  // The vertex of the parabola through the samples; moves from pixel to pixel, not between levels.
  void Refine(int octave, int level, int x, int y, std::vector<ScaleSpacePoint>* points) {
    const int width = gaussians_[0].cols, height = gaussians_[0].rows;
    Eigen::Vector3d gradient, offset;
    Eigen::Matrix3d hessian;
    double value = 0.0;
    for (int i = 0; i < kMaxNumMoves; ++i) {
      const auto at = [&](int dx, int dy, int dl) {
        return static_cast<double>(Difference(level + dl).ptr<float>(y + dy)[x + dx]);
      };
      value = at(0, 0, 0);
      gradient = 0.5 * Eigen::Vector3d(at(1, 0, 0) - at(-1, 0, 0), at(0, 1, 0) - at(0, -1, 0),
                                       at(0, 0, 1) - at(0, 0, -1));
      const double xx = at(1, 0, 0) + at(-1, 0, 0) - 2.0 * value;
      const double yy = at(0, 1, 0) + at(0, -1, 0) - 2.0 * value;
      const double ll = at(0, 0, 1) + at(0, 0, -1) - 2.0 * value;
      const double xy = 0.25 * (at(1, 1, 0) + at(-1, -1, 0) - at(-1, 1, 0) - at(1, -1, 0));
      const double xl = 0.25 * (at(1, 0, 1) + at(-1, 0, -1) - at(-1, 0, 1) - at(1, 0, -1));
      const double yl = 0.25 * (at(0, 1, 1) + at(0, -1, -1) - at(0, -1, 1) - at(0, 1, -1));
      hessian << xx, xy, xl, xy, yy, yl, xl, yl, ll;
      Eigen::Matrix3d inverse;
      bool is_invertible = false;
      hessian.computeInverseWithCheck(inverse, is_invertible, 1e-12);
      if (!is_invertible) return;
      offset = -inverse * gradient;
      const auto move = [](double by, int position, int size) {
        if (by > kMoveBeyond && position < size - 2) return 1;
        return by < -kMoveBeyond && position > 1 ? -1 : 0;
      };
      const int move_x = move(offset.x(), x, width), move_y = move(offset.y(), y, height);
      if (move_x == 0 && move_y == 0) break;
      x += move_x;
      y += move_y;
    }
    const double trace = hessian(0, 0) + hessian(1, 1);
    const double determinant = hessian(0, 0) * hessian(1, 1) - hessian(0, 1) * hessian(0, 1);
    const double edge = options_.edge_threshold + 1.0;
    const double peak = value + 0.5 * gradient.dot(offset);
    if (!(determinant > 0.0) ||
        !(trace * trace / determinant < edge * edge / options_.edge_threshold) ||
        !(std::abs(peak) > Threshold()) || !(offset.cwiseAbs().maxCoeff() < kMaxOffset))
      return;
    const double at_x = x + offset.x(), at_y = y + offset.y(), at_level = level + offset.z();
    if (!(at_x >= 0.0 && at_x <= width - 1 && at_y >= 0.0 && at_y <= height - 1)) return;
    if (!(at_level >= 0.0 && at_level <= options_.octave_resolution + 1)) return;
    const double sigma = kScaleSpaceSigma * std::exp2(at_level / options_.octave_resolution);
    ScaleSpacePoint point;
    point.octave = octave;
    point.level = level;
    point.x = std::ldexp(at_x, octave);
    point.y = std::ldexp(at_y, octave);
    point.sigma_px = std::ldexp(sigma, octave);
    const std::vector<double> angles = options_.upright ? std::vector<double>{options_.upright_rad}
                                                        : Orientations(level, at_x, at_y, sigma);
    for (const double angle_rad : angles) {
      point.angle_rad = angle_rad;
      point.descriptor = describer_.Describe(gaussians_[level], at_x, at_y, sigma, angle_rad);
      points->push_back(point);
      point.is_first = false;
    }
  }

  // Peaks of the histogram of gradient directions, ascending; not more than the option says.
  std::vector<double> Orientations(int level, double x, double y, double sigma) {
    const cv::Mat& image = gaussians_[level];
    const double window_sigma = 1.5 * sigma;
    const int radius = std::max(1, static_cast<int>(3.0 * window_sigma));
    const int middle_x = static_cast<int>(std::lround(x));
    const int middle_y = static_cast<int>(std::lround(y));
    const int first_x = std::max(1, middle_x - radius);
    const int last_x = std::min(image.cols - 2, middle_x + radius);
    const int first_y = std::max(1, middle_y - radius);
    const int last_y = std::min(image.rows - 2, middle_y + radius);
    const int count = last_x - first_x + 1;
    if (count < 1 || last_y < first_y) return {};
    weight_x_.resize(static_cast<size_t>(count));
    const double factor = -0.5 / (window_sigma * window_sigma);
    for (int i = 0; i < count; ++i) {
      const double d = first_x + i - x;
      weight_x_[i] = static_cast<float>(std::exp(factor * d * d));
    }
    const size_t most = static_cast<size_t>(count) * (last_y - first_y + 1);
    for (std::vector<float>* each : {&dx_, &dy_, &weight_, &angle_, &magnitude_}) {
      if (each->size() < most) each->resize(most);
    }
    size_t size = 0;
    const double farthest = radius * radius + 0.6;
    for (int row = first_y; row <= last_y; ++row) {
      const double d = row - y;
      // The part of the row within the circle.
      const double half = farthest - d * d;
      if (half < 0.0) continue;
      const double reach = std::sqrt(half);
      const int from = std::max(first_x, static_cast<int>(std::ceil(x - reach)));
      const int num = std::min(last_x, static_cast<int>(std::floor(x + reach))) - from + 1;
      if (num < 1) continue;
      const float* above = image.ptr<float>(row - 1) + from;
      const float* here = image.ptr<float>(row) + from;
      const float* below = image.ptr<float>(row + 1) + from;
      const float* weight_x = weight_x_.data() + (from - first_x);
      const auto weight_y = static_cast<float>(std::exp(factor * d * d));
      float *dx = dx_.data() + size, *dy = dy_.data() + size, *weight = weight_.data() + size;
      for (int i = 0; i < num; ++i) {
        dx[i] = here[i + 1] - here[i - 1];
        dy[i] = below[i] - above[i];
        weight[i] = weight_y * weight_x[i];
      }
      size += static_cast<size_t>(num);
    }
    std::array<float, kNumBins> histogram = {};
    if (size == 0) return {};
    const int num_samples = static_cast<int>(size);
    const cv::Mat gx(1, num_samples, CV_32FC1, dx_.data()),
        gy(1, num_samples, CV_32FC1, dy_.data());
    cv::Mat magnitude(1, num_samples, CV_32FC1, magnitude_.data());
    cv::Mat angle(1, num_samples, CV_32FC1, angle_.data());
    cv::cartToPolar(gx, gy, magnitude, angle, true);
    for (size_t i = 0; i < size; ++i) {
      // From half a bin below 0 to half a bin below 360 degrees, one bin further up.
      const float bin = angle_[i] * (kNumBins / 360.0f) + 0.5f;
      const int upper = static_cast<int>(bin);
      const float share = bin - static_cast<float>(upper);
      const float amount = weight_[i] * magnitude_[i];
      histogram[static_cast<size_t>(upper == 0 ? kNumBins - 1 : upper - 1)] +=
          (1.0f - share) * amount;
      histogram[static_cast<size_t>(upper >= kNumBins ? upper - kNumBins : upper)] +=
          share * amount;
    }
    for (int pass = 0; pass < 6; ++pass) {
      const std::array<float, kNumBins> before = histogram;
      for (int i = 0; i < kNumBins; ++i) {
        histogram[i] =
            (before[(i + kNumBins - 1) % kNumBins] + before[i] + before[(i + 1) % kNumBins]) / 3.0f;
      }
    }
    const float highest = *std::max_element(histogram.begin(), histogram.end());
    std::vector<double> angles;
    for (int i = 0; i < kNumBins; ++i) {
      const double value = histogram[i], before = histogram[(i + kNumBins - 1) % kNumBins],
                   after = histogram[(i + 1) % kNumBins];
      if (!(value > kPeakShare * highest && value > before && value > after)) continue;
      const double vertex = -0.5 * (after - before) / (after + before - 2.0 * value);
      angles.push_back(2.0 * std::numbers::pi * (i + vertex + 0.5) / kNumBins);
      if (static_cast<int>(angles.size()) == std::min(options_.max_num_orientations, kMaxNumPeaks))
        break;
    }
    return angles;
  }

  const ScaleSpaceOptions& options_;
  std::vector<cv::Mat> gaussians_;
  cv::Mat differences_[3];  // of level i and the next one: i % 3
  std::vector<float> dx_, dy_, weight_, angle_, magnitude_, weight_x_;
  SiftDescriber describer_;
};

}  // namespace

std::vector<ScaleSpacePoint> FindScaleSpacePoints(const ScaleSpaceOptions& options,
                                                  const cv::Mat& image) {
  std::vector<ScaleSpacePoint> points;
  cv::Mat first;
  image.convertTo(first, CV_32F);
  int octave = 0;
  double sigma = kCameraSigma;
  if (options.first_octave < 0) {
    first = Double(first);
    octave = -1;
    sigma *= 2.0;
  }
  Blur(first, std::sqrt(kScaleSpaceSigma * kScaleSpaceSigma - sigma * sigma), &first);
  const int end = options.first_octave + options.num_octaves;
  while (octave < end && std::min(first.rows, first.cols) >= 3) {
    Octave images(options, first);
    if (octave >= options.first_octave) images.Find(octave, &points);
    first = images.NextFirst();
    ++octave;
  }
  return points;
}

}  // namespace holba
