// SPDX-License-Identifier: BSD-3-Clause
// Laws of the verbs that edit a model.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"
#include "holba/io/colmap_files.h"
#include "holba/io/side_files.h"
#include "holba/scene/random_model.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/selection.h"

namespace holba {
namespace {

// All that the files of a model hold.
std::string AllFiles(const Reconstruction& model) {
  std::ostringstream text;
  for (const auto write :
       {WriteCameras, WriteRigs, WriteFrames, WriteImages, WritePoints3D, WriteUnregisteredFrames,
        WriteUnregisteredImages, WritePointOrigins, WriteLines2D, WriteLines3D, WriteGroups2D,
        WriteGroups3D, WriteWireframe, WriteRelations}) {
    write(ModelFormat::kBinary, model, &text);
  }
  return text.str();
}

template <typename Map>
auto AnyId(Random& random, const Map& map) {
  return map.begin()[static_cast<std::ptrdiff_t>(random.Index(map.size()))].first;
}

// Applies random verbs with valid arguments.
class Editor {
 public:
  Editor(uint64_t seed, Reconstruction* model) : random_(seed), model_(*model) {}

  void Edit() {
    using Verb = void (Editor::*)();
    constexpr Verb kVerbs[] = {
        &Editor::AddPoint,       &Editor::AddLine,        &Editor::AddGroup,     &Editor::DeletePoint,
        &Editor::DeleteLine,     &Editor::DeleteGroup,    &Editor::Observe,      &Editor::Forget,
        &Editor::Member,         &Editor::Edge,           &Editor::Relate,       &Editor::Merge,
        &Editor::Register,       &Editor::Deregister,     &Editor::Remove2D,     &Editor::Bulk};
    (this->*kVerbs[random_.Index(std::size(kVerbs))])();
  }

