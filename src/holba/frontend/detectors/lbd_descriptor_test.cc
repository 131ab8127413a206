// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/lbd_descriptor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/detectors/segment_testing.h"
#include "holba/scene/image_features.h"

namespace holba {
namespace {

using Descriptor = Eigen::Matrix<float, kSegmentDescriptorSize, 1>;

constexpr int kWidth = 260, kHeight = 220;
constexpr double kSigmaPx = 0.5;

// Overlapping fields of different brightness.
double Scene(const Eigen::Vector2d& p) {
  static const Rectangle fields[] = {{{110.0, 100.0}, {50.0, 35.0}, 0.2},
                                     {{150.0, 120.0}, {40.0, 20.0}, 0.9},
                                     {{90.0, 130.0}, {14.0, 25.0}, -0.3},
                                     {{140.0, 80.0}, {8.0, 9.0}, 0.5}};
  constexpr double kBrightness[] = {50.0, 30.0, 25.0, -30.0};
  double value = 60.0;
  for (int i = 0; i < 4; ++i) value += kBrightness[i] * fields[i].At(p);
  return value;
}

// Sides of the first two fields, oriented.
std::vector<LineSegment2d> Segments() {
  std::vector<LineSegment2d> segments;
  for (const Rectangle& field : {Rectangle{{110.0, 100.0}, {50.0, 35.0}, 0.2},
                                 Rectangle{{150.0, 120.0}, {40.0, 20.0}, 0.9}}) {
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector2d a = field.Corner(i), b = field.Corner((i + 1) % 4);
      segments.push_back({a + 0.05 * (b - a), b - 0.05 * (b - a)});
    }
  }
  return segments;
}

std::vector<Descriptor> Describe(const GreyImage& image,
                                 const std::vector<LineSegment2d>& segments) {
  const std::vector<float> values = DescribeSegments(GradientImage(image, kSigmaPx), segments);
  EXPECT_EQ(values.size(), segments.size() * kSegmentDescriptorSize);
  std::vector<Descriptor> descriptors;
  for (size_t i = 0; i < segments.size(); ++i)
    descriptors.emplace_back(Eigen::Map<const Descriptor>(&values[i * kSegmentDescriptorSize]));
  return descriptors;
}

// The segments described in the scene and in one seen differently: the same ones are at most
// `most` apart, and nearer than any other two.
void ExpectSame(const GreyImage& image, const std::vector<LineSegment2d>& segments, float most) {
  const auto before = Describe(Picture(kWidth, kHeight, 0.0, Scene), Segments());
  const auto after = Describe(image, segments);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(after[i].norm(), 1.0f, 1e-5f);
    const float same = (before[i] - after[i]).norm();
    EXPECT_LT(same, most);
    for (size_t j = 0; j < before.size(); ++j) {
      if (j != i) {
        EXPECT_GT((before[i] - after[j]).norm(), same);
      }
    }
  }
}

TEST(LbdDescriptor, SaysTheSameWhenBrightnessIsScaledAndShifted) {
  ExpectSame(
      Picture(kWidth, kHeight, 0.0, [](const Eigen::Vector2d& p) { return 30.0 + 1.3 * Scene(p); }),
      Segments(), 0.03f);
}

TEST(LbdDescriptor, SaysTheSameInAShiftedImage) {
  const Eigen::Vector2d shift(17.3, -9.6);
  std::vector<LineSegment2d> segments = Segments();
  for (LineSegment2d& segment : segments) segment = {segment.start + shift, segment.end + shift};
  ExpectSame(
      Picture(kWidth, kHeight, 0.0, [&](const Eigen::Vector2d& p) { return Scene(p - shift); }),
      segments, 0.12f);
}

TEST(LbdDescriptor, SaysMuchTheSameInATurnedImage) {
  const Eigen::Rotation2Dd turn(0.5);
  const Eigen::Vector2d centre(120.0, 110.0);
  std::vector<LineSegment2d> segments = Segments();
  for (LineSegment2d& segment : segments)
    segment = {turn * (segment.start - centre) + centre, turn * (segment.end - centre) + centre};
  ExpectSame(Picture(kWidth, kHeight, 0.0,
                     [&](const Eigen::Vector2d& p) {
                       return Scene(turn.inverse() * (p - centre) + centre);
                     }),
             segments, 0.15f);
}

TEST(LbdDescriptor, TellsTheTwoDirectionsOfASegmentApart) {
  const std::vector<LineSegment2d> segments = Segments();
  std::vector<LineSegment2d> turned;
  for (const LineSegment2d& segment : segments) turned.push_back({segment.end, segment.start});
  const GreyImage image = Picture(kWidth, kHeight, 0.0, Scene);
  const auto one = Describe(image, segments), other = Describe(image, turned);
  for (size_t i = 0; i < one.size(); ++i) EXPECT_GT((one[i] - other[i]).norm(), 0.8f);
}

TEST(LbdDescriptor, IsZeroWhereNothingIsSeen) {
  const GreyImage image = Picture(60, 50, 0.0, [](const Eigen::Vector2d&) { return 80.0; });
  const auto descriptors = Describe(image, {{{10, 10}, {40, 30}}});
  EXPECT_EQ(descriptors[0].norm(), 0.0f);
}

}  // namespace
}  // namespace holba
