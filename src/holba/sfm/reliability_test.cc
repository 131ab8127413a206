// SPDX-License-Identifier: BSD-3-Clause
// Scenes whose uncertainty is known by hand: of two views with parallel axes at distance b, depth Z
// on the axis between them has the standard deviation sigma Z^2 sqrt(2) / (f b).
#include "holba/sfm/reliability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/estimation/points/wireframe_testing.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;
using testing::UnorderedElementsAre;

constexpr double kFocal = 700.0;

// Cameras at these x, looking along z.
Reconstruction Row(const std::vector<double>& xs) {
  Reconstruction model;
  model.cameras.Add(1, {.model = FindCameraModel("PINHOLE"),
                        .width = 1000,
                        .height = 1000,
                        .params = {kFocal, kFocal, 500, 500}});
  for (size_t i = 0; i < xs.size(); ++i) {
    Image image{.name = std::to_string(i), .camera_id = 1};
    image.cam_from_world.translation.x() = -xs[i];
    model.images.Add(static_cast<image_t>(i + 1), image);
  }
  model.AddTrivialRigsAndFrames();
  return model;
}

double RelativeSigmaOfTwoViews(double sigma_px, double baseline, double depth) {
  return sigma_px * depth * std::sqrt(2.0) / (kFocal * baseline);
}

Reliability Classify(const ReliabilityOptions& options, double sigma_px, const Reconstruction& m) {
  return ClassifyFeatures(options, sigma_px, sigma_px, 2, m);
}

TEST(Reliability, PointsAreToldByImagesAngleAndSigmaInThisOrder) {
  Reconstruction model = Row({-0.5, 0.5, 1.5});
  const double far = 1.0 / (2.0 * std::tan(DegToRad(0.7)));  // 1.4 degrees between neighbours
  AddPointWithObservations({0, 0, 5}, &model);
  const point3D_t of_two = AddPointWithObservations({0, 0, 5}, &model, {0, 1});
  const point3D_t of_one = AddPointWithObservations({0, 0, 5}, &model, {1});
  const point3D_t narrow = AddPointWithObservations({0, 0, far}, &model, {0, 1});
  ReliabilityOptions options;
  Reliability result = Classify(options, 0.01, model);
  EXPECT_THAT(result.unreliable_points, UnorderedElementsAre(of_one, narrow));
  EXPECT_THAT(result.reasons,
              ElementsAre(Pair("points in fewer than 2 images", 1),
                          Pair("points whose rays meet at less than 1.5 degrees", 1)));

  options.min_point_angle_deg = 1.3;
  options.min_point_images = 3;
  result = Classify(options, 0.01, model);
  EXPECT_THAT(result.unreliable_points, UnorderedElementsAre(of_one, of_two, narrow));
  EXPECT_THAT(result.reasons, ElementsAre(Pair("points in fewer than 3 images", 3)));

  // Any noise of this size makes all points uncertain, but those judged before.
  options.min_point_images = 2;
  result = Classify(options, 100.0, model);
  EXPECT_EQ(result.unreliable_points.size(), 4u);
  EXPECT_THAT(result.reasons,
              ElementsAre(Pair("points in fewer than 2 images", 1),
                          Pair("points uncertain by more than 5 % of their depth", 3)));
}

TEST(Reliability, TheSigmaOfAPointIsThatOfItsDepth) {
  Reconstruction model = Row({-0.5, 0.5});
  const double depth = 9.0;
  AddPointWithObservations({0, 0, depth}, &model);
  ReliabilityOptions options;
  for (const double sigma_px : {0.2, 1.0, 3.0}) {
    const double expected = RelativeSigmaOfTwoViews(sigma_px, 1.0, depth);
    options.max_point_relative_sigma = 1.001 * expected;
    EXPECT_THAT(Classify(options, sigma_px, model).unreliable_points, IsEmpty()) << sigma_px;
    options.max_point_relative_sigma = 0.999 * expected;
    EXPECT_EQ(Classify(options, sigma_px, model).unreliable_points.size(), 1u) << sigma_px;
  }
}

TEST(Reliability, TheSigmaOfALineIsThatOfItsEnds) {
  // Across the baseline: each end is known like a point, in depth.
  Reconstruction model = Row({-0.5, 0.5});
  const double depth = 9.0;
  AddLineWithSegments({0, -2, depth}, {0, 2, depth}, 0.0, 0.0, &model);
  ReliabilityOptions options;
  options.min_line_images = 2;
  const double expected = RelativeSigmaOfTwoViews(0.5, 1.0, depth);
  options.max_line_relative_sigma = 1.01 * expected;
  EXPECT_THAT(Classify(options, 0.5, model).unreliable_lines, IsEmpty());
  options.max_line_relative_sigma = 0.99 * expected;
  EXPECT_EQ(Classify(options, 0.5, model).unreliable_lines.size(), 1u);
}

TEST(Reliability, LinesOfTooFewImagesAndThoseAlongTheBaselineAreUnreliable) {
  Reconstruction model = Row({-1, 0, 1});
  const line3D_t good = AddLineWithSegments({0, -1, 6}, {0, 1, 6}, 0.0, 0.0, &model);
  const line3D_t of_two = AddLineWithSegments({1, -1, 6}, {1, 1, 6}, 0.0, 0.0, &model, {0, 2});
  // In one plane with all cameras: its images say nothing of its depth.
  const line3D_t along = AddLineWithSegments({-1, 0.5, 6}, {1, 0.5, 6}, 0.0, 0.0, &model);
  const Reliability result = Classify({}, 0.3, model);
  EXPECT_THAT(result.unreliable_lines, UnorderedElementsAre(of_two, along));
  EXPECT_FALSE(result.unreliable_lines.contains(good));
  EXPECT_THAT(result.reasons,
              ElementsAre(Pair("lines in fewer than 3 images", 1),
                          Pair("lines uncertain by more than 5 % of their depth", 1)));
}

TEST(Reliability, SegmentsOfOneImageCountOnce) {
  Reconstruction model = Row({-1, 1});
  const line3D_t id = AddLineWithSegments({0, -1, 6}, {0, 1, 6}, 0.0, 0.0, &model);
  Line3D& line = model.lines3D.at(id);
  Image& image = model.images.at(1);
  line.track.push_back({1, static_cast<line2D_t>(image.lines2D.size())});
  image.lines2D.push_back(image.lines2D[0]);
  ASSERT_EQ(line.track.size(), 3u);
  EXPECT_THAT(Classify({}, 0.3, model).reasons,
              ElementsAre(Pair("lines in fewer than 3 images", 1)));
}

TEST(Reliability, IsTheSameForAnyNumberOfThreads) {
  Reconstruction model = ArcOfCameras(6);
  AddBox(0.0, &model);
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    AddPointWithObservations({random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1)},
                             &model, {random.Index(3), 3 + random.Index(3)});
  }
  ReliabilityOptions options;
  // About the median: some are on each side.
  options.max_point_relative_sigma = 0.004;
  options.max_line_relative_sigma = 0.002;
  const Reliability one = ClassifyFeatures(options, 0.7, 0.5, 1, model);
  EXPECT_GT(one.unreliable_points.size(), 20u);
  EXPECT_LT(one.unreliable_points.size(), 180u);
  for (const int num_threads : {2, 5}) {
    const Reliability other = ClassifyFeatures(options, 0.7, 0.5, num_threads, model);
    EXPECT_EQ(other.unreliable_points, one.unreliable_points);
    EXPECT_EQ(other.unreliable_lines, one.unreliable_lines);
    EXPECT_EQ(other.reasons, one.reasons);
  }
}

}  // namespace
}  // namespace holba