 private:
  std::vector<PointObservation> FreePoints(size_t at_most) {
    std::vector<PointObservation> track;
    for (const auto& [image_id, image] : model_.images) {
      for (point2D_t i = 0; i < image.points2D.size() && track.size() < at_most; ++i) {
        if (image.points2D[i].point3D_id == kNoId && random_.Index(2)) track.push_back({image_id, i});
      }
    }
    return track;
  }
  std::vector<LineObservation> FreeLines(size_t at_most) {
    std::vector<LineObservation> track;
    for (const auto& [image_id, image] : model_.images) {
      for (line2D_t i = 0; i < image.lines2D.size() && track.size() < at_most; ++i) {
        if (image.lines2D[i].line3D_id == kNoId && random_.Index(2)) track.push_back({image_id, i});
      }
    }
    return track;
  }
  void AddPoint() {
    model_.AddPoint3D({1, 2, 3}, FreePoints(random_.Index(4)), static_cast<PointOrigin>(random_.Index(4)));
  }
  void AddLine() {
    const Eigen::Vector3d a(0, 0, 1), b(1, 0, 1);
    model_.AddLine3D(PlueckerLine::FromPointDirection(a, b - a), a, b, FreeLines(random_.Index(4)));
  }
  void AddGroup() {
    if (model_.lines3D.empty() || model_.points3D.empty()) return;
    if (random_.Index(2)) {
      model_.AddGroup3D(*FindGroupType("VP"), {0, 0, 1}, {}, {AnyId(random_, model_.lines3D)});
    } else {
      model_.AddGroup3D(*FindGroupType("PLANE"), {0, 0, 1, 2});
    }
  }
  void DeletePoint() {
    if (!model_.points3D.empty()) model_.DeletePoint3D(AnyId(random_, model_.points3D));
  }
  void DeleteLine() {
    if (!model_.lines3D.empty()) model_.DeleteLine3D(AnyId(random_, model_.lines3D));
  }
  void DeleteGroup() {
    if (!model_.groups3D.empty()) model_.DeleteGroup3D(AnyId(random_, model_.groups3D));
  }
  void Observe() {
    const auto points = FreePoints(1);
    if (!points.empty() && !model_.points3D.empty())
      model_.AddObservation(AnyId(random_, model_.points3D), points[0]);
    const auto lines = FreeLines(1);
    if (!lines.empty() && !model_.lines3D.empty())
      model_.AddObservation(AnyId(random_, model_.lines3D), lines[0]);
    for (const auto& [image_id, image] : model_.images) {
      for (group2D_t i = 0; i < image.groups2D.size(); ++i) {
        if (image.groups2D[i].group3D_id != kNoId) continue;
        for (const auto& [id, group] : model_.groups3D) {
          if (group.type == image.groups2D[i].type) {
            model_.AddObservation(id, GroupObservation{image_id, i});
            return;
          }
        }
      }
    }
  }
  void Forget() {
    for (const auto& [id, point] : model_.points3D) {
      if (!point.track.empty() && random_.Index(3) == 0) {
        model_.DeleteObservation(PointObservation(point.track[random_.Index(point.track.size())]));
        break;
      }
    }
    for (const auto& [id, line] : model_.lines3D) {
      if (!line.track.empty() && random_.Index(3) == 0) {
        model_.DeleteObservation(LineObservation(line.track[random_.Index(line.track.size())]));
        break;
      }
    }
    for (const auto& [id, group] : model_.groups3D) {
      if (!group.observations.empty() && random_.Index(3) == 0) {
        model_.DeleteObservation(GroupObservation(group.observations[random_.Index(group.observations.size())]));
        break;
      }
    }
  }
  void Member() {
    if (model_.groups3D.empty() || model_.points3D.empty() || model_.lines3D.empty()) return;
    const group3D_t group = AnyId(random_, model_.groups3D);
    const point3D_t point = AnyId(random_, model_.points3D);
    const line3D_t line = AnyId(random_, model_.lines3D);
    const GroupType& type = *model_.groups3D.at(group).type;
    if (type.TakesPoints()) {
      const bool is_new = model_.AddPointMember(group, point);
      EXPECT_TRUE(is_new || model_.DeletePointMember(group, point));
    }
    if (type.TakesLines()) {
      const bool is_new = model_.AddLineMember(group, line);
      EXPECT_TRUE(is_new || model_.DeleteLineMember(group, line));
    }
  }
  void Edge() {
    if (model_.points3D.empty() || model_.lines3D.empty()) return;
    const WireframeEdge edge{AnyId(random_, model_.points3D), AnyId(random_, model_.lines3D), 3};
    const bool is_new = model_.AddEdge(edge);
    EXPECT_TRUE(is_new || model_.DeleteEdge(edge.point3D_id, edge.line3D_id));
  }
  void Relate() {
    if (model_.groups3D.size() < 2) return;
    const group3D_t a = AnyId(random_, model_.groups3D), b = AnyId(random_, model_.groups3D);
    if (a == b || !model_.groups3D.at(a).type->HasDirection() || !model_.groups3D.at(b).type->HasDirection()) return;
    const bool is_new = model_.AddRelation({a, b, RelationType::kParallel});
    EXPECT_TRUE(is_new || model_.DeleteRelation(b, a));
  }
  void Merge() {
    if (model_.points3D.size() > 1) {
      const point3D_t a = AnyId(random_, model_.points3D), b = AnyId(random_, model_.points3D);
      if (a != b) model_.MergePoints3D(a, b);
    }
    if (model_.lines3D.size() > 1) {
      const line3D_t a = AnyId(random_, model_.lines3D), b = AnyId(random_, model_.lines3D);
      if (a != b) model_.MergeLines3D(a, b);
    }
    if (model_.groups3D.size() > 1) {
      const group3D_t a = AnyId(random_, model_.groups3D), b = AnyId(random_, model_.groups3D);
      if (a != b && model_.groups3D.at(a).type == model_.groups3D.at(b).type) model_.MergeGroups3D(a, b);
    }
  }
  void Register() {
    if (!model_.unregistered_frames.empty())
      model_.RegisterFrame(AnyId(random_, model_.unregistered_frames), Rigid3d());
  }
  void Deregister() {
    if (model_.images.size() > 3) model_.DeregisterImage(AnyId(random_, model_.images));
  }
  void Remove2D() {
    const image_t image_id = AnyId(random_, model_.images);
    const auto some = [this](uint32_t) { return random_.Index(6) == 0; };
    model_.RemovePoints2D(image_id, some);
    model_.RemoveLines2D(image_id, some);
    model_.RemoveGroups2D(image_id, some);
    model_.AddPoint2D(image_id, {1, 2});
    const line2D_t line = model_.AddLine2D(image_id, {{1, 2}, {3, 4}});
    model_.AddGroup2D(image_id, {.type = FindGroupType("VP"), .line2D_idxs = {line}});
  }
  void Bulk() {
    const auto one_of_20 = [this](uint64_t, const auto&) { return random_.Index(20) == 0; };
    model_.DeletePoints3D(one_of_20);
    model_.DeleteLines3D(one_of_20);
    model_.DeleteGroups3D(one_of_20);
    const auto rarely = [this](uint64_t, const Group3D&, uint64_t) { return random_.Index(20) == 0; };
    model_.DeleteMembers(rarely, rarely);
    model_.DeleteEdges([this](const WireframeEdge&) { return random_.Index(20) == 0; });
  }

