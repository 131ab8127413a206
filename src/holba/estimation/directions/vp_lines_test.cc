// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vp_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "holba/estimation/directions/vp_testing.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

const Eigen::Vector3d kX = Eigen::Vector3d::UnitX(), kY = Eigen::Vector3d::UnitY(),
                      kZ = Eigen::Vector3d::UnitZ();

// VP groups of given directions, without the tracks.
void AddVp(group3D_t id, const Eigen::Vector3d& d, Reconstruction* model) {
  Group3D group;
  group.type = FindGroupType("VP");
  group.params = {d.x(), d.y(), d.z()};
  model->groups3D.Add(id, group);
}

TEST(LineLabels, GoToTheBestVanishingPointAndOnlyThere) {
  ParallelLines scene(8);
  scene.AddDirection(kX, 10, 0.1, 0.0, 1, 8, true);
  const double small = DegToRad(0.3);
  AddVp(1, {std::cos(small), std::sin(small), 0.0}, &scene.model);
  AddVp(2, kX, &scene.model);
  AddVp(3, kY, &scene.model);
  const LineLabelReport report = LabelLines({}, &scene.model);
  EXPECT_THAT(scene.model.groups3D.at(2).line3D_ids, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
  EXPECT_EQ(report.num_removed_vps, 2u) << "those without lines";
  EXPECT_EQ(scene.model.groups3D.size(), 1u);
}

TEST(LineLabels, NeedImagesThatAgree) {
  // Of a line in 8 images 7 are more than 80 %; of one in 3 all.
  for (const auto& [num_images, num_wrong, is_member] :
       {std::tuple(8, 1, true), std::tuple(8, 2, false), std::tuple(5, 1, true),
        std::tuple(4, 1, false), std::tuple(3, 0, true), std::tuple(3, 1, false),
        std::tuple(2, 0, false)}) {
    ParallelLines scene(8);
    scene.AddDirection(kX, 5, 0.0, 0.0, 1, num_images, true);
    for (int id = 1; id <= num_wrong; ++id) {
      for (Line2D& line : scene.model.images.at(id).lines2D) {
        const Eigen::Vector2d half = 0.5 * (line.segment.end - line.segment.start);
        line.segment.end += 0.2 * Eigen::Vector2d(-half.y(), half.x());
      }
    }
    AddVp(1, kX, &scene.model);
    const LineLabelReport report = LabelLines({}, &scene.model);
    EXPECT_EQ(report.num_labelled_lines, is_member ? 5u : 0u)
        << num_images << " images, " << num_wrong << " wrong";
    EXPECT_EQ(report.dropped.empty(), is_member);
  }
}

TEST(LineLabels, RemoveVanishingPointsOfFewLinesWithAllThatNamesThem) {
  ParallelLines scene(6);
  scene.AddDirection(kX, 5, 0.0, 0.0, 1, 6, true);
  scene.AddDirection(kY, 2, 0.0, 0.0, 1, 6, true);
  AddVp(1, kX, &scene.model);
  AddVp(2, kY, &scene.model);
  AddVp(3, kZ, &scene.model);
  scene.model.relations = {{1, 2, RelationType::kOrthogonal}, {2, 3, RelationType::kOrthogonal}};
  Group2D group2D;
  group2D.type = FindGroupType("VP");
  group2D.group3D_id = 2;
  group2D.line2D_idxs = {0};
  scene.model.images.at(1).groups2D.push_back(group2D);
  const LineLabelReport report = LabelLines({}, &scene.model);
  EXPECT_EQ(report.num_labelled_lines, 5u);
  EXPECT_EQ(report.num_removed_vps, 2u);
  EXPECT_EQ(report.dropped.at("line: its vanishing point has too few"), 2u);
  EXPECT_THAT(scene.model.relations, IsEmpty());
  EXPECT_EQ(scene.model.images.at(1).groups2D[0].group3D_id, kNoId);
  EXPECT_EQ(scene.model.FindInconsistency(), std::nullopt);
}

TEST(LineLabels, NeedALineAlongTheVanishingPointThatFitsAllSegments) {
  // 0.7 degrees off: the segments of any one image run to the vanishing point within 1.5 px.
  ParallelLines scene(8);
  scene.AddDirection(Eigen::Vector3d(1, 0.012, 0).normalized(), 5, 0.0, 0.0, 1, 8, true);
  AddVp(1, kX, &scene.model);
  LineLabelOptions options;
  options.max_error_factor = 1.0;
  options.error_allowance_px = 0.05;
  const LineLabelReport report = LabelLines(options, &scene.model);
  EXPECT_EQ(report.num_labelled_lines, 0u);
  EXPECT_EQ(report.dropped.at("line: leaves its segments along its vanishing point"), 5u);
  AddVp(1, kX, &scene.model);
  options.error_allowance_px = 1.5;
  EXPECT_EQ(LabelLines(options, &scene.model).num_labelled_lines, 5u);
}

TEST(LineLabels, ForgiveALineTheErrorsThatItHasAnyway) {
  // Segments as a whole aside, in every other image to the other side: no line fits them well, and
  // one along the vanishing point not worse.
  ParallelLines scene(8);
  scene.AddDirection(kX, 5, 0.05, 0.0, 1, 8, true);
  for (auto& [id, image] : scene.model.images) {
    for (Line2D& line : image.lines2D) {
      const Eigen::Vector2d along = (line.segment.end - line.segment.start).normalized();
      const Eigen::Vector2d aside = (id % 2 ? 1.0 : -1.0) * Eigen::Vector2d(-along.y(), along.x());
      line.segment.start += aside;
      line.segment.end += aside;
    }
  }
  AddVp(1, kX, &scene.model);
  EXPECT_EQ(LabelLines({}, &scene.model).num_labelled_lines, 5u);
}

}  // namespace
}  // namespace holba
