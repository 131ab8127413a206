// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vanishing_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using ::testing::Each;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kWidth = 800.0, kHeight = 600.0;

Eigen::Matrix3d Calibration() {
  Eigen::Matrix3d K;
  K << 700, 0, 405, 0, 690, 295, 0, 0, 1;
  return K;
}

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return RadToDeg(std::atan2(a.cross(b).norm(), std::abs(a.dot(b))));
}

// Segments of 3D lines along given directions, seen by a camera at the origin, with Gaussian noise
// at their ends; segments without a direction are anywhere. `label` is the direction's index.
class Scene {
 public:
  explicit Scene(uint64_t seed) : random_(seed) {}

  void AddLines(const Eigen::Vector3d& direction, int count, double noise_px, int label) {
    for (int added = 0; added < count;) {
      const Eigen::Vector2d middle(random_.Uniform(0, kWidth), random_.Uniform(0, kHeight));
      const Eigen::Vector3d X =
          random_.Uniform(3, 10) * (Calibration().inverse() * middle.homogeneous());
      const double half_length = random_.Uniform(0.2, 0.8);
      const Eigen::Vector3d a = X - half_length * direction, b = X + half_length * direction;
      if (a.z() < 0.5 || b.z() < 0.5) continue;
      LineSegment2d segment = {(Calibration() * a).hnormalized(),
                               (Calibration() * b).hnormalized()};
      if (segment.Length() < 25.0) continue;
      AddNoise(noise_px, &segment.start);
      AddNoise(noise_px, &segment.end);
      segments.push_back(segment);
      labels.push_back(label);
      ++added;
    }
  }

  void AddOutliers(int count) {
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d middle(random_.Uniform(0, kWidth), random_.Uniform(0, kHeight));
      const double angle = random_.Uniform(0, std::numbers::pi);
      const Eigen::Vector2d half =
          random_.Uniform(15, 50) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      segments.push_back({middle - half, middle + half});
      labels.push_back(-1);
    }
  }

  Random* random() { return &random_; }

  std::vector<LineSegment2d> segments;
  std::vector<int> labels;

 private:
  void AddNoise(double sigma_px, Eigen::Vector2d* x) {
    if (sigma_px == 0.0) return;
    x->x() += random_.Normal(sigma_px);
    x->y() += random_.Normal(sigma_px);
  }

  Random random_;
};

Eigen::Matrix3d SomeRotation(Random* random) {
  return Eigen::Quaterniond(random->Normal(), random->Normal(), random->Normal(), random->Normal())
      .normalized()
      .toRotationMatrix();
}

// The found point nearest to a direction.
int Nearest(const VanishingPoints& found, const Eigen::Vector3d& direction) {
  int best = -1;
  for (size_t i = 0; i < found.points.size(); ++i) {
    if (best < 0 || AngleDeg(found.points[i].direction_in_cam, direction) <
                        AngleDeg(found.points[best].direction_in_cam, direction)) {
      best = static_cast<int>(i);
    }
  }
  return best;
}

TEST(VanishingPoints, OfExactLinesAreExactAndLabelEveryLine) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Scene scene(seed);
    const Eigen::Matrix3d R = SomeRotation(scene.random());
    for (int axis = 0; axis < 3; ++axis) scene.AddLines(R.col(axis), 30 - 5 * axis, 0.0, axis);
    VanishingPointOptions options;
    options.max_error_px = 0.01;  // no line of another direction
    const VanishingPoints found = DetectVanishingPoints(options, scene.segments, Calibration());
    ASSERT_THAT(found.points, SizeIs(3)) << "seed " << seed;
    size_t num_right = 0;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LT(AngleDeg(found.points[Nearest(found, R.col(axis))].direction_in_cam, R.col(axis)),
                1e-6);
    }
    for (size_t i = 0; i < scene.segments.size(); ++i) {
      ASSERT_GE(found.vp_of_segment[i], 0);
      num_right += found.vp_of_segment[i] == Nearest(found, R.col(scene.labels[i]));
    }
    // A line may point to two of them; of the exact ones its own is nearer.
    EXPECT_EQ(num_right, scene.segments.size());
  }
}