  Random random_;
  Reconstruction& model_;
};

TEST(Edits, LeaveEveryModelConsistent) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    Reconstruction model =
        RandomModel(seed, {.with_rigs = seed % 2 == 1, .with_unregistered = true, .extreme_reals = false});
    ASSERT_EQ(model.FindInconsistency(), std::nullopt);
    Editor editor(seed, &model);
    for (int edit = 0; edit < 200; ++edit) {
      editor.Edit();
      ASSERT_EQ(model.FindInconsistency(), std::nullopt) << "seed " << seed << ", edit " << edit;
    }
  }
}

TEST(Edits, AddingThenDeletingRestoresTheModel) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    Reconstruction model = RandomModel(seed, {.extreme_reals = false});
    const image_t image_id = model.images.begin()[0].first;
    const std::string before = AllFiles(model);

    const point2D_t point2D = model.AddPoint2D(image_id, {1, 2});
    const line2D_t line2D = model.AddLine2D(image_id, {{1, 2}, {3, 4}});
    const group2D_t group2D =
        model.AddGroup2D(image_id, {.type = FindGroupType("PLANE"), .point2D_idxs = {point2D}, .line2D_idxs = {line2D}});
    const point3D_t point = model.AddPoint3D({1, 2, 3}, {}, PointOrigin::kCorner);
    model.AddObservation(point, PointObservation{image_id, point2D});
    const line3D_t line = model.AddLine3D(PlueckerLine::FromPointDirection({0, 0, 1}, {1, 0, 0}), {0, 0, 1}, {1, 0, 1});
    model.AddObservation(line, LineObservation{image_id, line2D});
    const group3D_t group = model.AddGroup3D(*FindGroupType("PLANE"), {0, 0, 1, 2}, {point}, {line});
    model.AddObservation(group, GroupObservation{image_id, group2D});
    const group3D_t direction = model.AddGroup3D(*FindGroupType("VP"), {0, 0, 1});
    EXPECT_TRUE(model.AddRelation({group, direction, RelationType::kParallel}));
    EXPECT_TRUE(model.AddEdge({point, line, 2}));
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    EXPECT_NE(AllFiles(model), before);

    if (seed % 2 == 0) {  // by their own verbs, the other way round
      EXPECT_TRUE(model.DeleteEdge(point, line));
      EXPECT_TRUE(model.DeleteRelation(direction, group));
    }
    model.DeleteGroup3D(direction);
    model.DeleteGroup3D(group);
    model.DeleteLine3D(line);
    model.DeletePoint3D(point);
    model.RemoveGroups2D(image_id, [&](group2D_t idx) { return idx == group2D; });
    model.RemoveLines2D(image_id, [&](line2D_t idx) { return idx == line2D; });
    model.RemovePoints2D(image_id, [&](point2D_t idx) { return idx == point2D; });
    EXPECT_EQ(AllFiles(model), before);
    // No id is given twice.
    EXPECT_EQ(model.AddPoint3D({0, 0, 0}), point + 1);
  }
}

