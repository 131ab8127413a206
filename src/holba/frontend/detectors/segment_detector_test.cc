// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/segment_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/frontend/detectors/segment_lsd.h"
#include "holba/frontend/detectors/segment_refinement.h"
#include "holba/frontend/detectors/segment_testing.h"

namespace holba {
namespace {

using ::testing::HasSubstr;

// What is found of the four sides of a rectangle.
struct Found {
  double bias_px = 0.0;  // mean signed distance of the ends, towards the inside
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // in x and y that explains the distances best
  double rms_px = 0.0;
  int num_sides = 0;
};

Found Measure(double noise, double scale, bool refine) {
  Eigen::Matrix2d normal_matrix = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right_side = Eigen::Vector2d::Zero();
  Found found;
  double squares = 0;
  int num_ends = 0;
  for (int i = 0; i < 12; ++i) {
    const Rectangle rectangle{{100.3 + 0.13 * i, 79.6 - 0.21 * i}, {55.0, 38.0}, 0.11 + 0.13 * i};
    const GreyImage image = Picture(
        200, 160, noise, [&](const Eigen::Vector2d& p) { return 60.0 + 120.0 * rectangle.At(p); });
    SegmentOptions options;
    options.lsd_scale = scale;
    std::vector<LineSegment2d> segments = DetectWithLsd(options, image);
    const GradientImage gradients(image, 0.5);
    OrientSegments(gradients, &segments);
    for (int side = 0; side < 4; ++side) {
      const Eigen::Vector2d a = rectangle.Corner(side), b = rectangle.Corner((side + 1) % 4);
      // The rectangle is to the positive side.
      const LineSegment2d truth{a, b};
      for (LineSegment2d segment : segments) {
        if (segment.Length() < 0.6 * truth.Length() ||
            std::abs(truth.Line().dot(segment.start.homogeneous())) > 2.0 ||
            std::abs(truth.Line().dot(segment.end.homogeneous())) > 2.0)
          continue;
        EXPECT_GT((segment.end - segment.start).dot(b - a), 0.0) << "brighter side";
        ++found.num_sides;
        if (refine) {
          const auto refined = RefineSegment(gradients, segment);
          EXPECT_TRUE(refined.has_value());
          segment = refined.value_or(segment);
        }
        for (const Eigen::Vector2d& end : {segment.start, segment.end}) {
          const double distance = truth.Line().dot(end.homogeneous());
          const Eigen::Vector2d normal = truth.Line().head<2>();
          normal_matrix += normal * normal.transpose();
          right_side += normal * distance;
          found.bias_px += distance;
          squares += distance * distance;
          ++num_ends;
        }
      }
    }
  }
  found.bias_px /= num_ends;
  found.rms_px = std::sqrt(squares / num_ends);
  found.shift = normal_matrix.inverse() * right_side;
  return found;
}

TEST(SegmentDetector, LsdAtAnyScalePlacesEdgesInColmapsPixels) {
  for (const double scale : {0.6, 0.8, 1.0, 1.5}) {
    SCOPED_TRACE(scale);
    const Found found = Measure(0.0, scale, false);
    EXPECT_EQ(found.num_sides, 48);
    EXPECT_LT(found.shift.cwiseAbs().maxCoeff(), 0.02);
    EXPECT_LT(std::abs(found.bias_px), 0.03);
    EXPECT_LT(found.rms_px, scale < 0.7 ? 0.08 : 0.05);
    RecordProperty("rms_px_at_" + std::to_string(scale), std::to_string(found.rms_px));
  }
}

TEST(SegmentDetector, RefinementPlacesCleanEdgesWithoutBiasAndNoisyOnesBetterThanLsd) {
  for (const double scale : {0.8, 1.5}) {
    SCOPED_TRACE(scale);
    const Found clean = Measure(0.0, scale, true);
    EXPECT_EQ(clean.num_sides, 48);
    EXPECT_LT(clean.shift.cwiseAbs().maxCoeff(), 0.01);
    EXPECT_LT(std::abs(clean.bias_px), 0.01);
    EXPECT_LT(clean.rms_px, 0.02);
  }
  const Found lsd = Measure(6.0, 0.8, false), refined = Measure(6.0, 0.8, true);
  EXPECT_LT(refined.shift.cwiseAbs().maxCoeff(), 0.015);
  EXPECT_LT(refined.rms_px, lsd.rms_px);
  EXPECT_LT(refined.rms_px, 0.06);
}

TEST(SegmentDetector, RefinementMovesASegmentBackOntoItsEdgeButNotToAnother) {
  const Rectangle rectangle{{100.0, 80.0}, {60.0, 40.0}, 0.2};
  const GreyImage image = Picture(
      200, 160, 2.0, [&](const Eigen::Vector2d& p) { return 60.0 + 120.0 * rectangle.At(p); });
  const GradientImage gradients(image, 0.5);
  const Eigen::Vector2d a = rectangle.Corner(0), b = rectangle.Corner(1);
  const LineSegment2d truth{a, b};
  const Eigen::Vector2d across = truth.Line().head<2>();
  const LineSegment2d moved{a + 0.1 * (b - a) + 0.5 * across, a + 0.9 * (b - a) - 0.3 * across};
  const auto refined = RefineSegment(gradients, moved);
  ASSERT_TRUE(refined);
  EXPECT_NEAR(truth.Line().dot(refined->start.homogeneous()), 0.0, 0.03);
  EXPECT_NEAR(truth.Line().dot(refined->end.homogeneous()), 0.0, 0.03);
  // The ends stay where they are along the segment.
  const Eigen::Vector2d along = (moved.end - moved.start).normalized();
  EXPECT_NEAR((refined->start - moved.start).dot(along), 0.0, 1e-6);
  EXPECT_NEAR((refined->end - moved.end).dot(along), 0.0, 1e-6);

  const LineSegment2d beside{moved.start + 3.0 * across, moved.end + 3.0 * across};
  EXPECT_FALSE(RefineSegment(gradients, beside));
  // Turned against its orientation: the gradient has no maximum there, only a minimum.
  EXPECT_FALSE(RefineSegment(gradients, {moved.end, moved.start}));
}

TEST(SegmentDetector, UnknownDetectorsAreRefusedByName) {
  EXPECT_EQ(FindSegmentDetector("lsd").name, "lsd");
  try {
    FindSegmentDetector("canny");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("canny"));
    EXPECT_THAT(error.what(), HasSubstr("lsd"));
  }
}

}  // namespace
}  // namespace holba