TEST(VanishingPoints, SurviveNoiseAndAsManyOutliers) {
  int num_found = 0, num_false = 0, num_labelled = 0, num_right = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Scene scene(seed);
    const Eigen::Matrix3d R = SomeRotation(scene.random());
    for (int axis = 0; axis < 3; ++axis) scene.AddLines(R.col(axis), 50, 0.3, axis);
    scene.AddOutliers(150);
    const VanishingPoints found = DetectVanishingPoints({}, scene.segments, Calibration());
    std::vector<int> true_points;
    for (int axis = 0; axis < 3; ++axis) {
      const int nearest = Nearest(found, R.col(axis));
      ASSERT_GE(nearest, 0);
      true_points.push_back(nearest);
      num_found += AngleDeg(found.points[nearest].direction_in_cam, R.col(axis)) < 1.0;
    }
    for (const ImageVanishingPoint& point : found.points) {
      double least = 90.0;
      for (int axis = 0; axis < 3; ++axis) {
        least = std::min(least, AngleDeg(point.direction_in_cam, R.col(axis)));
      }
      num_false += least > 5.0;
    }
    for (size_t i = 0; i < scene.segments.size(); ++i) {
      if (scene.labels[i] < 0) continue;
      num_labelled += found.vp_of_segment[i] >= 0;
      num_right += found.vp_of_segment[i] == true_points[scene.labels[i]];
    }
  }
  EXPECT_EQ(num_found, 30);
  EXPECT_LE(num_false, 20);  // two in an image
  // An error of an end of 1 px is four of its standard deviations (two ends: 0.3 / sqrt(2)).
  EXPECT_GE(num_labelled, 1480);
  EXPECT_GE(num_right, 1350);
}

TEST(VanishingPoints, OfRandomSegmentsAreFewerWhereLessIsLeftToChance) {
  std::vector<size_t> counts;
  for (const double max_chance : {1.0, 1e-2, 1e-6}) {
    VanishingPointOptions options;
    options.max_chance = max_chance;
    size_t count = 0;
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      Scene scene(seed);
      scene.AddOutliers(200);
      count += DetectVanishingPoints(options, scene.segments, Calibration()).points.size();
    }
    counts.push_back(count);
  }
  EXPECT_GT(counts[0], 25u);  // more than five in an image
  EXPECT_LT(counts[1], counts[0] / 2);
  EXPECT_EQ(counts[2], 0u);
}

TEST(VanishingPoints, AtInfinityOfTheImageAreFound) {
  // The directions of the image axes: their lines are parallel in the image.
  Scene scene(7);
  scene.AddLines(Eigen::Vector3d::UnitX(), 20, 0.0, 0);
  scene.AddLines(Eigen::Vector3d::UnitY(), 15, 0.0, 1);
  const VanishingPoints found = DetectVanishingPoints({}, scene.segments, Calibration());
  ASSERT_THAT(found.points, SizeIs(2));
  EXPECT_LT(AngleDeg(found.points[0].direction_in_cam, Eigen::Vector3d::UnitX()), 1e-6);
  EXPECT_LT(AngleDeg(found.points[1].direction_in_cam, Eigen::Vector3d::UnitY()), 1e-6);
  EXPECT_EQ(found.points[0].num_segments, 20u);
  EXPECT_EQ(found.points[1].num_segments, 15u);
}

TEST(VanishingPoints, AreFewerWhereFewerLinesAgree) {
  Scene scene(8);
  const Eigen::Matrix3d R = SomeRotation(scene.random());
  const Eigen::Vector3d oblique = (R.col(0) + 0.6 * R.col(1) + 0.3 * R.col(2)).normalized();
  scene.AddLines(R.col(0), 30, 0.1, 0);
  scene.AddLines(R.col(1), 6, 0.1, 1);  // enough only since it is orthogonal
  scene.AddLines(oblique, 6, 0.1, 2);
  const VanishingPoints found = DetectVanishingPoints({}, scene.segments, Calibration());
  ASSERT_THAT(found.points, SizeIs(2));
  EXPECT_LT(AngleDeg(found.points[0].direction_in_cam, R.col(0)), 0.5);
  EXPECT_LT(AngleDeg(found.points[1].direction_in_cam, R.col(1)), 1.0);
  VanishingPointOptions options;
  options.min_orthogonal_support = options.min_support;
  EXPECT_THAT(DetectVanishingPoints(options, scene.segments, Calibration()).points, SizeIs(1));
  options.min_support = options.min_orthogonal_support = 4;
  EXPECT_THAT(DetectVanishingPoints(options, scene.segments, Calibration()).points, SizeIs(3));
}

TEST(VanishingPoints, CountPiecesOfOneLineOnce) {
  Scene scene(9);
  const Eigen::Vector3d d = Eigen::Vector3d(0.9, 0.1, 0.4).normalized();
  scene.AddLines(d, 5, 0.0, 0);
  std::vector<LineSegment2d> pieces;
  for (const LineSegment2d& segment : scene.segments) {
    const Eigen::Vector2d step = (segment.end - segment.start).normalized() * 30.0;
    for (int i = 0; i < 5; ++i) {
      pieces.push_back({segment.start + 2 * i * step, segment.start + (2 * i + 1) * step});
    }
  }
  EXPECT_THAT(DetectVanishingPoints({}, pieces, Calibration()).points, IsEmpty());
  VanishingPointOptions options;
  options.min_line_distance_px = 0.0;
  EXPECT_THAT(DetectVanishingPoints(options, pieces, Calibration()).points, SizeIs(1));
}

