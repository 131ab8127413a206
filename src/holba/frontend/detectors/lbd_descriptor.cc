// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/lbd_descriptor.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

#include "holba/scene/image_features.h"

namespace holba {
namespace {

constexpr int kNumBands = 9, kBandWidthPx = 5;
constexpr int kNumRows = kNumBands * kBandWidthPx;
static_assert(kNumBands * 8 == kSegmentDescriptorSize);
// Longer segments are sampled every second pixel, shorter ones this often.
constexpr int kMinSamples = 24;
// Larger values, of a unit vector, are cut: a single strong edge must not rule.
constexpr float kLargestValue = 0.4f;

struct RowWeights {
  std::array<float, kNumRows> global;  // by the distance from the segment
  // Rows of a band and of its two neighbours, by the distance from the band's middle.
  std::array<float, 3 * kBandWidthPx> local;
};

RowWeights MakeRowWeights() {
  RowWeights weights;
  for (int row = 0; row < kNumRows; ++row) {
    const float d = static_cast<float>(row - kNumRows / 2) / (0.5f * (kNumRows - 1));
    weights.global[row] = std::exp(-0.5f * d * d);
  }
  for (int row = 0; row < 3 * kBandWidthPx; ++row) {
    const float d =
        static_cast<float>(row - 3 * kBandWidthPx / 2) / static_cast<float>(kBandWidthPx);
    weights.local[row] = std::exp(-0.5f * d * d);
  }
  return weights;
}

void Describe(const GradientImage& gradients, const RowWeights& weights,
              const LineSegment2d& segment, float* descriptor) {
  using Row = Eigen::Array4f;
  const double length = segment.Length();
  const Eigen::Vector2f along = ((segment.end - segment.start) / length).cast<float>();
  const Eigen::Vector2f normal(-along.y(), along.x());
  const int num_samples = std::max(kMinSamples, static_cast<int>(0.5 * length));
  const Eigen::Vector2f step =
      ((segment.end - segment.start) / static_cast<double>(num_samples)).cast<float>();
  const Eigen::Vector2f first = segment.start.cast<float>() + 0.5f * step;

  // Sums over a row of the gradient's four signs: across, against across, along, against along.
  std::array<Row, kNumRows> rows;
  for (int row = 0; row < kNumRows; ++row) {
    Eigen::Vector2f p = first + static_cast<float>(row - kNumRows / 2) * normal;
    float across_sum = 0, across_abs = 0, along_sum = 0, along_abs = 0;
    for (int i = 0; i < num_samples; ++i, p += step) {
      const Eigen::Vector2f& g = gradients.Nearest(p.x(), p.y());
      const float across = g.dot(normal), parallel = g.dot(along);
      across_sum += across;
      across_abs += std::abs(across);
      along_sum += parallel;
      along_abs += std::abs(parallel);
    }
    const float scale = 0.5f * weights.global[row] / static_cast<float>(num_samples);
    rows[row] = scale * Row(across_abs + across_sum, across_abs - across_sum, along_abs + along_sum,
                            along_abs - along_sum);
  }

  // Mean and standard deviation of each sum in a band and its neighbours.
  Eigen::Map<Eigen::Array<float, 8, kNumBands>> bands(descriptor);
  for (int band = 0; band < kNumBands; ++band) {
    Row sum = Row::Zero(), squares = Row::Zero();
    float total = 0.0f;
    for (int k = 0; k < 3 * kBandWidthPx; ++k) {
      const int row = (band - 1) * kBandWidthPx + k;
      if (row < 0 || row >= kNumRows) continue;
      sum += weights.local[k] * rows[row];
      total += weights.local[k];
    }
    const Row mean = sum / total;
    for (int k = 0; k < 3 * kBandWidthPx; ++k) {
      const int row = (band - 1) * kBandWidthPx + k;
      if (row < 0 || row >= kNumRows) continue;
      squares += weights.local[k] * (rows[row] - mean).square();
    }
    bands.col(band).head<4>() = mean;
    bands.col(band).tail<4>() = (squares / total).sqrt();
  }
  // Means and deviations weigh the same.
  for (int half = 0; half < 2; ++half) {
    auto part = bands.middleRows<4>(4 * half);
    const float norm = part.matrix().norm();
    if (norm > 0.0f) part /= norm;
  }
  Eigen::Map<Eigen::Matrix<float, kSegmentDescriptorSize, 1>> all(descriptor);
  if (!(all.norm() > 0.0f)) return;
  all.normalize();
  all = all.cwiseMin(kLargestValue);
  all.normalize();
}

}  // namespace

std::vector<float> DescribeSegments(const GradientImage& gradients,
                                    const std::vector<LineSegment2d>& segments) {
  static const RowWeights weights = MakeRowWeights();
  std::vector<float> descriptors(segments.size() * kSegmentDescriptorSize, 0.0f);
  for (size_t i = 0; i < segments.size(); ++i)
    Describe(gradients, weights, segments[i], &descriptors[i * kSegmentDescriptorSize]);
  return descriptors;
}

}  // namespace holba
