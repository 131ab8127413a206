// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/adjust_local.h"

#include <gtest/gtest.h>

#include <set>

#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/point_graph.h"

namespace holba {
namespace {

// Every number that an adjustment can change.
std::vector<double> Values(const Reconstruction& model) {
  std::vector<double> values;
  const auto add = [&](const auto& v) {
    values.insert(values.end(), v.data(), v.data() + v.size());
  };
  for (const auto& [id, camera] : model.cameras) add(camera.params);
  for (const auto& [id, frame] : model.frames) {
    add(frame.rig_from_world.rotation.coeffs());
    add(frame.rig_from_world.translation);
  }
  for (const auto& [id, image] : model.images) add(image.cam_from_world.translation);
  for (const auto& [id, point] : model.points3D) add(point.xyz);
  for (const auto& [id, line] : model.lines3D) {
    add(line.line.direction);
    add(line.line.moment);
    add(line.start);
    add(line.end);
  }
  for (const auto& [id, group] : model.groups3D) add(group.params);
  return values;
}

Reconstruction Street(int num_images) {
  PointGraphOptions graph;
  graph.num_images = num_images;
  graph.observations_per_image = 60;
  return MakePointGraph(graph).perturbed;
}
Reconstruction Holistic(bool rigs) {
  return MakeBundleProblem({.num_images = 30,
                            .visibility = Visibility::kNear,
                            .vps = true,
                            .primitives = 1,
                            .rig_size = rigs ? 2 : 1})
      .perturbed;
}

BundleOptions Options(BundleConfig config) {
  BundleOptions options = PlainOptions(LossChoice::kCauchy);
  options.config = config;
  return options;
}
SolverOptions Solver() {
  SolverOptions options;
  options.num_threads = 1;
  options.max_num_iterations = 8;
  return options;
}

std::vector<image_t> Images(const Reconstruction& model, size_t begin, size_t count) {
  std::vector<image_t> ids;
  for (size_t k = begin; k < begin + count; ++k) ids.push_back((model.images.begin() + k)->first);
  return ids;
}

// What the selection names, as a model of its own.
Reconstruction CopyOut(Reconstruction part, const BundleSelection& selection) {
  const auto keep = [](const auto& selected, auto* records) {
    std::set<uint64_t> ids;
    for (const auto& element : selected) ids.insert(element.id);
    records->RemoveIf([&](auto id, const auto&) { return !ids.contains(id); });
  };
  keep(selection.frames, &part.frames);
  keep(selection.points, &part.points3D);
  keep(selection.lines, &part.lines3D);
  keep(selection.groups, &part.groups3D);
  part.images.RemoveIf([&](image_t, const Image& i) { return !part.frames.contains(i.frame_id); });
  const auto is_outside = [&](const auto& o) { return !part.images.contains(o.image_id); };
  for (auto& [id, point] : part.points3D) std::erase_if(point.track, is_outside);
  for (auto& [id, line] : part.lines3D) std::erase_if(line.track, is_outside);
  for (auto& [id, group] : part.groups3D) {
    std::erase_if(group.point3D_ids, [&](point3D_t p) { return !part.points3D.contains(p); });
    std::erase_if(group.line3D_ids, [&](line3D_t l) { return !part.lines3D.contains(l); });
  }
  std::erase_if(part.wireframe, [&](const WireframeEdge& e) {
    return !part.points3D.contains(e.point3D_id) || !part.lines3D.contains(e.line3D_id);
  });
  std::erase_if(part.relations, [&](const Relation& r) {
    return !part.groups3D.contains(r.group3D_id1) || !part.groups3D.contains(r.group3D_id2);
  });
  return part;
}

void ExpectEqualsOneSolve(const Reconstruction& start, const BundleOptions& options) {
  Reconstruction expected = start, found = start;
  BundleProblem bundle = BuildProblem(expected, options);
  const SolverSummary solved = Solve(Solver(), &bundle.problem);
  WriteBack(bundle, &expected);
  SolverWorkspace workspace;
  const LocalSummary local = AdjustLocal(
      options, Solver(), BundleSelection::Everything(found, options), &workspace, &found);
  EXPECT_EQ(local.solver.final_cost, solved.final_cost);
  EXPECT_LT(solved.final_cost, solved.initial_cost);
  EXPECT_EQ(Values(found), Values(expected));
}

TEST(AdjustLocal, OfEverythingEqualsOneSolveOfBuildProblem) {
  ExpectEqualsOneSolve(Street(20), Options(BundleConfig::kPoint));
  ExpectEqualsOneSolve(Holistic(false), Options(BundleConfig::kHolistic));
  ExpectEqualsOneSolve(Holistic(true), Options(BundleConfig::kHolistic));
}

// Adjusts a part of the model in place, and the part alone: what it names ends with the same bits,
// all else keeps its own.
void ExpectEqualsThePartAlone(const Reconstruction& start, const BundleOptions& options,
                              const BundleSelection& selection) {
  Reconstruction whole = start, part = CopyOut(start, selection);
  const LocalSummary in_whole = AdjustLocal(options, Solver(), selection, nullptr, &whole);
  const LocalSummary alone = AdjustLocal(options, Solver(), selection, nullptr, &part);
  EXPECT_GT(in_whole.solver.accepted_steps, 0);
  EXPECT_EQ(in_whole.solver.final_cost, alone.solver.final_cost);
  EXPECT_EQ(Values(CopyOut(whole, selection)), Values(part));

  std::set<uint64_t> frames, points, lines;
  for (const auto& frame : selection.frames) {
    if (!frame.constant) frames.insert(frame.id);
  }
  for (const auto& point : selection.points) points.insert(point.id);
  for (const auto& line : selection.lines) lines.insert(line.id);
  for (const auto& [id, frame] : start.frames) {
    if (frames.contains(id)) continue;
    EXPECT_EQ(whole.frames.at(id).rig_from_world.translation, frame.rig_from_world.translation);
  }
  for (const auto& [id, point] : start.points3D) {
    if (!points.contains(id)) {
      EXPECT_EQ(whole.points3D.at(id).xyz, point.xyz);
    }
  }
  for (const auto& [id, line] : start.lines3D) {
    if (!lines.contains(id)) {
      EXPECT_EQ(whole.lines3D.at(id).start, line.start);
    }
  }
}

TEST(AdjustLocal, OfAPartEqualsThePartAlone) {
  const Reconstruction street = Street(40), holistic = Holistic(false), rigs = Holistic(true);
  for (const bool surroundings : {false, true}) {
    const AroundOptions around{.surroundings = surroundings};
    BundleOptions options = Options(BundleConfig::kPoint);
    ExpectEqualsThePartAlone(
        street, options,
        BundleSelection::Around(street, options, Images(street, 14, 12), around));
    options = Options(BundleConfig::kHolistic);
    for (const Reconstruction* model : {&holistic, &rigs}) {
      const BundleSelection selection =
          BundleSelection::Around(*model, options, Images(*model, 8, 12), around);
      EXPECT_FALSE(selection.lines.empty() || selection.groups.empty() ||
                   selection.wireframe.empty() || selection.relations.empty());
      ExpectEqualsThePartAlone(*model, options, selection);
    }
  }
}

TEST(AdjustLocal, LeavesOutObservationsInFramesThatAreNotNamed) {
  Reconstruction model = Street(40);
  const BundleOptions options = Options(BundleConfig::kPoint);
  const std::vector<image_t> ids = Images(model, 14, 12);
  const BundleSelection selection =
      BundleSelection::Around(model, options, ids, {.surroundings = false});
  Reconstruction other = model;
  for (auto& [id, image] : other.images) {
    if (std::find(ids.begin(), ids.end(), id) != ids.end()) continue;
    for (Point2D& point : image.points2D) point.xy += Eigen::Vector2d(50, -70);
  }
  AdjustLocal(options, Solver(), selection, nullptr, &model);
  AdjustLocal(options, Solver(), selection, nullptr, &other);
  EXPECT_EQ(Values(model), Values(other));
}

TEST(Around, AllImagesSelectsEverything) {
  const Reconstruction model = Holistic(true);
  const BundleOptions options = Options(BundleConfig::kHolistic);
  const BundleSelection all = BundleSelection::Everything(model, options);
  // In another order: elements stand in that of the model.
  std::vector<image_t> ids = Images(model, 0, model.images.size());
  std::reverse(ids.begin(), ids.end());
  const BundleSelection around =
      BundleSelection::Around(model, options, ids, {.hold_cameras = false});
  const auto ids_of = [](const auto& elements) {
    std::vector<std::pair<uint64_t, bool>> list;
    for (const auto& element : elements) list.emplace_back(element.id, element.constant);
    return list;
  };
  EXPECT_EQ(ids_of(around.points), ids_of(all.points));
  EXPECT_EQ(ids_of(around.lines), ids_of(all.lines));
  EXPECT_EQ(ids_of(around.groups), ids_of(all.groups));
  for (size_t k = 0; k < all.groups.size(); ++k) {
    EXPECT_EQ(around.groups[k].point3D_ids, all.groups[k].point3D_ids);
    EXPECT_EQ(around.groups[k].line3D_ids, all.groups[k].line3D_ids);
  }
  Reconstruction a = model, b = model;
  AdjustLocal(options, Solver(), all, nullptr, &a);
  AdjustLocal(options, Solver(), around, nullptr, &b);
  EXPECT_EQ(Values(a), Values(b));
}

TEST(Around, HoldsGroupsOfWhichItHasAPartOnly) {
  const Reconstruction model = Holistic(false);
  const BundleOptions options = Options(BundleConfig::kHolistic);
  const BundleSelection part =
      BundleSelection::Around(model, options, Images(model, 8, 12), {.surroundings = false});
  size_t num_held = 0;
  for (const SelectedGroup& group : part.groups) {
    const Group3D& record = model.groups3D.at(group.id);
    const bool whole = group.point3D_ids.size() + group.line3D_ids.size() ==
                       record.point3D_ids.size() + record.line3D_ids.size();
    EXPECT_EQ(group.constant, !whole);
    num_held += group.constant;
  }
  EXPECT_GT(num_held, 0u);
}

TEST(Around, HoldsTheSurroundings) {
  const Reconstruction model = Street(40);
  const BundleOptions options = Options(BundleConfig::kPoint);
  const BundleSelection with =
      BundleSelection::Around(model, options, Images(model, 14, 12), {.surroundings = true});
  size_t num_variable = 0;
  for (const auto& frame : with.frames) num_variable += !frame.constant;
  EXPECT_EQ(num_variable, 12u);
  EXPECT_GT(with.frames.size(), 13u);
  EXPECT_EQ(with.gauge.origin_frame, kInvalidId32) << "two held frames fix it";
}

TEST(OfFeatures, HasTheStructureOfItsFeaturesAndLeavesTheRest) {
  Reconstruction model = Holistic(false);
  const BundleOptions options = Options(BundleConfig::kHolistic);
  const auto keeps = [](uint64_t id) { return id % 3 != 0; };
  constexpr size_t kMinMembers = 5;
  const BundleSelection part =
      BundleSelection::OfFeatures(model, options, keeps, keeps, kMinMembers);
  EXPECT_EQ(part.frames.size(), model.frames.size());
  size_t num_points = 0, num_groups = 0, num_edges = 0;
  for (const auto& [id, point] : model.points3D) num_points += keeps(id);
  for (const auto& [id, group] : model.groups3D) {
    num_groups += std::count_if(group.point3D_ids.begin(), group.point3D_ids.end(), keeps) +
                      std::count_if(group.line3D_ids.begin(), group.line3D_ids.end(), keeps) >=
                  static_cast<std::ptrdiff_t>(kMinMembers);
  }
  for (const WireframeEdge& edge : model.wireframe)
    num_edges += keeps(edge.point3D_id) && keeps(edge.line3D_id);
  EXPECT_EQ(part.points.size(), num_points);
  EXPECT_EQ(part.groups.size(), num_groups);
  EXPECT_EQ(part.wireframe.size(), num_edges);
  for (const SelectedGroup& group : part.groups) {
    EXPECT_TRUE(std::all_of(group.point3D_ids.begin(), group.point3D_ids.end(), keeps));
    EXPECT_TRUE(std::all_of(group.line3D_ids.begin(), group.line3D_ids.end(), keeps));
    EXPECT_GE(group.point3D_ids.size() + group.line3D_ids.size(), kMinMembers);
  }
  const Reconstruction before = model;
  AdjustBundle(options, Solver(), part, &model);
  for (const auto& [id, point] : model.points3D)
    EXPECT_EQ(point.xyz == before.points3D.at(id).xyz, !keeps(id)) << id;
  for (const auto& [id, line] : model.lines3D)
    EXPECT_EQ(line.line.moment == before.lines3D.at(id).line.moment, !keeps(id)) << id;
}

TEST(UpdateErrors, OfASelectionEqualsThatOfTheModel) {
  Reconstruction all = Holistic(false), part = all;
  const BundleOptions options = Options(BundleConfig::kHolistic);
  const BundleSelection selection =
      BundleSelection::Around(all, options, Images(all, 8, 12), {.surroundings = false});
  UpdateErrors(&all);
  UpdateErrors(selection, &part);
  for (const auto& point : selection.points)
    EXPECT_EQ(part.points3D.at(point.id).error, all.points3D.at(point.id).error);
  for (const auto& line : selection.lines)
    EXPECT_EQ(part.lines3D.at(line.id).error, all.lines3D.at(line.id).error);
}

}  // namespace
}  // namespace holba
