// SPDX-License-Identifier: BSD-3-Clause
// Lines, edges, scans and primitives on scenes whose figures are known by hand;
// tests/accuracy/geometry_test.py compares with an independent computation.
#include "holba/evaluation/geometry_errors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "holba/evaluation/edge_errors.h"
#include "holba/evaluation/multi_view.h"
#include "holba/evaluation/primitive_errors.h"
#include "holba/evaluation/test_scenes.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;

// The square of 2 m in the plane z = 0.
NearestDistance Floor() {
  const std::vector<Eigen::Vector3d> corners{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  const std::vector<std::array<uint32_t, 3>> triangles{{0, 1, 2}, {0, 2, 3}};
  return NearestDistance::ToTriangles(corners, triangles);
}

line3D_t AddLine(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int num_images,
                 Reconstruction* model) {
  const line3D_t id = model->AddLine3D(PlueckerLine::FromPoints(a, b), a, b);
  for (int i = 1; i <= num_images; ++i) {
    model->lines3D.at(id).track.push_back({static_cast<image_t>(i), 0});
    model->lines3D.at(id).track.push_back({static_cast<image_t>(i), 1});  // two segments of one
  }
  return id;
}

TEST(MeasureGeometry, HasRecallAndPrecisionOfKnownLines) {
  Reconstruction model;
  AddLine({0, 1, 0}, {2, 1, 0}, 4, &model);          // on the floor
  AddLine({1, 1, 0.003}, {1, 0, 0.003}, 4, &model);  // 3 mm above it
  AddLine({1, 1, 0}, {5, 1, 0}, 3, &model);          // leaves the floor after a quarter
  AddLine({0, 0, 1}, {1, 0, 1}, 4, &model);          // 1 m above it
  GeometryOptions options;
  options.thresholds_mm = {1, 5};
  const GeometryErrors errors = MeasureGeometry(model, Floor(), options, 1);
  const LineSummary paper = SummariseLinesAsPaper(errors.lines, 2);
  EXPECT_EQ(paper.count, 4u);
  EXPECT_NEAR(paper.length_m, 8.0, 1e-12);
  // Within 1 mm: 2 m of the first, 1 m of the third; within 5 mm the second, too; a sample stands
  // for 4 mm of the third line.
  EXPECT_THAT(paper.recall_m, ElementsAre(DoubleNear(3.0, 0.0041), DoubleNear(4.0, 0.0081)));
  EXPECT_THAT(paper.precision_percent, ElementsAre(DoubleNear(37.5, 0.06), DoubleNear(50.0, 0.11)));
  // Three lines are seen by four images, two segments in one counting once.
  const LineSummary limap = SummariseLinesAsLimap(errors.lines, 2, 4);
  EXPECT_EQ(limap.count, 3u);
  EXPECT_THAT(limap.recall_m, ElementsAre(DoubleNear(2.0, 1e-12), DoubleNear(3.0, 1e-12)));
  EXPECT_THAT(limap.precision_percent,
              ElementsAre(DoubleNear(100.0 / 3, 1e-9), DoubleNear(200.0 / 3, 1e-9)));

  options.min_line_images = 4;
  EXPECT_EQ(MeasureGeometry(model, Floor(), options, 2).lines.size(), 3u);
  options.metres_per_unit = 0.01;  // all lengths in centimetres
  const GeometryErrors small = MeasureGeometry(model, Floor(), options, 1);
  EXPECT_NEAR(small.lines[0].length_m, 0.02, 1e-15);
  EXPECT_NEAR(small.lines[2].mean_m, 0.01, 1e-15);
}

TEST(MeasureGeometry, HasMedianAndInliersOfKnownPoints) {
  Reconstruction model;
  for (const double z : {0.0, 0.001, -0.002, 0.007, 3.0}) model.AddPoint3D({1, 1, z});
  GeometryOptions options;
  const GeometryErrors errors = MeasureGeometry(model, Floor(), options, 1);
  const PointSummary points = SummarisePoints(errors.points, options.thresholds_mm);
  EXPECT_EQ(points.count, 5u);
  EXPECT_NEAR(*points.median_mm, 2.0, 1e-12);
  EXPECT_THAT(points.inlier_percent, ElementsAre(40.0, 60.0, 80.0));
  const PointSummary none = SummarisePoints({}, options.thresholds_mm);
  EXPECT_FALSE(none.median_mm);
  EXPECT_THAT(none.inlier_percent, ElementsAre(0.0, 0.0, 0.0));
}

TEST(MeasureEdges, ALineThatCrossesAnEdgeIsNotOnIt) {
  Reconstruction model;
  AddLine({0, 0, 0}, {1, 0, 0}, 2, &model);
  AddLine({0.5, -1, 0}, {0.5, 1, 0}, 2, &model);
  const std::vector<Edge> edges{{Eigen::Vector3d(0, 0, 0.002), Eigen::Vector3d(4, 0, 0.002)}};
  const EdgeErrors errors = MeasureEdges(model, edges, GeometryOptions(), EdgeOptions(), 1);
  EXPECT_THAT(errors.recall_m, ElementsAre(0.0, DoubleNear(1.0, 0.01), DoubleNear(1.0, 0.012)));
  EXPECT_THAT(errors.precision_percent,
              ElementsAre(0.0, DoubleNear(100.0 / 3, 1e-9), DoubleNear(100.0 / 3, 1e-9)));
  ASSERT_TRUE(errors.lines[0].match);
  EXPECT_NEAR(errors.lines[0].match->offset_m, 0.002, 1e-15);
  EXPECT_FALSE(errors.lines[1].match);
  // Nothing found, nothing right, nothing to divide by.
  const EdgeErrors none =
      MeasureEdges(Reconstruction(), edges, GeometryOptions(), EdgeOptions(), 1);
  EXPECT_THAT(none.precision_percent, ElementsAre(0.0, 0.0, 0.0));
  EXPECT_THAT(none.recall_percent, ElementsAre(0.0, 0.0, 0.0));
}

TEST(MeasureMultiView, FreeSpaceIsInFrontOfTheScanAndNothingIsKnownBehindIt) {
  // One beam to a point 4 m in front of the scanner; its radius there is 1.125 mm + 4 m tan 0.011
  // degrees = 1.893 mm.
  const std::vector<Eigen::Vector3d> scanned{{0, 0, 4}};
  const TruthScan scan{scanned, Rigid3d(), true};
  const auto accuracy = [&](const Eigen::Vector3d& x) {
    const MultiViewErrors errors =
        MeasureMultiView(std::span(&x, 1), std::span(&scan, 1), MultiViewOptions(), 1);
    return std::make_pair(errors.num_observed[0], errors.accuracy_percent[0]);
  };
  EXPECT_EQ(accuracy({0, 0, 4.009}), std::make_pair(size_t{1}, 100.0));
  EXPECT_EQ(accuracy({0, 0, 4.02}), std::make_pair(size_t{0}, 0.0));  // behind: unknown
  EXPECT_EQ(accuracy({0, 0, 3.98}), std::make_pair(size_t{1}, 0.0));  // in free space
  EXPECT_EQ(accuracy({0, 0.0018, 4}), std::make_pair(size_t{1}, 100.0));
  EXPECT_EQ(accuracy({0, 0.0020, 4}), std::make_pair(size_t{0}, 0.0));  // near, beside the beam
  EXPECT_EQ(accuracy({0, 0, -4}), std::make_pair(size_t{0}, 0.0));      // behind the scanner
  EXPECT_EQ(accuracy({0, 0.001, 0}), std::make_pair(size_t{1}, 0.0));   // at the scanner's exit
}

TEST(MeasureMultiView, DensePlacesCountNoMoreThanThinOnes) {
  // 1000 points in one voxel of either grid that are reconstructed, and one elsewhere that is not.
  std::vector<Eigen::Vector3d> scanned(1000, Eigen::Vector3d(0.002, 0.002, 0.002));
  scanned.emplace_back(1.002, 0.002, 0.002);
  const std::vector<Eigen::Vector3d> points{scanned[0]};
  const TruthScan scan{scanned, Rigid3d(), false};
  const MultiViewErrors errors =
      MeasureMultiView(points, std::span(&scan, 1), MultiViewOptions(), 1);
  EXPECT_NEAR(errors.completeness_percent[0], 50.0, 1e-12);
  EXPECT_NEAR(errors.accuracy_percent[0], 100.0, 1e-12);
  EXPECT_NEAR(errors.f1_percent[0], 200.0 / 3, 1e-12);
  const MultiViewErrors none = MeasureMultiView({}, std::span(&scan, 1), MultiViewOptions(), 1);
  EXPECT_THAT(none.f1_percent, ElementsAre(0, 0, 0, 0));
}

// Groups of both, whose ids differ.
TEST(MeasurePrimitives, PairsByPlaceAndNotById) {
  Random random(3);
  const auto add_sphere = [&](const Eigen::Vector3d& centre, double radius, Reconstruction* model) {
    std::vector<point3D_t> members;
    for (int i = 0; i < 40; ++i) {
      members.push_back(model->AddPoint3D(centre + radius * RandomVector(&random).normalized()));
    }
    return model->AddGroup3D(*FindGroupType("SPHERE"), {centre.x(), centre.y(), centre.z(), radius},
                             members);
  };
  Reconstruction truth, model;
  const group3D_t true_a = add_sphere({0, 0, 0}, 1.0, &truth);
  const group3D_t true_b = add_sphere({5, 0, 0}, 0.5, &truth);
  const group3D_t true_c = add_sphere({0, 9, 0}, 0.5, &truth);
  const group3D_t model_extra = add_sphere({30, 0, 0}, 1.0, &model);
  const group3D_t model_b = add_sphere({5, 0, 0}, 0.505, &model);
  const group3D_t model_a = add_sphere({0, 0, 0.01}, 1.0, &model);
  const PrimitiveErrors errors = MeasurePrimitives(model, truth, Sim3d(), PrimitiveOptions());
  ASSERT_EQ(errors.pairs.size(), 2u);
  EXPECT_EQ(errors.pairs[0].truth_id, true_a);
  EXPECT_EQ(errors.pairs[0].model_id, model_a);
  EXPECT_EQ(errors.pairs[1].truth_id, true_b);
  EXPECT_EQ(errors.pairs[1].model_id, model_b);
  EXPECT_NEAR(*errors.pairs[1].radius_percent, 1.0, 1e-9);
  EXPECT_THAT(errors.missed, ElementsAre(true_c));
  EXPECT_THAT(errors.extra, ElementsAre(model_extra));

  // The same in another frame.
  const Sim3d sim = RandomSimilarity(&random);
  const PrimitiveErrors moved =
      MeasurePrimitives(Moved(model, sim), truth, sim.Inverse(), PrimitiveOptions());
  ASSERT_EQ(moved.pairs.size(), 2u);
  EXPECT_NEAR(*moved.pairs[1].radius_percent, 1.0, 1e-6);
}

TEST(MeasurePrimitives, OfVanishingPointsTheNearestWithinTheAngleIsMeant) {
  Reconstruction truth, model;
  const auto add = [](const Eigen::Vector3d& v, Reconstruction* m) {
    const Eigen::Vector3d u = v.normalized();
    return m->AddGroup3D(VanishingPointType(), {u.x(), u.y(), u.z()});
  };
  const group3D_t x = add({1, 0, 0}, &truth), y = add({0, 1, 0}, &truth);
  const double angle = std::numbers::pi / 180.0;
  const group3D_t near_y = add({std::sin(angle), -std::cos(angle), 0}, &model);
  const PrimitiveErrors errors = MeasurePrimitives(model, truth, Sim3d(), PrimitiveOptions());
  ASSERT_EQ(errors.pairs.size(), 1u);
  EXPECT_EQ(errors.pairs[0].truth_id, y);
  EXPECT_EQ(errors.pairs[0].model_id, near_y);
  EXPECT_NEAR(errors.pairs[0].errors[0].second, 1.0, 1e-9);
  EXPECT_THAT(errors.missed, ElementsAre(x));
}

// Sides 1, 2 and 3 about (5, 6, 7), and the same with its axes named otherwise, 1 % larger along
// one.
TEST(MeasurePrimitives, OfCuboidsNeitherOrderNorSenseOfTheAxesCounts) {
  const auto add = [](const Eigen::Matrix3d& R, const Eigen::Vector3d& size,
                      Reconstruction* model) {
    const Eigen::Vector3d centre(5, 6, 7);
    const Eigen::Quaterniond q(R);
    std::vector<double> params{q.w(), q.x(), q.y(), q.z()};
    for (int k = 0; k < 3; ++k) {
      const double middle = R.col(k).dot(centre);
      params.push_back(-(middle + 0.5 * size[k]));
      params.push_back(middle - 0.5 * size[k]);
    }
    std::vector<point3D_t> corners;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d half(i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5);
      corners.push_back(model->AddPoint3D(centre + R * size.cwiseProduct(half)));
    }
    model->AddGroup3D(CuboidType(), params, corners);
  };
  Random random(7);
  const Eigen::Matrix3d R = ExpRotation(RandomVector(&random)).toRotationMatrix();
  Eigen::Matrix3d turned;
  turned << -R.col(2), R.col(1), R.col(0);
  Reconstruction truth, model;
  add(R, {1, 2, 3}, &truth);
  add(turned, {3.03, 2, 1}, &model);
  const PrimitiveErrors errors = MeasurePrimitives(model, truth, Sim3d(), PrimitiveOptions());
  ASSERT_EQ(errors.pairs.size(), 1u);
  const std::map<std::string, double> named(errors.pairs[0].errors.begin(),
                                            errors.pairs[0].errors.end());
  EXPECT_NEAR(named.at("size"), 0.03, 1e-9);
  EXPECT_NEAR(named.at("centre"), 0.0, 1e-9);
  EXPECT_NEAR(named.at("axes_deg"), 0.0, 1e-6);
}

}  // namespace
}  // namespace holba
