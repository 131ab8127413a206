// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vp_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/estimation/directions/vp_lines.h"
#include "holba/estimation/directions/vp_testing.h"
#include "holba/geometry/angle.h"
#include "holba/scene/ideal_view.h"

namespace holba {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

const Eigen::Vector3d kX = Eigen::Vector3d::UnitX(), kY = Eigen::Vector3d::UnitY(),
                      kZ = Eigen::Vector3d::UnitZ();

TEST(VpTracks, OfExactSegmentsAreExactInSpiteOfRoughImagePoints) {
  ParallelLines scene(8);
  scene.AddDirection(kX, 20, 0.0, 0.5, 1, 8, true);
  scene.AddDirection(kY, 15, 0.0, 0.5, 1, 7, true);
  scene.AddDirection(kZ, 10, 0.0, 0.5, 2, 7, true);
  const VpTrackReport report = FormVanishingPoints({}, scene.features, &scene.model);
  ASSERT_EQ(report.num_vps, 3u);
  EXPECT_EQ(report.num_new_vps, 3u);
  EXPECT_EQ(report.num_image_vps, 21u);
  EXPECT_THAT(report.dropped, IsEmpty());
  ASSERT_THAT(scene.model.groups3D, SizeIs(3));
  const std::vector<Eigen::Vector3d> directions = {kX, kY, kZ};
  const std::vector<size_t> num_images = {8, 7, 6};
  const std::vector<size_t> num_segments = {160, 105, 60};
  for (size_t i = 0; i < 3; ++i) {
    const group3D_t id = i + 1;  // by falling number of images
    const Group3D& group = scene.model.groups3D.at(id);
    EXPECT_EQ(group.type->name, "VP");
    EXPECT_LT(AngleDeg(DirectionOf(group), directions[i]), 1e-5);
    EXPECT_THAT(group.observations, IsEmpty());
    const VpTrackReport::Track& track = report.tracks.at(id);
    EXPECT_THAT(track.members, SizeIs(num_images[i]));
    EXPECT_EQ(track.num_segments, num_segments[i]);
    EXPECT_TRUE(std::is_sorted(track.members.begin(), track.members.end()));
    for (const ImageVpId& member : track.members) {
      const Eigen::Vector3d in_cam =
          scene.features[member.image_id].vanishing_points[member.vp_idx].direction_in_cam;
      EXPECT_LT(
          AngleDeg(IdealView(scene.model, member.image_id).R().transpose() * in_cam, directions[i]),
          3.0);
    }
  }
  const LineLabelReport labels = LabelLines({}, &scene.model);
  EXPECT_EQ(labels.num_labelled_lines, 45u);
  for (const auto& [id, group] : scene.model.groups3D) {
    EXPECT_THAT(group.line3D_ids, SizeIs(num_segments[id - 1] / num_images[id - 1]));
    for (const line3D_t line_id : group.line3D_ids) {
      EXPECT_LT(AngleDeg(scene.model.lines3D.at(line_id).line.direction, DirectionOf(group)), 1e-5);
    }
  }
  EXPECT_EQ(scene.model.FindInconsistency(), std::nullopt);
}

TEST(VpTracks, NeedImagesThatAgree) {
  const Eigen::Vector3d oblique = Eigen::Vector3d(1, 1, 0).normalized();
  ParallelLines scene(12);
  scene.AddDirection(kX, 20, 0.2, 0.3, 1, 12, false);
  scene.AddDirection(kY, 10, 0.2, 0.3, 1, 4, false);        // in 4 of 12 images
  scene.AddDirection(oblique, 10, 0.2, 6.0, 1, 12, false);  // by chance
  const VpTrackReport report = FormVanishingPoints({}, scene.features, &scene.model);
  EXPECT_EQ(report.num_vps, 1u);
  EXPECT_LT(AngleDeg(DirectionOf(scene.model.groups3D.at(1)), kX), 0.1);
  EXPECT_GE(report.dropped.at("track: in too few images"), 1u);
  EXPECT_EQ(report.dropped.at("image vanishing point: in no track"),
            report.num_image_vps - report.tracks.at(1).members.size());
}

TEST(VpTracks, OfFewImagesNeedFewer) {
  for (const auto& [num_images, num_enough] :
       {std::pair(2, 2), std::pair(3, 2), std::pair(4, 3), std::pair(6, 4), std::pair(9, 5),
        std::pair(40, 10)}) {
    for (const int num_shown : {num_enough, num_enough - 1}) {
      ParallelLines scene(num_images);
      scene.AddDirection(kX, 5, 0.1, 0.1, 1, num_shown, false);
      const VpTrackReport report = FormVanishingPoints({}, scene.features, &scene.model);
      EXPECT_EQ(report.num_vps, num_shown == num_enough ? 1u : 0u)
          << num_shown << " of " << num_images;
    }
  }
  ParallelLines none(0);
  EXPECT_EQ(FormVanishingPoints({}, none.features, &none.model).num_vps, 0u);
}

TEST(VpTracks, ThatAreNearAreOneAndThoseFurtherApartIfTheyShareLines) {
  const auto turned = [](double deg) {
    const double angle = DegToRad(deg);
    return Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
  };
  // Images 1 to 6 say one direction, 7 to 12 another one for the same lines; the truth lies with
  // the segments.
  for (const auto& [apart_deg, in_space, num_vps] :
       {std::tuple(3.0, false, 1u), std::tuple(7.0, false, 2u), std::tuple(7.0, true, 1u),
        std::tuple(15.0, true, 2u)}) {
    ParallelLines scene(12);
    scene.AddDirection(kX, 10, 0.0, 0.0, 1, 12, in_space);
    for (image_t id = 7; id <= 12; ++id) {
      scene.features[id].vanishing_points[0].direction_in_cam =
          IdealView(scene.model, id).R() * turned(apart_deg);
    }
    if (!in_space || apart_deg > 10.0) {
      // Other lines in the other half, along their direction.
      ParallelLines other(12);
      other.AddDirection(turned(apart_deg), 10, 0.0, 0.0, 7, 12, in_space);
      for (image_t id = 7; id <= 12; ++id) {
        scene.features[id] = other.features[id];
        for (Line2D& line : scene.model.images.at(id).lines2D) line.line3D_id = kNoId;
      }
    }
    VpTrackOptions options;
    options.max_median_deviation_deg = 10.0;
    const VpTrackReport report = FormVanishingPoints(options, scene.features, &scene.model);
    EXPECT_EQ(report.num_vps, num_vps) << apart_deg << (in_space ? ", lines in space" : "");
  }
}

TEST(VpTracks, LeaveKnownVanishingPointsAsTheyAre) {
  ParallelLines scene(8);
  scene.AddDirection(kX, 10, 0.0, 0.2, 1, 8, true);
  scene.AddDirection(kY, 10, 0.0, 0.2, 1, 8, true);
  Group3D known;
  known.type = FindGroupType("VP");
  const Eigen::Vector3d d = Eigen::Vector3d(-1, 0.02, 0).normalized();
  known.params = {d.x(), d.y(), d.z()};
  scene.model.groups3D.Add(41, known);
  const VpTrackReport report = FormVanishingPoints({}, scene.features, &scene.model);
  EXPECT_EQ(report.num_vps, 2u);
  EXPECT_EQ(report.num_new_vps, 1u);
  EXPECT_THAT(report.tracks.at(41).members, SizeIs(8));
  EXPECT_EQ(DirectionOf(scene.model.groups3D.at(41)), d);
  EXPECT_LT(AngleDeg(DirectionOf(scene.model.groups3D.at(42)), kY), 1e-5);
}

TEST(VpTracks, IgnoreImagesWithoutAPoseAndRepeat) {
  ParallelLines scene(8);
  scene.AddDirection(kX, 10, 0.3, 0.5, 1, 8, false);
  scene.AddDirection(kY, 10, 0.3, 0.5, 1, 8, false);
  scene.features[77] = scene.features[1];
  Reconstruction again = scene.model;
  const VpTrackReport report = FormVanishingPoints({}, scene.features, &scene.model);
  EXPECT_EQ(report.num_vps, 2u);
  EXPECT_EQ(report.dropped.at("image vanishing point: image without a pose"), 2u);
  FormVanishingPoints({}, scene.features, &again);
  ASSERT_EQ(again.groups3D.size(), 2u);
  for (const auto& [id, group] : again.groups3D) {
    EXPECT_EQ(group.params, scene.model.groups3D.at(id).params);
  }
}

}  // namespace
}  // namespace holba