TEST(Edits, RegisteringThenDeregisteringRestoresTheModel) {
  Reconstruction model = RandomModel(4, {.with_unregistered = true, .extreme_reals = false});
  const std::string before = AllFiles(model);
  // The last of those that wait, so that the order is that of before.
  const auto& [image_id, waiting] = model.unregistered_images.end()[-1];
  const image_t id = image_id;
  Rigid3d pose;
  pose.translation = {1, 2, 3};
  model.RegisterImage(id, pose);
  EXPECT_TRUE(model.IsRegistered(id));
  EXPECT_EQ(model.images.at(id).cam_from_world.translation, pose.translation);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  model.DeregisterImage(id);
  EXPECT_FALSE(model.IsRegistered(id));
  EXPECT_EQ(AllFiles(model), before);
}

TEST(Edits, AFrameIsRegisteredWithAllOfItsImages) {
  Reconstruction model = RandomModel(5, {.with_rigs = true, .with_unregistered = false, .extreme_reals = false});
  const frame_t frame_id = model.frames.begin()[0].first;
  const Rigid3d pose = model.frames.at(frame_id).rig_from_world;
  const size_t num_images = model.images.size();
  model.DeregisterFrame(frame_id);
  EXPECT_EQ(model.images.size(), num_images - 2);
  EXPECT_EQ(model.unregistered_images.size(), 2u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& o : point.track) EXPECT_TRUE(model.IsRegistered(o.image_id));
  }
  model.RegisterFrame(frame_id, pose);
  EXPECT_EQ(model.images.size(), num_images);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(Edits, DeregisteringTakesPointsAndLinesWithFewerThanTwoObservations) {
  Reconstruction model = RandomModel(2, {.with_rigs = false, .extreme_reals = false});
  const image_t first = model.images.begin()[0].first, second = model.images.begin()[1].first,
                third = model.images.begin()[2].first;
  std::vector<PointObservation> track;
  for (const image_t id : {first, second, third}) track.push_back({id, model.AddPoint2D(id, {1, 1})});
  const point3D_t of_three = model.AddPoint3D({0, 0, 1}, track);
  std::vector<PointObservation> other;
  for (const image_t id : {first, second}) other.push_back({id, model.AddPoint2D(id, {2, 2})});
  const point3D_t of_two = model.AddPoint3D({0, 0, 2}, other);
  model.DeregisterImage(second);
  EXPECT_EQ(model.points3D.at(of_three).track.size(), 2u);
  EXPECT_FALSE(model.points3D.contains(of_two));
  EXPECT_EQ(model.images.at(first).points2D[other[0].point2D_idx].point3D_id, kNoId);
}

