// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/corner_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "holba/base/random.h"
#include "holba/estimation/wireframe/corner_matching.h"
#include "holba/estimation/wireframe/junctions.h"
#include "holba/estimation/points/wireframe_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

// Few large values, as SIFT has them: two of nothing in common are about 1.2 apart as unit vectors.
std::vector<uint8_t> RandomDescriptor(Random& random) {
  std::vector<uint8_t> descriptor(kCornerDescriptorSize);
  for (uint8_t& value : descriptor) {
    value = static_cast<uint8_t>(200.0 * std::pow(random.Uniform(), 6.0));
  }
  return descriptor;
}

// Points in a box, seen as corners with a descriptor each, that changes a little from image to
// image, in shuffled order among corners of nothing. The model knows three points that span the
// range of depths.
struct CornerScene {
  explicit CornerScene(int num_images, size_t num_points, size_t num_clutter, double noise_px,
                       std::string_view camera_model = "PINHOLE", uint64_t seed = 3)
      : model(ArcOfCameras(num_images, camera_model)) {
    Random random(seed);
    std::vector<std::vector<uint8_t>> descriptors;
    for (size_t i = 0; i < num_points; ++i) {
      const double x = random.Uniform(-1.8, 1.8), y = random.Uniform(-1.5, 1.5);
      points.emplace_back(x, y, random.Uniform(-1.5, 1.5));
      descriptors.push_back(RandomDescriptor(random));
    }
    for (double z : {-1.5, 0.0, 1.5}) AddPointWithObservations({0.1, 0.2, z}, &model);
    first_new_id = model.points3D.NextId();
    for (const auto& [image_id, image] : model.images) {
      const IdealView view(model, image_id);
      std::vector<std::pair<Eigen::Vector2d, std::vector<uint8_t>>> corners;
      for (size_t i = 0; i < num_points; ++i) {
        const auto pixel = view.ToPixel(*view.Project(points[i]));
        std::vector<uint8_t> descriptor = descriptors[i];
        for (uint8_t& value : descriptor) value += static_cast<uint8_t>(random.Index(20));
        const double dx = random.Normal(noise_px), dy = random.Normal(noise_px);
        corners.emplace_back(*pixel + Eigen::Vector2d(dx, dy), descriptor);
      }
      for (size_t i = 0; i < num_clutter; ++i) {
        const double x = random.Uniform(0, 800), y = random.Uniform(0, 600);
        corners.emplace_back(Eigen::Vector2d(x, y), RandomDescriptor(random));
      }
      for (size_t i = corners.size(); i > 1; --i)
        std::swap(corners[i - 1], corners[random.Index(i)]);
      for (const auto& [pixel, descriptor] : corners) {
        features[image_id].corners.push_back(pixel);
        features[image_id].corner_descriptors.insert(features[image_id].corner_descriptors.end(),
                                                     descriptor.begin(), descriptor.end());
      }
    }
  }

  double DistanceToNearestPoint(const Eigen::Vector3d& X) const {
    double least = 1e9;
    for (const Eigen::Vector3d& point : points) least = std::min(least, (point - X).norm());
    return least;
  }

  Reconstruction model;
  ImageFeatureMap features;
  std::vector<Eigen::Vector3d> points;
  point3D_t first_new_id = 0;
};

class CornerCameras : public ::testing::TestWithParam<const char*> {};

