// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/structure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "holba/io/test_models.h"
#include "holba/sfm/refine_testing.h"

namespace holba {
namespace {

using testing::IsEmpty;

StructureReport Build(const RefineScene& scene, Reconstruction* model,
                      const RegionObserver& regions = {}, int num_threads = 2,
                      const StructureOptions& options = {}) {
  *model = scene.house.model;
  return BuildStructure(options, scene.house.features, &scene.matches, regions, num_threads, model);
}

std::vector<point3D_t> JunctionIds(const StructureReport& report) {
  std::vector<point3D_t> ids;
  for (const Junction& junction : report.junctions.junctions) ids.push_back(junction.point3D_id);
  return ids;
}

std::map<std::string, size_t> GroupCounts(const Reconstruction& model) {
  std::map<std::string, size_t> counts;
  for (const auto& [id, group] : model.groups3D) ++counts[std::string(group.type->name)];
  return counts;
}

// A wall whose points have gaps may be several groups, but all on the wall.
std::vector<group3D_t> PiecesOf(const Eigen::Vector4d& plane, const Reconstruction& model) {
  std::vector<group3D_t> pieces;
  for (const auto& [id, group] : model.groups3D) {
    if (group.type != FindGroupType("PLANE")) continue;
    const Eigen::Map<const Eigen::Vector4d> own(group.params.data());
    if (std::min((own - plane).norm(), (own + plane).norm()) < 0.015) pieces.push_back(id);
  }
  return pieces;
}

std::set<line3D_t> LinesOf(const std::vector<group3D_t>& groups, const Reconstruction& model) {
  std::set<line3D_t> lines;
  for (group3D_t id : groups) {
    const Group3D& group = model.groups3D.at(id);
    lines.insert(group.line3D_ids.begin(), group.line3D_ids.end());
  }
  return lines;
}

TEST(Structure, WhatIsThereIsFoundAndNothingElse) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction model;
  const StructureReport report = Build(scene, &model);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);

  const size_t num_edges = scene.house.edges.size();
  EXPECT_EQ(model.lines3D.size(), num_edges);
  EXPECT_EQ(report.lines.num_lines, num_edges);
  EXPECT_EQ(NumEdgesFound(model, scene.house.edges, 0.03), num_edges);
  EXPECT_EQ(report.planes.planes, 3u);
  EXPECT_EQ(GroupCounts(model)["VP"], 3u);
  for (const Eigen::Vector3d axis :
       {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()}) {
    EXPECT_EQ(NumGroupsAt(model, "VP", axis, 0.005), 1u) << axis.transpose();
  }
  const size_t windows_of_plane[3] = {6, 4, 2};
  size_t num_pieces = 0;
  for (int i = 0; i < 3; ++i) {
    const std::vector<group3D_t> pieces = PiecesOf(scene.planes[i], model);
    EXPECT_EQ(LinesOf(pieces, model).size(), 4 * windows_of_plane[i]) << i;
    num_pieces += pieces.size();
    size_t num_points = 0;
    for (group3D_t id : pieces) num_points += model.groups3D.at(id).point3D_ids.size();
    EXPECT_GE(num_points, 85u);
  }
  EXPECT_EQ(GroupCounts(model)["PLANE"], num_pieces);
  // Each edge runs to one of the three vanishing points.
  size_t vp_lines = 0;
  for (const auto& [id, group] : model.groups3D)
    vp_lines += group.type->IsParallelism() ? group.line3D_ids.size() : 0;
  EXPECT_EQ(vp_lines, num_edges);
  EXPECT_EQ(report.line_labels.dropped.size(), 0u);

  const std::vector<point3D_t> junctions = JunctionIds(report);
  EXPECT_EQ(junctions.size(), scene.window_corners.size());
  EXPECT_EQ(NumCornersFound(model, junctions, scene.window_corners, 0.03),
            scene.window_corners.size());
  // A corner is a junction seen once more, or a point where one is.
  EXPECT_EQ(NumCornersFound(model, report.corners.point3D_ids, scene.window_corners, 0.03),
            report.corners.point3D_ids.size());
  EXPECT_GT(report.corners.num_in_junctions, 0u);
  // Both edges of each corner.
  EXPECT_GE(model.wireframe.size(), 2 * scene.window_corners.size());
  // All pairs of directions and planes are at right angles or parallel.
  const size_t num_groups = 3 + num_pieces;
  EXPECT_EQ(model.relations.size(), num_groups * (num_groups - 1) / 2);
}