TEST(VanishingPoints, RepeatBitForBitAndDependOnTheSeedOnly) {
  Scene scene(10);
  const Eigen::Matrix3d R = SomeRotation(scene.random());
  for (int axis = 0; axis < 3; ++axis) scene.AddLines(R.col(axis), 60, 0.3, axis);
  scene.AddOutliers(60);
  const VanishingPoints first = DetectVanishingPoints({}, scene.segments, Calibration());
  const VanishingPoints second = DetectVanishingPoints({}, scene.segments, Calibration());
  ASSERT_EQ(first.points.size(), second.points.size());
  for (size_t i = 0; i < first.points.size(); ++i) {
    EXPECT_EQ(first.points[i].direction_in_cam, second.points[i].direction_in_cam);
    EXPECT_EQ(first.points[i].num_segments, second.points[i].num_segments);
  }
  EXPECT_EQ(first.vp_of_segment, second.vp_of_segment);
}

TEST(VanishingPoints, ComeByFallingSupportWithTheirCounts) {
  Scene scene(11);
  const Eigen::Matrix3d R = SomeRotation(scene.random());
  for (int axis = 0; axis < 3; ++axis) scene.AddLines(R.col(axis), 20 + 10 * axis, 0.2, axis);
  scene.AddOutliers(40);
  const VanishingPoints found = DetectVanishingPoints({}, scene.segments, Calibration());
  std::vector<uint32_t> counts(found.points.size(), 0);
  for (const int32_t i : found.vp_of_segment) {
    ASSERT_LT(i, static_cast<int32_t>(counts.size()));
    if (i >= 0) ++counts[i];
  }
  for (size_t i = 0; i < counts.size(); ++i) {
    EXPECT_EQ(found.points[i].num_segments, counts[i]);
    EXPECT_NEAR(found.points[i].direction_in_cam.norm(), 1.0, 1e-12);
    if (i > 0) {
      EXPECT_LE(counts[i], counts[i - 1]);
    }
  }
}

TEST(VanishingPoints, OfMoreSegmentsThanAreClusteredLabelTheRestToo) {
  Scene scene(12);
  const Eigen::Matrix3d R = SomeRotation(scene.random());
  for (int axis = 0; axis < 3; ++axis) scene.AddLines(R.col(axis), 60, 0.0, axis);
  VanishingPointOptions options;
  options.max_num_segments = 60;
  const VanishingPoints found = DetectVanishingPoints(options, scene.segments, Calibration());
  ASSERT_THAT(found.points, SizeIs(3));
  EXPECT_THAT(found.vp_of_segment, Each(::testing::Ge(0)));
}

TEST(VanishingPoints, OfDegenerateSegmentsAreNone) {
  const LineSegment2d segment = {{100, 100}, {200, 120}}, other = {{300, 100}, {350, 220}};
  const LineSegment2d point = {{50, 60}, {50, 60}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  VanishingPointOptions options;
  options.min_length_px = 0.0;
  for (const std::vector<LineSegment2d>& segments :
       {std::vector<LineSegment2d>{},
        {segment},
        {segment, other},
        {segment, segment},
        std::vector<LineSegment2d>(30, segment),
        std::vector<LineSegment2d>(30, point),
        std::vector<LineSegment2d>(30, {{nan, 0}, {100, 100}})}) {
    const VanishingPoints found = DetectVanishingPoints(options, segments, Calibration());
    EXPECT_THAT(found.points, IsEmpty()) << segments.size();
    EXPECT_THAT(found.vp_of_segment, SizeIs(segments.size()));
    EXPECT_THAT(found.vp_of_segment, Each(-1));
  }
}

TEST(VanishingPoints, OfParallelLinesAmongPointsAndShortSegments) {
  // All lines parallel: one point, and nothing for what has no direction.
  std::vector<LineSegment2d> segments;
  for (int i = 0; i < 20; ++i) segments.push_back({{50.0, 20.0 * i}, {90.0 + i, 20.0 * i}});
  for (int i = 0; i < 20; ++i) segments.push_back({{20.0 * i, 50.0}, {20.0 * i, 50.0}});
  for (int i = 0; i < 20; ++i) segments.push_back({{20.0 * i, 50.0}, {20.0 * i + 5.0, 50.0}});
  const VanishingPoints found = DetectVanishingPoints({}, segments, Calibration());
  ASSERT_THAT(found.points, SizeIs(1));
  EXPECT_LT(AngleDeg(found.points[0].direction_in_cam, Eigen::Vector3d::UnitX()), 1e-6);
  for (size_t i = 0; i < segments.size(); ++i) EXPECT_EQ(found.vp_of_segment[i], i < 20 ? 0 : -1);
}

}  // namespace
}  // namespace holba
