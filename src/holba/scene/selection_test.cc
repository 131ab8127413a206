// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

TEST(Selection, APartIsConsistentAndHasNothingOfTheRest) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const Reconstruction model = RandomModel(seed, {});
    const Reconstruction part =
        Select(model, {.keep_point = [](point3D_t id, const Point3D&) { return id % 2 == 0; },
                       .keep_line = [](line3D_t id, const Line3D&) { return id % 3 != 0; },
                       .keep_group = [](group3D_t id, const Group3D&) { return id % 2 == 1; }});
    EXPECT_EQ(part.FindInconsistency(), std::nullopt);
    for (const auto& [id, point] : model.points3D)
      EXPECT_EQ(part.points3D.contains(id), id % 2 == 0);
    for (const auto& [id, line] : model.lines3D) EXPECT_EQ(part.lines3D.contains(id), id % 3 != 0);
    for (const auto& [id, group] : model.groups3D)
      EXPECT_EQ(part.groups3D.contains(id), id % 2 == 1);
    for (const auto& [id, image] : model.images) {
      EXPECT_EQ(part.images.at(id).points2D.size(), image.points2D.size());
      EXPECT_EQ(part.images.at(id).lines2D.size(), image.lines2D.size());
    }
  }
}

TEST(Selection, AnEmptySelectionIsTheWholeModel) {
  const Reconstruction model = RandomModel(3, {});
  const Reconstruction part = Select(model, {});
  EXPECT_EQ(part.points3D.size(), model.points3D.size());
  EXPECT_EQ(part.lines3D.size(), model.lines3D.size());
  EXPECT_EQ(part.groups3D.size(), model.groups3D.size());
  EXPECT_EQ(part.wireframe.size(), model.wireframe.size());
  EXPECT_EQ(part.relations.size(), model.relations.size());
}

TEST(Selection, ValuesComeBackToThoseThatWereChosenOnly) {
  Reconstruction model = RandomModel(5, {.extreme_reals = false});
  const Reconstruction before = model;
  Reconstruction part =
      Select(model, {.keep_point = [](point3D_t id, const Point3D&) { return id % 2 == 0; },
                     .keep_line = [](line3D_t id, const Line3D&) { return id % 2 == 0; },
                     .keep_group = {}});
  Sim3d move;
  move.translation = Eigen::Vector3d(1, 2, 3);
  part.Transform(move);
  CopyValues(part, &model);
  for (const auto& [id, point] : model.points3D) {
    EXPECT_EQ(point.xyz, id % 2 == 0 ? part.points3D.at(id).xyz : before.points3D.at(id).xyz);
    EXPECT_EQ(point.track.size(), before.points3D.at(id).track.size());
  }
  for (const auto& [id, line] : model.lines3D)
    EXPECT_EQ(line.start, id % 2 == 0 ? part.lines3D.at(id).start : before.lines3D.at(id).start);
  for (const auto& [id, frame] : model.frames)
    EXPECT_EQ(frame.rig_from_world.translation, part.frames.at(id).rig_from_world.translation);
  for (const auto& [id, group] : model.groups3D)
    EXPECT_EQ(group.params, part.groups3D.at(id).params);
}

TEST(Selection, NothingIsLeftOfRemovedStructure) {
  Reconstruction model = RandomModel(7, {});
  const auto num_points = std::count_if(model.points3D.begin(), model.points3D.end(), [](const auto& entry) {
    return !IsOfStructure(entry.second.origin);
  });
  RemoveStructure(&model);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(model.points3D.size()), num_points);
  EXPECT_TRUE(model.lines3D.empty() && model.groups3D.empty() && model.wireframe.empty() &&
              model.relations.empty());
  for (const auto& [id, image] : model.images)
    EXPECT_TRUE(image.lines2D.empty() && image.groups2D.empty());
}

TEST(Selection, AGroupIsObservedWhereItsMembersAre) {
  Reconstruction model = RandomModel(11, {});
  Image& first = model.images.begin()->second;
  ASSERT_FALSE(first.points2D.empty());
  first.groups2D.push_back(
      {.type = FindGroupType("PLANE"), .group3D_id = kNoId, .point2D_idxs = {0}});
  size_t unassigned = 0;
  for (const auto& [id, image] : model.images) {
    for (const Group2D& group : image.groups2D) unassigned += group.group3D_id == kNoId;
  }
  ObserveGroups(&model);
  ASSERT_EQ(model.FindInconsistency(), std::nullopt);
  for (const auto& [group_id, group] : model.groups3D) {
    size_t members_seen = 0, observations = 0;
    for (point3D_t id : group.point3D_ids) members_seen += model.points3D.at(id).track.size();
    for (line3D_t id : group.line3D_ids) members_seen += model.lines3D.at(id).track.size();
    for (const GroupObservation& o : group.observations) {
      const Group2D& group2D = model.images.at(o.image_id).groups2D[o.group2D_idx];
      EXPECT_EQ(group2D.group3D_id, group_id);
      observations += group2D.point2D_idxs.size() + group2D.line2D_idxs.size();
    }
    EXPECT_EQ(observations, members_seen);
  }
  size_t still_unassigned = 0;
  for (const auto& [id, image] : model.images) {
    for (const Group2D& group : image.groups2D) still_unassigned += group.group3D_id == kNoId;
  }
  EXPECT_EQ(still_unassigned, unassigned);
}

}  // namespace
}  // namespace holba
