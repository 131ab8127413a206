// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/corner_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/detectors/segment_testing.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace {

// Index of the corner nearest to a position.
size_t Nearest(const Corners& corners, const Eigen::Vector2d& position) {
  size_t best = 0;
  for (size_t i = 1; i < corners.positions.size(); ++i) {
    if ((corners.positions[i] - position).norm() < (corners.positions[best] - position).norm())
      best = i;
  }
  return best;
}

// Four fields that meet in one point: a corner that no blur moves.
double Saddle(const Eigen::Vector2d& d, double angle_rad) {
  const Eigen::Vector2d along(std::cos(angle_rad), std::sin(angle_rad));
  const double u = BlurredStep(d.dot(along));
  const double v = BlurredStep(d.x() * -along.y() + d.y() * along.x());
  return u * v + (1.0 - u) * (1.0 - v);
}

TEST(CornerDetector, PlacesCornersInColmapsPixelsWithoutBias) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0;
  int count = 0;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d truth(40.0 + 0.37 * i, 41.0 - 0.23 * i);
    const GreyImage image = Picture(80, 80, 1.0, [&](const Eigen::Vector2d& p) {
      return 60.0 + 120.0 * Saddle(p - truth, 0.1 + 0.08 * i);
    });
    const Corners corners = DetectCorners({}, image);
    ASSERT_FALSE(corners.positions.empty());
    const Eigen::Vector2d error = corners.positions[Nearest(corners, truth)] - truth;
    EXPECT_LT(error.norm(), 0.2);
    sum += error;
    squares += error.squaredNorm();
    ++count;
  }
  EXPECT_LT((sum / count).cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT(std::sqrt(squares / count), 0.08);
}

TEST(CornerDetector, ARectangleHasCornersAtItsFourCorners) {
  const Rectangle rectangle{{60.4, 50.7}, {31.0, 22.0}, 0.3};
  const GreyImage image = Picture(
      120, 100, 0.0, [&](const Eigen::Vector2d& p) { return 60.0 + 120.0 * rectangle.At(p); });
  const Corners corners = DetectCorners({}, image);
  for (int i = 0; i < 4; ++i) {
    // Blur rounds a corner off: what is found lies a little inside.
    const Eigen::Vector2d position = corners.positions[Nearest(corners, rectangle.Corner(i))];
    EXPECT_LT((position - rectangle.Corner(i)).norm(), 0.6);
  }
}

TEST(CornerDetector, DescriptorsSurviveShiftAndBrightnessAndTellCornersApart) {
  const auto scene = [](const Eigen::Vector2d& p) {
    const Rectangle first{{60.0, 60.0}, {30.0, 20.0}, 0.2},
        second{{100.0, 80.0}, {25.0, 12.0}, 0.9};
    return 70.0 + 50.0 * first.At(p) + 40.0 * second.At(p);
  };
  const Eigen::Vector2d shift(13.0, -8.0);
  const Corners corners1 = DetectCorners({}, Picture(180, 150, 0.0, scene));
  const Corners corners2 = DetectCorners({}, Picture(180, 150, 0.0, [&](const Eigen::Vector2d& p) {
                                           return 20.0 + 1.2 * scene(p - shift);
                                         }));
  ASSERT_EQ(corners1.descriptors.size(), corners1.positions.size() * kCornerDescriptorSize);
  const auto distance = [&](size_t i, size_t j) {
    double squares = 0, norm = 0;
    for (int k = 0; k < kCornerDescriptorSize; ++k) {
      const double a = corners1.descriptors[i * kCornerDescriptorSize + k];
      const double b = corners2.descriptors[j * kCornerDescriptorSize + k];
      squares += (a - b) * (a - b);
      norm += a * a;
    }
    return std::sqrt(squares / norm);
  };
  int num_same = 0;
  for (size_t i = 0; i < corners1.positions.size(); ++i) {
    const size_t same = Nearest(corners2, corners1.positions[i] + shift);
    if ((corners2.positions[same] - corners1.positions[i] - shift).norm() > 0.3) continue;
    ++num_same;
    EXPECT_LT(distance(i, same), 0.15);
    for (size_t j = 0; j < corners2.positions.size(); ++j) {
      if ((corners2.positions[j] - corners2.positions[same]).norm() > 20.0) {
        EXPECT_GT(distance(i, j), 2.0 * distance(i, same));
      }
    }
  }
  EXPECT_GE(num_same, 5);
}

TEST(CornerDetector, AnImageWithoutStructureHasNoCorners) {
  const GreyImage image = Picture(60, 50, 0.0, [](const Eigen::Vector2d&) { return 90.0; });
  EXPECT_TRUE(DetectCorners({}, image).positions.empty());
  CornerOptions none;
  none.max_num_corners = 0;
  const GreyImage saddle = Picture(60, 50, 0.0, [](const Eigen::Vector2d& p) {
    return 200.0 * Saddle(p - Eigen::Vector2d(30, 25), 0.1);
  });
  EXPECT_TRUE(DetectCorners(none, saddle).positions.empty());
  EXPECT_FALSE(DetectCorners({}, saddle).positions.empty());
}

}  // namespace
}  // namespace holba
