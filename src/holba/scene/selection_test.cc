// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

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