TEST(Edits, MergingCarriesObservationsMembershipsAndEdges) {
  Reconstruction model = RandomModel(3, {.extreme_reals = false});
  const image_t a_image = model.images.begin()[0].first, b_image = model.images.begin()[1].first;
  const auto point_in = [&](std::initializer_list<image_t> images, const Eigen::Vector3d& xyz) {
    std::vector<PointObservation> track;
    for (const image_t id : images) track.push_back({id, model.AddPoint2D(id, {1, 1})});
    return model.AddPoint3D(xyz, track);
  };
  const point3D_t a = point_in({a_image, b_image, b_image}, {0, 0, 0}), b = point_in({a_image}, {4, 0, 0});
  const line3D_t line = model.AddLine3D(PlueckerLine::FromPointDirection({0, 0, 1}, {1, 0, 0}), {0, 0, 1}, {1, 0, 1});
  const group3D_t plane = model.AddGroup3D(*FindGroupType("PLANE"), {0, 0, 1, 2}, {b}, {});
  model.AddEdge({b, line, 2});
  model.MergePoints3D(a, b);
  EXPECT_FALSE(model.points3D.contains(b));
  EXPECT_EQ(model.points3D.at(a).track.size(), 4u);
  // Three observations at 0, one at 4.
  EXPECT_EQ(model.points3D.at(a).xyz, Eigen::Vector3d(1, 0, 0));
  EXPECT_THAT(model.GroupsOfPoint(a), testing::ElementsAre(plane));
  EXPECT_THAT(model.LinesThrough(a), testing::ElementsAre(line));
  EXPECT_THAT(model.PointsOn(line), testing::ElementsAre(a));

  const line3D_t other = model.AddLine3D(PlueckerLine::FromPointDirection({3, 0, 1}, {1, 0, 0}), {5, 0, 1}, {4, 0, 1});
  model.MergeLines3D(line, other);
  EXPECT_EQ(model.lines3D.at(line).start, Eigen::Vector3d(0, 0, 1));
  EXPECT_EQ(model.lines3D.at(line).end, Eigen::Vector3d(5, 0, 1));

  const group3D_t second = model.AddGroup3D(*FindGroupType("PLANE"), {0, 1, 0, 2}, {}, {line});
  const group3D_t vp = model.AddGroup3D(*FindGroupType("VP"), {0, 0, 1});
  model.AddRelation({second, vp, RelationType::kParallel});
  model.MergeGroups3D(plane, second);
  EXPECT_EQ(model.groups3D.at(plane).line3D_ids, std::vector<line3D_t>{line});
  EXPECT_TRUE(model.DeleteRelation(plane, vp));
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(Edits, WithWrongArgumentsFailAndChangeNothing) {
  Reconstruction model = RandomModel(6, {.extreme_reals = false});
  const std::string before = AllFiles(model);
  EXPECT_THROW(model.DeletePoint3D(12345), CheckError);
  EXPECT_THROW(model.AddObservation(point3D_t{2}, PointObservation{model.images.begin()[0].first, 99}), CheckError);
  EXPECT_THROW(model.DeregisterFrame(12345), CheckError);
  EXPECT_THROW(model.RegisterFrame(12345, Rigid3d()), CheckError);
  EXPECT_THROW(model.AddGroup3D(*FindGroupType("VP"), {0, 0, 1}, {2}, {}), CheckError);
  EXPECT_THROW(model.AddGroup3D(*FindGroupType("VP"), {0, 0}), CheckError);
  EXPECT_THROW(model.AddEdge({2, 12345, 1}), CheckError);
  EXPECT_THROW(model.MergePoints3D(2, 2), CheckError);
  EXPECT_EQ(AllFiles(model), before);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

TEST(Edits, BehindTheVerbsBackAreFoundByFindInconsistency) {
  Reconstruction model = RandomModel(7, {.extreme_reals = false});
  model.GroupsOfPoint(2);  // makes the index
  ASSERT_EQ(model.FindInconsistency(), std::nullopt);
  for (auto& [id, group] : model.groups3D) {
    if (group.type->name != "PLANE") continue;
    group.point3D_ids.clear();
  }
  EXPECT_THAT(model.FindInconsistency().value_or(""), testing::HasSubstr("index"));
}

TEST(Edits, RemovingStructureLeavesWhatTheDetectorFound) {
  Reconstruction model = RandomModel(8, {.extreme_reals = false});
  RemoveStructure(&model);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_TRUE(model.lines3D.empty() && model.groups3D.empty() && model.wireframe.empty() && model.relations.empty());
  const image_t image_id = model.images.begin()[0].first;
  const std::string before = AllFiles(model);
  // A corner with a 2D point of its own among keypoints, so that indices move when it goes.
  const point2D_t corner = model.AddPoint2D(image_id, {1, 1});
  model.AddPoint3D({0, 0, 1}, std::vector<PointObservation>{{image_id, corner}}, PointOrigin::kCorner);
  RemoveStructure(&model);
  EXPECT_EQ(AllFiles(model), before);
}

TEST(IdMapEdits, KeepReferencesOrderAndIds) {
  IdMap<uint64_t, std::string> map;
  std::vector<std::pair<uint64_t, std::string*>> expected;
  Random random(3);
  for (int step = 0; step < 20000; ++step) {
    const uint64_t id = random.Index(3) == 0 ? random.Index(500) : random.Index(1u << 20) << 32;
    const auto at = std::find_if(expected.begin(), expected.end(), [&](const auto& e) { return e.first == id; });
    if (at == expected.end() && expected.size() < 400) {
      EXPECT_TRUE(map.Add(id, std::to_string(id)));
      expected.emplace_back(id, map.Find(id));
    } else if (!expected.empty()) {
      const size_t k = at != expected.end() ? static_cast<size_t>(at - expected.begin()) : random.Index(expected.size());
      EXPECT_TRUE(map.Remove(expected[k].first));
      EXPECT_EQ(map.Find(expected[k].first), nullptr);
      expected[k] = expected.back();
      expected.pop_back();
    }
    ASSERT_EQ(map.size(), expected.size());
    if (step % 100 != 0) continue;
    for (size_t i = 0; i < expected.size(); ++i) {
      ASSERT_EQ(map.Find(expected[i].first), expected[i].second);
      ASSERT_EQ(*expected[i].second, std::to_string(expected[i].first));
      ASSERT_EQ(map.IndexOf(expected[i].first), i);
      ASSERT_EQ(map.begin()[static_cast<std::ptrdiff_t>(i)].first, expected[i].first);
    }
  }
  const IdMap<uint64_t, std::string> copy = map;
  const uint64_t next = map.NextId();
  EXPECT_EQ(map.RemoveIf([](uint64_t id, const std::string&) { return id % 2 == 0; }) + map.size(), expected.size());
  for (const auto& [id, text] : map) EXPECT_EQ(id % 2, 1u);
  for (size_t i = 0; i < map.size(); ++i)
    EXPECT_EQ(map.IndexOf(map.begin()[static_cast<std::ptrdiff_t>(i)].first), i);
  EXPECT_EQ(map.NextId(), next);
  EXPECT_EQ(copy.size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    const uint64_t id = expected[i].first;
    EXPECT_EQ(map.contains(id), id % 2 == 1);
    EXPECT_EQ(copy.at(id), std::to_string(id));
    EXPECT_EQ(copy.IndexOf(id), i);
  }
}

// Ids come in any order and with gaps: those that were too great for a table when they came are
// found once it reaches them.
TEST(IdMapEdits, FindSmallAndGreatIds) {
  for (const uint64_t stride : {1u, 3u, 7u, 1u << 20}) {
    for (const bool downwards : {false, true}) {
      IdMap<uint64_t, uint64_t> map;
      constexpr uint64_t kCount = 3000;
      for (uint64_t k = 0; k < kCount; ++k) {
        const uint64_t id = stride * (downwards ? kCount - k : k);
        EXPECT_FALSE(map.contains(id));
        EXPECT_TRUE(map.Add(id, k));
        EXPECT_FALSE(map.Add(id, k));
      }
      for (uint64_t k = 0; k < kCount; ++k) {
        const uint64_t id = stride * (downwards ? kCount - k : k);
        EXPECT_EQ(map.at(id), k);
        EXPECT_EQ(map.IndexOf(id), k);
        EXPECT_EQ(map.contains(id + 1),
                  stride == 1 && map.begin()[downwards ? 0 : kCount - 1].first > id);
      }
      EXPECT_FALSE(map.contains(~uint64_t{0}));
    }
  }
}

}  // namespace
}  // namespace holba
