// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/junctions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "holba/estimation/points/wireframe_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

// The junction at a place, null: none.
const Junction* JunctionAt(const Eigen::Vector3d& X, const JunctionReport& report,
                           const Reconstruction& model) {
  for (const Junction& junction : report.junctions) {
    if ((model.points3D.at(junction.point3D_id).xyz - X).norm() < 1e-6) return &junction;
  }
  return nullptr;
}

class JunctionsOfABox : public ::testing::TestWithParam<const char*> {};

TEST_P(JunctionsOfABox, AreItsEightCornersWithThreeLinesEach) {
  Reconstruction model = ArcOfCameras(8, GetParam());
  AddBox(3.0, &model);
  const JunctionReport report = TriangulateJunctions({}, 2, &model);
  EXPECT_EQ(report.junctions.size(), 8u);
  EXPECT_EQ(model.points3D.size(), 8u);
  for (const Eigen::Vector3d& corner : BoxCorners()) {
    const Junction* junction = JunctionAt(corner, report, model);
    ASSERT_NE(junction, nullptr) << corner.transpose();
    EXPECT_EQ(junction->line3D_ids.size(), 3u);
    for (line3D_t id : junction->line3D_ids) {
      EXPECT_LT(model.lines3D.at(id).line.Distance(corner), 1e-9);
    }
    const Point3D& point = model.points3D.at(junction->point3D_id);
    EXPECT_EQ(point.track.size(), junction->num_images);
    EXPECT_GE(point.track.size(), 4u);
    EXPECT_LT(point.error, 1e-6);
    EXPECT_EQ(point.rgb[0], 100);  // all lines agree in red
  }
  // Edges of the front cross edges of the back in the images.
  EXPECT_GT(report.dropped.size(), 0u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Cameras, JunctionsOfABox, ::testing::Values("PINHOLE", "OPENCV"));

// Two lines that meet at the origin, in 6 images.
class TwoLines : public ::testing::Test {
 protected:
  Reconstruction model_ = ArcOfCameras(6);
  JunctionReport Run(const JunctionOptions& options = {}) {
    return TriangulateJunctions(options, 1, &model_);
  }
};

TEST_F(TwoLines, ThatMeetInMoreThanThreeImagesMakeOneJunctionAmongTheOtherPoints) {
  model_.points3D.Add(41, {.xyz = {0, 0, 0}});
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 2.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {0, 1, 0}, 2.0, 0.0, &model_, {0, 2, 3, 5});
  const JunctionReport report = Run();
  ASSERT_EQ(report.junctions.size(), 1u);
  EXPECT_EQ(report.junctions[0].point3D_id, 42u);
  EXPECT_THAT(report.junctions[0].line3D_ids, ElementsAre(1u, 2u));
  EXPECT_EQ(report.junctions[0].num_images, 4u);
  EXPECT_EQ(report.num_observations, 4u);
  EXPECT_EQ(report.num_line_pairs, 1u);
  EXPECT_TRUE(report.dropped.empty());
  std::set<image_t> images;
  for (const PointObservation& o : model_.points3D.at(42).track) images.insert(o.image_id);
  EXPECT_THAT(images, UnorderedElementsAre(1u, 3u, 4u, 6u));
  EXPECT_EQ(model_.points3D.at(42).rgb, (std::array<uint8_t, 3>{100, 2, 50}));  // (1 + 2) / 2
}

TEST_F(TwoLines, ThatMeetInThreeImagesAreRefused) {
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 2.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {0, 1, 0}, 2.0, 0.0, &model_, {0, 2, 5});
  const JunctionReport report = Run();
  EXPECT_TRUE(report.junctions.empty());
  EXPECT_TRUE(model_.points3D.empty());
  EXPECT_THAT(report.dropped, ElementsAre(Pair("pairs of lines that meet in too few images", 1u)));
}

TEST_F(TwoLines, WhoseSegmentsStopTooEarlyAreRefused) {
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 6.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {0, 1, 0}, 2.0, 0.0, &model_);
  EXPECT_TRUE(Run().junctions.empty());
  EXPECT_EQ(Run({.max_overshoot_px = 7.0}).junctions.size(), 1u);
}

