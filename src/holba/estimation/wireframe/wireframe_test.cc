// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/wireframe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"
#include "holba/estimation/wireframe/junctions.h"
#include "holba/estimation/points/wireframe_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

// A long line across the images of an arc of 6 cameras.
class OneLine : public ::testing::Test {
 protected:
  OneLine() { line_id_ = AddLineWithSegments({-1, -0.5, 0}, {1, 0.4, 0.3}, 0.0, 0.0, &model_); }

  Eigen::Vector3d OnLine(double share) const {
    const Line3D& line = model_.lines3D.at(line_id_);
    return line.start + share * (line.end - line.start);
  }
  // Moves the observations of a point across the segments, each by the value for its image.
  void ShiftAcross(point3D_t id, const std::vector<double>& shifts_px) {
    const Point3D& point = model_.points3D.at(id);
    for (size_t i = 0; i < point.track.size(); ++i) {
      Image& image = model_.images.at(point.track[i].image_id);
      const Eigen::Vector3d l = image.lines2D[0].segment.Line();
      image.points2D[point.track[i].point2D_idx].xy += shifts_px[i] * l.head<2>();
    }
  }
  WireframeReport Run(const WireframeOptions& options = {}) {
    return FormWireframe(options, &model_);
  }

  Reconstruction model_ = ArcOfCameras(6);
  line3D_t line_id_;
};

TEST_F(OneLine, AndAPointOnItAreAnEdge) {
  const point3D_t id = AddPointWithObservations(OnLine(0.3), &model_, {0, 1, 3, 4, 5});
  const WireframeReport report = Run();
  ASSERT_EQ(model_.wireframe.size(), 1u);
  EXPECT_EQ(model_.wireframe[0].point3D_id, id);
  EXPECT_EQ(model_.wireframe[0].line3D_id, line_id_);
  EXPECT_EQ(model_.wireframe[0].num_images, 5u);
  EXPECT_EQ(report.num_edges, 1u);
  EXPECT_EQ(report.num_points, 1u);
  EXPECT_EQ(report.num_lines, 1u);
  EXPECT_EQ(report.num_joints, 0u);
  EXPECT_THAT(report.dropped, IsEmpty());
  EXPECT_EQ(model_.FindInconsistency(), std::nullopt);
}

TEST_F(OneLine, AndAPointSeenOnItInThreeImagesAreNone) {
  AddPointWithObservations(OnLine(0.3), &model_, {0, 3, 5});
  const WireframeReport report = Run();
  EXPECT_THAT(report.dropped, ElementsAre(Pair("meet in too few images", 1u)));
  EXPECT_TRUE(model_.wireframe.empty());
}

TEST_F(OneLine, AndABlobBesideItAreNone) {
  // As SIFT: 1.46 px to one side with a scatter of 0.15 px, and only a pixel away in space.
  const point3D_t id = AddPointWithObservations(OnLine(0.6), &model_);
  ShiftAcross(id, {1.4, 1.61, 1.3, 1.52, 1.38, 1.55});
  const WireframeReport report = Run();
  EXPECT_TRUE(model_.wireframe.empty());
  EXPECT_THAT(report.dropped, ElementsAre(Pair("beside the edge", 1u)));
}

TEST_F(OneLine, IsBesideABlobWhateverTheSenseOfItsSegments) {
  // Reversed segments have their other side positive; a mean of raw distances would be zero.
  const point3D_t id = AddPointWithObservations(OnLine(0.6), &model_);
  ShiftAcross(id, {1.4, 1.61, 1.3, 1.52, 1.38, 1.55});
  for (image_t image_id : {1, 3, 5}) {
    LineSegment2d& segment = model_.images.at(image_id).lines2D[0].segment;
    std::swap(segment.start, segment.end);
  }
  EXPECT_THAT(Run().dropped, ElementsAre(Pair("beside the edge", 1u)));
}

TEST_F(OneLine, AndAPointAboutItAreAnEdgeWithinTheErrorOfTheMean) {
  // Mean 0.6 px: more than 0.5, but its standard error is 0.28 px.
  const point3D_t id = AddPointWithObservations(OnLine(0.6), &model_);
  ShiftAcross(id, {1.6, -0.3, 1.0, 0.1, 1.1, 0.1});
  EXPECT_EQ(Run().num_edges, 1u);
  // Scattered more than points on lines are.
  ShiftAcross(id, {0.3, -1.5, 0.8, -1.6, 0.5, -1.0});
  EXPECT_THAT(Run().dropped, ElementsAre(Pair("scattered about the line", 1u)));
}