TEST(Structure, IsTheSameForAnyNumberOfThreads) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction one, three;
  Build(scene, &one, {}, 1);
  Build(scene, &three, {}, 3);
  EXPECT_EQ(Fingerprint(one), Fingerprint(three));
}

TEST(Structure, WithoutMatchesOfSegmentsGeometryFindsTheSameLines) {
  const RefineScene scene = MakeRefineScene({.noise_px = 0.2, .num_clutter = 10});
  Reconstruction model = scene.house.model;
  BuildStructure({}, scene.house.features, nullptr, {}, 2, &model);
  EXPECT_GE(NumEdgesFound(model, scene.house.edges, 0.03), scene.house.edges.size() - 2);
}

TEST(Structure, AssociationsOfAnUnchangedModelStay) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction model;
  StructureReport report = Build(scene, &model);
  Reconstruction again = model;
  UpdateAssociations({}, &again, &report);
  ASSERT_EQ(again.groups3D.size(), model.groups3D.size());
  for (const auto& [id, group] : model.groups3D) {
    EXPECT_EQ(again.groups3D.at(id).line3D_ids, group.line3D_ids) << id;
    EXPECT_EQ(again.groups3D.at(id).point3D_ids.size(), group.point3D_ids.size()) << id;
  }
  EXPECT_EQ(again.wireframe.size(), model.wireframe.size());
  EXPECT_EQ(again.relations.size(), model.relations.size());
}

TEST(Structure, WrongMembersGoAndLostOnesComeBack) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction model;
  StructureReport report = Build(scene, &model);
  const std::set<line3D_t> lines = LinesOf(PiecesOf(scene.planes[0], model), model);
  const group3D_t id = PiecesOf(scene.planes[0], model).at(0);
  Group3D& front = model.groups3D.at(id);
  ASSERT_GE(front.line3D_ids.size(), 8u);
  front.line3D_ids.resize(front.line3D_ids.size() - 3);
  const std::vector<point3D_t> sphere(scene.sphere_points.begin(), scene.sphere_points.end());
  front.point3D_ids.insert(front.point3D_ids.end(), sphere.begin(), sphere.begin() + 10);
  UpdateAssociations({}, &model, &report);
  EXPECT_EQ(LinesOf(PiecesOf(scene.planes[0], model), model), lines);
  for (point3D_t p : model.groups3D.at(id).point3D_ids)
    EXPECT_FALSE(scene.sphere_points.contains(p)) << p;
  EXPECT_GE(report.members.dropped.at("PLANE point: beyond the limit"), 10u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(Structure, RelationsAreLeftOutOnRequest) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction model;
  StructureOptions options;
  options.form_relations = false;
  const StructureReport report = Build(scene, &model, {}, 2, options);
  EXPECT_THAT(model.relations, IsEmpty());
  EXPECT_EQ(report.relations.dropped.size(), 0u);
}

TEST(Structure, LabelledRegionsAreAskedForOnceAndBecomeGroups) {
  const RefineScene scene = MakeRefineScene({});
  Reconstruction model;
  int calls = 0;
  const RegionObserver observe = [&](Reconstruction* seen) {
    ++calls;
    EXPECT_EQ(seen->lines3D.size(), scene.house.edges.size());
    EXPECT_GT(seen->points3D.size(), scene.house.model.points3D.size());  // junctions
    RegionObservations regions;
    GroupObservation previous;
    for (auto& [image_id, image] : seen->images) {
      Group2D group{.type = FindGroupType("SPHERE")};
      for (point2D_t i = 0; i < image.points2D.size(); ++i) {
        if (scene.sphere_points.contains(image.points2D[i].point3D_id))
          group.point2D_idxs.push_back(i);
      }
      const GroupObservation own{image_id, static_cast<group2D_t>(image.groups2D.size())};
      image.groups2D.push_back(group);
      if (previous.image_id != kInvalidId32) regions.matches.push_back({previous, own});
      previous = own;
    }
    return regions;
  };
  const StructureReport report = Build(scene, &model, observe);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(report.regions.formed_by_type.at("SPHERE"), 1u);
  EXPECT_EQ(NumGroupsAt(model, "SPHERE", scene.sphere, 0.03), 1u);
  EXPECT_EQ(GroupCounts(model)["SPHERE"], 1u);
}

}  // namespace
}  // namespace holba