TEST_F(TwoLines, AtASmallAngleAreRefused) {
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 2.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {1, 0.4, 0}, 2.0, 0.0, &model_);  // 22 degrees
  EXPECT_TRUE(Run().junctions.empty());
  EXPECT_EQ(Run({.min_angle_deg = 15.0}).junctions.size(), 1u);
}

TEST_F(TwoLines, ThatCrossInImagesButNotInSpaceAreRefused) {
  // The second passes 1.5 behind the first: its image slides along the first from view to view.
  AddLineWithSegments({-1, 0, 0}, {1, 0, 0}, 0.0, 0.0, &model_);
  AddLineWithSegments({0, -1, 1.5}, {0, 1, 1.5}, 0.0, 0.0, &model_);
  JunctionReport report = Run();
  EXPECT_EQ(report.num_line_pairs, 1u);
  EXPECT_TRUE(report.junctions.empty());
  EXPECT_EQ(report.dropped.size(), 1u);

  // 0.04 behind it the intersections are one point within 2 px: the gap of 3.6 GSD decides.
  Reconstruction close = ArcOfCameras(6);
  AddLineWithSegments({-1, 0, 0}, {1, 0, 0}, 0.0, 0.0, &close);
  AddLineWithSegments({0, -1, 0.04}, {0, 1, 0.04}, 0.0, 0.0, &close);
  report = TriangulateJunctions({}, 1, &close);
  EXPECT_TRUE(report.junctions.empty());
  EXPECT_THAT(report.dropped,
              ElementsAre(Pair("pairs of lines that pass each other in space", 1u)));
  EXPECT_EQ(TriangulateJunctions({.max_gap_gsd = 4.0}, 1, &close).junctions.size(), 1u);
}

TEST_F(TwoLines, OfWhichOneImageIsWrongKeepTheOthers) {
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 2.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {0, 1, 0}, 2.0, 0.0, &model_);
  for (Eigen::Vector2d* x : {&model_.images.at(3).lines2D[1].segment.start,
                             &model_.images.at(3).lines2D[1].segment.end}) {
    x->x() += 20.0;  // still meets the first line, elsewhere
  }
  const JunctionReport report = Run();
  ASSERT_EQ(report.junctions.size(), 1u);
  EXPECT_EQ(report.junctions[0].num_images, 5u);
  EXPECT_THAT(report.dropped, ElementsAre(Pair("observations far from their junction", 1u)));
  EXPECT_LT(model_.points3D.at(1).xyz.norm(), 1e-9);
}

TEST_F(TwoLines, SeveralSegmentsOfALineInAnImageGiveOneObservation) {
  AddLineWithSegments({0, 0, 0}, {1, 0, 0}, 2.0, 0.0, &model_);
  AddLineWithSegments({0, 0, 0}, {0, 1, 0}, 2.0, 0.0, &model_);
  for (auto& [image_id, image] : model_.images) {
    // The first segment in two pieces, of which one ends 3 px short of the junction.
    const LineSegment2d whole = image.lines2D[0].segment;
    const Eigen::Vector2d middle = 0.5 * (whole.start + whole.end);
    image.lines2D[0].segment = {whole.start, middle};
    model_.lines3D.at(1).track.push_back({image_id, static_cast<line2D_t>(image.lines2D.size())});
    image.lines2D.push_back({{middle, whole.end}, 1});
  }
  const JunctionReport report = Run();
  ASSERT_EQ(report.junctions.size(), 1u);
  EXPECT_EQ(report.num_observations, 6u);
}

