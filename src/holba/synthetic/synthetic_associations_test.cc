// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/synthetic_associations.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "holba/base/error.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

// Distance of X from the surface of a group.
double DistanceToGroup(const Group3D& group, const Eigen::Vector3d& X) {
  std::array<double, kMaxGroupParams> g{};
  EXPECT_TRUE(group.type->from_file(group.params.data(), g.data()));
  Eigen::Vector3d projected;
  EXPECT_TRUE(group.type->project_point(g.data(), X, &projected));
  return (projected - X).norm();
}

struct WrongCounts {
  size_t points = 0, all_points = 0, lines = 0, all_lines = 0, edges = 0;
};
WrongCounts CountWrong(const SyntheticProblem& problem) {
  WrongCounts counts;
  const auto count = [](const auto& right, const auto& given) {
    return std::count_if(given.begin(), given.end(), [&](auto id) {
      return std::find(right.begin(), right.end(), id) == right.end();
    });
  };
  for (const auto& [id, group] : problem.perturbed.groups3D) {
    const Group3D& exact = problem.truth.groups3D.at(id);
    counts.points += count(exact.point3D_ids, group.point3D_ids);
    counts.lines += count(exact.line3D_ids, group.line3D_ids);
    counts.all_points += group.point3D_ids.size();
    counts.all_lines += group.line3D_ids.size();
    EXPECT_EQ(std::set(group.point3D_ids.begin(), group.point3D_ids.end()).size(),
              exact.point3D_ids.size());
    EXPECT_EQ(group.line3D_ids.size(), exact.line3D_ids.size());
  }
  std::set<std::pair<point3D_t, line3D_t>> right;
  for (const WireframeEdge& e : problem.truth.wireframe) right.emplace(e.point3D_id, e.line3D_id);
  for (const WireframeEdge& e : problem.perturbed.wireframe) {
    counts.edges += !right.contains({e.point3D_id, e.line3D_id});
  }
  return counts;
}

TEST(WrongAssociations, AreJustTheAskedForFraction) {
  for (const WrongAssociations kind : {WrongAssociations::kRandom, WrongAssociations::kNearest}) {
    for (const double fraction : {0.0, 0.1, 0.3, 0.5, 0.77}) {
      const SyntheticProblem problem = MakeBundleProblem(
          {.num_images = 100, .fraction_wrong_associations = fraction, .wrong_associations = kind});
      EXPECT_EQ(problem.perturbed.FindInconsistency(), std::nullopt);
      const WrongCounts counts = CountWrong(problem);
      EXPECT_EQ(counts.all_points, 560);
      EXPECT_EQ(counts.points, std::llround(fraction * 560)) << fraction;
      EXPECT_EQ(counts.lines, std::llround(fraction * 80)) << fraction;
      EXPECT_EQ(counts.edges, std::llround(fraction * 300)) << fraction;
    }
  }
}

TEST(WrongAssociations, AreTheNearestNonMembers) {
  const SyntheticProblem problem =
      MakeBundleProblem({.num_images = 50,
                         .fraction_wrong_associations = 0.5,
                         .wrong_associations = WrongAssociations::kNearest});
  for (const auto& [id, group] : problem.perturbed.groups3D) {
    const Group3D& exact = problem.truth.groups3D.at(id);
    const std::set<point3D_t> right(exact.point3D_ids.begin(), exact.point3D_ids.end());
    const std::set<point3D_t> given(group.point3D_ids.begin(), group.point3D_ids.end());
    double farthest_given = 0, nearest_left_out = 1e9;
    for (const auto& [point_id, point] : problem.perturbed.points3D) {
      if (right.contains(point_id)) continue;
      const double distance = DistanceToGroup(exact, point.xyz);
      if (given.contains(point_id)) {
        farthest_given = std::max(farthest_given, distance);
      } else {
        nearest_left_out = std::min(nearest_left_out, distance);
      }
    }
    EXPECT_LE(farthest_given, nearest_left_out);
    EXPECT_LT(farthest_given, 0.5);
  }
}

TEST(WrongAssociations, AreLinesOfOtherDirectionsForVanishingPoints) {
  const SyntheticProblem problem =
      MakeBundleProblem({.num_images = 100, .fraction_wrong_associations = 0.3, .vps = true});
  size_t all = 0, wrong = 0;
  for (const auto& [id, group] : problem.perturbed.groups3D) {
    if (!group.type->IsParallelism()) continue;
    const Eigen::Vector3d v(problem.truth.groups3D.at(id).params.data());
    for (const line3D_t line : group.line3D_ids) {
      ++all;
      wrong += problem.truth.lines3D.at(line).line.direction.cross(v).norm() > 1e-9;
    }
    // The fit is not drawn away by them.
    const Eigen::Vector3d fitted(group.params.data());
    EXPECT_LT(fitted.cross(v).norm(), 0.05);
  }
  EXPECT_EQ(all, 80);
  EXPECT_NEAR(wrong, 0.3 * 80, 2);
}

TEST(WrongAssociations, AreRefusedWhereAGroupHasTooFewNonMembers) {
  SyntheticStructure structure;
  structure.points.assign(4, Eigen::Vector3d::Zero());
  structure.groups.push_back({FindGroupType("PLANE"), {0, 0, 1, 0}, {0, 1, 2}, {}});
  Random random(1);
  EXPECT_THROW(ReplaceAssociations(0.7, WrongAssociations::kRandom, &random, &structure),
               InputError);
}

}  // namespace
}  // namespace holba