TEST_F(OneLine, AndAPointInFrontOfItAreNone) {
  // Seen on the line in four images by mistake, while the point itself is known to be elsewhere.
  const Eigen::Vector3d nearer = OnLine(0.5) + Eigen::Vector3d(0, 0, -1.0);
  std::vector<std::pair<image_t, Eigen::Vector2d>> observations;
  for (image_t id = 1; id <= 4; ++id) {
    observations.emplace_back(id, *IdealView(model_, id).Project(OnLine(0.5)));
  }
  AddPointOfStructure(nearer, PointOrigin::kDetected, {0, 0, 0}, observations, &model_);
  const WireframeReport report = Run();
  EXPECT_THAT(report.dropped, ElementsAre(Pair("apart in space", 1u)));
  EXPECT_TRUE(model_.wireframe.empty());
}

TEST_F(OneLine, EndsWhereItsSegmentsEnd) {
  const Line3D& line = model_.lines3D.at(line_id_);
  const Eigen::Vector3d along = (line.end - line.start).normalized();
  // 0.03 are 2 to 3 px, 0.3 are 20 to 30.
  AddPointWithObservations(line.end + 0.03 * along, &model_);
  AddPointWithObservations(line.end + 0.3 * along, &model_);
  Run();
  ASSERT_EQ(model_.wireframe.size(), 1u);
  EXPECT_EQ(model_.wireframe[0].point3D_id, 1u);
}

TEST_F(OneLine, OfWeakDepthTakesPointsThatItsCovarianceAllows) {
  // The line runs along the motion of level cameras, so that its depth is hardly known. It is moved
  // back by 0.1 in the plane through the cameras: its images stay.
  Reconstruction model = ArcOfCameras(6);
  for (auto& [image_id, image] : model.images) {
    const Eigen::Vector3d centre(1.0 * image_id - 2.5, 0, -8.0);
    model.SetFramePose(image.frame_id, {Eigen::Quaterniond::Identity(), -centre});
  }
  AddLineWithSegments({0, 0.5, 0}, {2, 0.5, 0}, 0.0, 0.0, &model);
  AddLineWithSegments({0, 0.5, 0}, {0, -0.5, 0}, 0.0, 0.0, &model);
  AddPointWithObservations({1, 0.5, 0}, &model);
  AddPointWithObservations({0, 0, 0}, &model);
  const double scale = 8.1 / 8.0;  // in the plane through all centres (x, 0, -8)
  model.lines3D.at(1).line = PlueckerLine::FromPoints({0, 0.5 * scale, 0.1}, {2, 0.5 * scale, 0.1});
  model.lines3D.at(2).line = PlueckerLine::FromPoints({0, 0.5, 0.1}, {0, -0.5, 0.1});
  const WireframeReport report = FormWireframe({}, &model);
  // The second line crosses the motion: its depth is known, and it is elsewhere.
  ASSERT_EQ(model.wireframe.size(), 1u);
  EXPECT_EQ(model.wireframe[0].point3D_id, 1u);
  EXPECT_EQ(model.wireframe[0].line3D_id, 1u);
  EXPECT_EQ(report.num_uncertain, 1u);
  EXPECT_THAT(report.dropped, ElementsAre(Pair("apart in space", 1u)));
  EXPECT_EQ(FormWireframe({.max_uncertain_gap_gsd = 5.0}, &model).num_edges, 0u);
}

class WireframeOfABox : public ::testing::TestWithParam<const char*> {};

TEST_P(WireframeOfABox, HasThreeEdgesAtEachCorner) {
  Reconstruction model = ArcOfCameras(8, GetParam());
  AddBox(3.0, &model);
  TriangulateJunctions({}, 1, &model);
  const WireframeReport report = FormWireframe({}, &model);
  EXPECT_EQ(report.num_edges, 24u);
  EXPECT_EQ(report.num_points, 8u);
  EXPECT_EQ(report.num_lines, 12u);
  EXPECT_EQ(report.num_joints, 8u);
  for (const WireframeEdge& edge : model.wireframe) {
    EXPECT_GE(edge.num_images, 4u);
    EXPECT_LT(
        model.lines3D.at(edge.line3D_id).line.Distance(model.points3D.at(edge.point3D_id).xyz),
        1e-7);
  }
  // Formed anew, not added to.
  const std::vector<WireframeEdge> first = model.wireframe;
  FormWireframe({}, &model);
  EXPECT_EQ(model.wireframe.size(), first.size());
}

INSTANTIATE_TEST_SUITE_P(Cameras, WireframeOfABox, ::testing::Values("PINHOLE", "OPENCV"));

TEST(Wireframe, OfNothingIsEmpty) {
  Reconstruction empty;
  empty.wireframe.push_back({1, 1, 4});
  EXPECT_EQ(FormWireframe({}, &empty).num_edges, 0u);
  EXPECT_TRUE(empty.wireframe.empty());
  Reconstruction points = ArcOfCameras(4);
  AddPointWithObservations({0, 0, 0}, &points);
  EXPECT_THAT(FormWireframe({}, &points).dropped, IsEmpty());
}

}  // namespace
}  // namespace holba