// Level cameras that move along x see a level line, whose depth they hardly know: it is moved back
// by 0.1, 9 GSD, in the plane through their centres. `rising` of an upright line's length is above
// it.
JunctionReport JunctionsOfALevelLine(double rising, double back, Reconstruction* model) {
  for (auto& [image_id, image] : model->images) {
    const Eigen::Vector3d centre(1.0 * image_id - 2.5, 0, -8.0);
    model->SetFramePose(image.frame_id, {Eigen::Quaterniond::Identity(), -centre});
  }
  AddLineWithSegments({0, 0.5, 0}, {2, 0.5, 0}, 1.0, 0.0, model);
  AddLineWithSegments({0, 0.5 - rising, 0}, {0, 1.5 - rising, 0}, 1.0, 0.0, model);
  const double y = 0.5 * (8.0 + back) / 8.0;
  model->lines3D.at(1).line = PlueckerLine::FromPoints({0, y, back}, {2, y, back});
  return TriangulateJunctions({}, 1, model);
}

TEST(Junctions, OfALineOfWeakDepthAreThereWhereBothLinesEnd) {
  Reconstruction corner = ArcOfCameras(6);
  const JunctionReport report = JunctionsOfALevelLine(0.0, 0.1, &corner);
  ASSERT_EQ(report.junctions.size(), 1u);
  EXPECT_TRUE(report.junctions[0].is_uncertain);
  EXPECT_LT((corner.points3D.at(1).xyz - Eigen::Vector3d(0, 0.5, 0)).norm(), 1e-9);

  // An upright line that runs on may be a post before a wall.
  Reconstruction post = ArcOfCameras(6);
  EXPECT_TRUE(JunctionsOfALevelLine(0.5, 0.1, &post).junctions.empty());
  // As near as others need no such care.
  Reconstruction near = ArcOfCameras(6);
  const JunctionReport certain = JunctionsOfALevelLine(0.5, 0.01, &near);
  ASSERT_EQ(certain.junctions.size(), 1u);
  EXPECT_FALSE(certain.junctions[0].is_uncertain);
  // Too far for a line without depth.
  Reconstruction far = ArcOfCameras(6);
  EXPECT_TRUE(JunctionsOfALevelLine(0.0, 0.2, &far).junctions.empty());
}

TEST(Junctions, OnARowOfNarrowBarsStayApart) {
  // Bars every 3 px along a rail: each meets it at a place of its own.
  Reconstruction model = ArcOfCameras(6);
  AddLineWithSegments({-1, 0, 0}, {1, 0, 0}, 0.0, 0.0, &model);
  for (int i = 0; i < 7; ++i) {
    const double x = -0.1 + 0.035 * i;
    AddLineWithSegments({x, 0, 0}, {x, 1, 0}, 1.0, 0.0, &model);
  }
  const JunctionReport report = TriangulateJunctions({}, 1, &model);
  EXPECT_EQ(report.junctions.size(), 7u);
  for (const Junction& junction : report.junctions) EXPECT_EQ(junction.line3D_ids.size(), 2u);
}

TEST(Junctions, AreTheSameForAnyNumberOfThreads) {
  const auto run = [](int num_threads) {
    Reconstruction model = ArcOfCameras(8, "OPENCV");
    AddBox(3.0, &model);
    for (auto& [image_id, image] : model.images) {
      for (size_t i = 0; i < image.lines2D.size(); ++i) {
        image.lines2D[i].segment.start.x() += 0.3 * std::sin(3.0 * i + image_id);
      }
    }
    TriangulateJunctions({}, num_threads, &model);
    return model;
  };
  const Reconstruction one = run(1), four = run(4);
  ASSERT_EQ(one.points3D.size(), four.points3D.size());
  EXPECT_GE(one.points3D.size(), 8u);
  for (const auto& [id, point] : one.points3D) {
    EXPECT_EQ(point.xyz, four.points3D.at(id).xyz);
    EXPECT_EQ(point.error, four.points3D.at(id).error);
    EXPECT_EQ(point.track.size(), four.points3D.at(id).track.size());
  }
}

TEST(Junctions, NeedLines) {
  Reconstruction empty;
  EXPECT_TRUE(TriangulateJunctions({}, 2, &empty).junctions.empty());
  Reconstruction model = ArcOfCameras(3);
  const JunctionReport report = TriangulateJunctions({}, 2, &model);
  EXPECT_TRUE(report.junctions.empty());
  EXPECT_EQ(report.num_line_pairs, 0u);
  EXPECT_TRUE(report.dropped.empty());
}

}  // namespace
}  // namespace holba