TEST_P(CornerCameras, SeeEveryPointOnceAtItsPlace) {
  CornerScene scene(6, 120, 200, 0.0, GetParam());
  const CornerTrackReport report = TriangulateCorners({}, scene.features, 2, &scene.model);
  EXPECT_EQ(report.num_image_pairs, 15u);
  EXPECT_EQ(report.point3D_ids.size(), 120u);
  std::set<size_t> found;
  for (point3D_t id : report.point3D_ids) {
    EXPECT_GE(id, scene.first_new_id);
    const Point3D& point = scene.model.points3D.at(id);
    EXPECT_LT(scene.DistanceToNearestPoint(point.xyz), 1e-7);
    EXPECT_EQ(point.track.size(), 6u);
    EXPECT_LT(point.error, 1e-6);
    for (size_t i = 0; i < scene.points.size(); ++i) {
      if ((scene.points[i] - point.xyz).norm() < 1e-7) found.insert(i);
    }
  }
  EXPECT_EQ(found.size(), 120u);
  EXPECT_EQ(report.num_observations, 720u);
  EXPECT_EQ(scene.model.FindInconsistency(), std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Models, CornerCameras, ::testing::Values("PINHOLE", "OPENCV"));

TEST(CornerTracks, NoiseOfHalfAPixelGivesPointsWithinIt) {
  CornerScene scene(8, 150, 300, 0.5);
  const CornerTrackReport report = TriangulateCorners({}, scene.features, 2, &scene.model);
  EXPECT_GE(report.point3D_ids.size(), 140u);
  for (point3D_t id : report.point3D_ids) {
    // A pixel is 0.011 across and, over the arc, some times as much in depth.
    EXPECT_LT(scene.DistanceToNearestPoint(scene.model.points3D.at(id).xyz), 0.15);
  }
  // Mean distance of two coordinates with 0.5 px each, a little less after the fit.
  EXPECT_GT(report.median_error_px, 0.35);
  EXPECT_LT(report.median_error_px, 0.7);
}

TEST(CornerTracks, DescriptorsOfNothingInCommonGiveNoPoints) {
  CornerScene scene(6, 0, 400, 0.0);
  const CornerTrackReport report = TriangulateCorners({}, scene.features, 2, &scene.model);
  EXPECT_TRUE(report.point3D_ids.empty());
}

TEST(CornerTracks, PointsInTwoImagesOrUnderASmallAngleAreRefused) {
  CornerScene scene(6, 50, 0, 0.0);
  for (image_t image_id : {1, 2, 3, 4}) scene.features.erase(image_id);
  const CornerTrackReport two = TriangulateCorners({}, scene.features, 1, &scene.model);
  EXPECT_TRUE(two.point3D_ids.empty());
  EXPECT_GT(two.num_matches, 40u);
  EXPECT_EQ(two.dropped.at("images without described corners"), 4u);

  CornerScene narrow(6, 50, 0, 0.0);
  const CornerTrackReport report =
      TriangulateCorners({.min_triangulation_angle_deg = 60.0}, narrow.features, 1, &narrow.model);
  EXPECT_TRUE(report.point3D_ids.empty());
  EXPECT_EQ(report.dropped.at("tracks seen under a small angle of triangulation"),
            report.num_tracks);
}

TEST(CornerTracks, ThatAreAJunctionAddTheirOtherImagesToIt) {
  // Lines meet at the first point in images 0 to 3 of 6; the corner is seen in all.
  CornerScene scene(6, 60, 100, 0.0);
  const Eigen::Vector3d corner = scene.points[0];
  AddLineWithSegments(corner, corner + Eigen::Vector3d(0.5, 0, 0), 2.0, 0.0, &scene.model,
                      {0, 1, 2, 3});
  AddLineWithSegments(corner, corner + Eigen::Vector3d(0, 0.5, 0), 2.0, 0.0, &scene.model,
                      {0, 1, 2, 3});
  const JunctionReport junctions = TriangulateJunctions({}, 1, &scene.model);
  ASSERT_EQ(junctions.junctions.size(), 1u);
  const point3D_t junction_id = junctions.junctions[0].point3D_id;

  const CornerTrackReport report =
      TriangulateCorners({}, scene.features, 1, &scene.model, std::vector{junction_id});
  EXPECT_EQ(report.point3D_ids.size(), 59u);
  EXPECT_EQ(report.num_in_junctions, 1u);
  EXPECT_EQ(report.num_junction_observations, 2u);
  const Point3D& junction = scene.model.points3D.at(junction_id);
  EXPECT_EQ(junction.track.size(), 6u);
  EXPECT_LT((junction.xyz - corner).norm(), 1e-7);
  EXPECT_EQ(scene.model.FindInconsistency(), std::nullopt);
}

TEST(CornerTracks, AreTheSameForAnyNumberOfThreads) {
  CornerScene one(8, 100, 300, 0.4), four(8, 100, 300, 0.4);
  const CornerTrackReport report1 = TriangulateCorners({}, one.features, 1, &one.model);
  const CornerTrackReport report4 = TriangulateCorners({}, four.features, 4, &four.model);
  EXPECT_EQ(report1.point3D_ids, report4.point3D_ids);
  EXPECT_EQ(report1.dropped, report4.dropped);
  for (point3D_t id : report1.point3D_ids) {
    EXPECT_EQ(one.model.points3D.at(id).xyz, four.model.points3D.at(id).xyz);
    EXPECT_EQ(one.model.points3D.at(id).track.size(), four.model.points3D.at(id).track.size());
  }
}

TEST(CornerTracks, NeedCornersAndPoints) {
  Reconstruction empty;
  EXPECT_TRUE(TriangulateCorners({}, {}, 2, &empty).point3D_ids.empty());
  CornerScene scene(4, 30, 0, 0.0);
  const size_t num_points = scene.model.points3D.size();
  EXPECT_TRUE(TriangulateCorners({}, {}, 2, &scene.model).point3D_ids.empty());
  EXPECT_EQ(scene.model.points3D.size(), num_points);

  Reconstruction without_points = ArcOfCameras(4);
  const CornerTrackReport report = TriangulateCorners({}, scene.features, 2, &without_points);
  EXPECT_THAT(report.dropped, ElementsAre(Pair("images without points", 4u)));
}

TEST(CornerMatching, ATwinOnTheEpipolarLineMakesAMatchUnsafeElsewhereNot) {
  const Reconstruction model = ArcOfCameras(2);
  const IdealView view1(model, 1), view2(model, 2);
  const Eigen::Vector3d X(0.5, -0.4, 0.3);
  const DepthRange depths{4.0, 16.0};
  const LineSegment2d segment = *EpipolarSegment(view1, depths, *view1.Project(X), view2, depths);
  const Eigen::Vector2d along = (segment.end - segment.start).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  const Eigen::Vector2d x2 = *view2.Project(X);
  Random random(1);
  const std::vector<uint8_t> descriptor = RandomDescriptor(random);
  const auto count = [&](const std::vector<Eigen::Vector2d>& corners2) {
    ImageFeatures features1, features2;
    features1.corners = {*view1.Project(X)};
    features1.corner_descriptors = descriptor;
    features2.corners = corners2;
    for (size_t i = 0; i < corners2.size(); ++i) {
      features2.corner_descriptors.insert(features2.corner_descriptors.end(), descriptor.begin(),
                                          descriptor.end());
    }
    const CornerField field1(view1, features1), field2(view2, features2);
    return MatchCorners(field1, depths, field2, depths, {}).size();
  };
  EXPECT_EQ(count({x2}), 1u);
  EXPECT_EQ(count({x2 + 1.5 * across}), 1u);
  EXPECT_EQ(count({x2 + 3.0 * across}), 0u);
  EXPECT_EQ(count({x2, x2 + 20.0 * along}), 0u);
  EXPECT_EQ(count({x2, x2 + 6.0 * across}), 1u);
  // Beyond the depths.
  EXPECT_EQ(count({x2, segment.start - 10.0 * along, segment.end + 10.0 * along}), 1u);
}

TEST(CornerMatching, FindsEveryPairThatAllPairsTestFind) {
  // Of 300 corners of one descriptor, tested one by one and through the cells.
  const Reconstruction model = ArcOfCameras(2);
  const IdealView view1(model, 1), view2(model, 2);
  const DepthRange depths{5.0, 12.0};
  Random random(9);
  ImageFeatures features2;
  for (int i = 0; i < 300; ++i) {
    const double x = random.Uniform(-50, 850), y = random.Uniform(-30, 620);
    features2.corners.emplace_back(x, y);
    const std::vector<uint8_t> descriptor = RandomDescriptor(random);
    features2.corner_descriptors.insert(features2.corner_descriptors.end(), descriptor.begin(),
                                        descriptor.end());
  }
  const CornerField field2(view2, features2);
  size_t num_matches = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    // One corner of image 1 that looks as one of image 2: matched if and only if that lies on its
    // epipolar segment.
    const size_t target = random.Index(300);
    const double x = random.Uniform(0, 800), y = random.Uniform(0, 600);
    ImageFeatures features1;
    features1.corners.emplace_back(x, y);
    const auto first = features2.corner_descriptors.begin() +
                       static_cast<ptrdiff_t>(target * kCornerDescriptorSize);
    features1.corner_descriptors.assign(first, first + kCornerDescriptorSize);
    const auto segment = EpipolarSegment(view1, depths, {x, y}, view2, depths);
    bool expected = false;
    if (segment) {
      const Eigen::Vector2d along = (segment->end - segment->start).normalized();
      const Eigen::Vector2d offset = features2.corners[target] - segment->start;
      const double u = along.dot(offset);
      expected = u >= -40.0 && u <= segment->Length() + 40.0 &&
                 std::abs(segment->Line().dot(features2.corners[target].homogeneous())) <= 40.0;
    }
    const CornerField field1(view1, features1);
    CornerTrackOptions options;
    options.max_epipolar_error_px = 40.0;
    const auto matches = MatchCorners(field1, depths, field2, depths, options);
    // The distance in image 1 is tested, too, and is of the same size here.
    if (!matches.empty()) {
      EXPECT_TRUE(expected);
      EXPECT_EQ(field2.FeatureIdx(matches[0].corner2), target);
      ++num_matches;
    } else if (expected) {
      const Eigen::Vector3d l1 =
          FundamentalMatrix(view1, view2).transpose() * features2.corners[target].homogeneous();
      EXPECT_GT(std::abs(l1.dot(Eigen::Vector3d(x, y, 1.0))), 40.0 * l1.head<2>().norm());
    }
  }
  EXPECT_GT(num_matches, 10u);
}

TEST(CornerMatching, EpipolarSegmentsHoldThePointsBetweenTheDepths) {
  const Reconstruction model = ArcOfCameras(2);
  const IdealView view1(model, 1), view2(model, 2);
  const Eigen::Vector3d X(0.5, -0.4, 0.3);
  const double depth1 = view1.Depth(X), depth2 = view2.Depth(X);
  const Eigen::Vector2d x1 = *view1.Project(X), x2 = *view2.Project(X);
  // The ends are the images of the nearest and the farthest point.
  const auto exact = EpipolarSegment(view1, {depth1, 2.0 * depth1}, x1, view2, {0.1, 1e3});
  ASSERT_TRUE(exact.has_value());
  EXPECT_LT((exact->start - x2).norm(), 1e-9);
  // Cut to the depths of the other view.
  const auto cut = EpipolarSegment(view1, {0.1, 1e3}, x1, view2, {0.5 * depth2, depth2});
  ASSERT_TRUE(cut.has_value());
  EXPECT_LT((cut->end - x2).norm(), 1e-9);
  EXPECT_FALSE(EpipolarSegment(view1, {depth1, depth1}, x1, view2, {2 * depth2, 3 * depth2}));
}

}  // namespace
}  // namespace holba
