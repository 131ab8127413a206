// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/correspondence_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

// A node of the graph: image, keypoint.
using Node = std::pair<image_t, point2D_t>;

struct RandomGraph {
  std::map<image_t, size_t> num_keypoints;
  std::set<std::pair<Node, Node>> edges;  // both ways
  CorrespondenceGraph graph;
  size_t num_duplicates = 0, expected_duplicates = 0;
};

// Matches with repetitions, pairs in either order.
RandomGraph MakeGraph(uint64_t seed) {
  Random random(seed);
  RandomGraph made;
  CorrespondenceGraphBuilder builder;
  std::vector<image_t> ids;
  const size_t num_images = 2 + random.Index(8);
  for (size_t i = 0; i < num_images; ++i) {
    ids.push_back(static_cast<image_t>(3 * random.Index(5) + 20 * (7 * i % 10)));
    made.num_keypoints[ids.back()] = 1 + random.Index(20);
    builder.AddImage(ids.back(), made.num_keypoints[ids.back()]);
  }
  for (size_t k = 0; k < 3 * ids.size(); ++k) {
    const image_t a = ids[random.Index(ids.size())], b = ids[random.Index(ids.size())];
    if (a == b) continue;
    PointMatches matches;
    const size_t num_matches = random.Index(12);
    for (size_t m = 0; m < num_matches; ++m) {
      const auto x = static_cast<point2D_t>(random.Index(made.num_keypoints[a]));
      const auto y = static_cast<point2D_t>(random.Index(made.num_keypoints[b]));
      matches.push_back({x, y});
      made.expected_duplicates += !made.edges.insert({{a, x}, {b, y}}).second;
      made.edges.insert({{b, y}, {a, x}});
    }
    builder.AddMatches(a, b, matches);
  }
  made.graph = builder.Build();
  made.num_duplicates = builder.num_duplicates();
  return made;
}

std::vector<Node> NeighboursByBruteForce(const RandomGraph& made, const Node& node) {
  std::vector<Node> found;
  for (const auto& [from, to] : made.edges) {
    if (from == node) found.push_back(to);
  }
  return found;  // ascending: a set's order
}

std::vector<Node> Nodes(std::span<const Correspondence> correspondences) {
  std::vector<Node> nodes;
  for (const Correspondence& c : correspondences) nodes.emplace_back(c.image_id, c.point2D_idx);
  return nodes;
}

class RandomGraphs : public testing::TestWithParam<uint64_t> {
 protected:
  const RandomGraph made_ = MakeGraph(GetParam());
  const CorrespondenceGraph& graph_ = made_.graph;
};

TEST_P(RandomGraphs, HoldEveryMatchOnceAndBothWays) {
  EXPECT_EQ(made_.num_duplicates, made_.expected_duplicates);
  for (const auto& [image_id, num_keypoints] : made_.num_keypoints) {
    ASSERT_EQ(graph_.NumKeypoints(image_id), num_keypoints);
    for (point2D_t idx = 0; idx < num_keypoints; ++idx) {
      const auto expected = NeighboursByBruteForce(made_, {image_id, idx});
      EXPECT_EQ(Nodes(graph_.CorrespondencesOf(image_id, idx)), expected);
      EXPECT_EQ(graph_.HasCorrespondences(image_id, idx), !expected.empty());
      EXPECT_EQ(graph_.IsTwoViewObservation(image_id, idx),
                expected.size() == 1 && NeighboursByBruteForce(made_, expected[0]).size() == 1);
    }
  }
}

TEST_P(RandomGraphs, CountWhatTheyHold) {
  size_t num_edges = 0;
  for (const auto& [a, num_keypoints] : made_.num_keypoints) {
    size_t num_correspondences = 0, num_observations = 0;
    for (point2D_t idx = 0; idx < num_keypoints; ++idx) {
      const size_t num = NeighboursByBruteForce(made_, {a, idx}).size();
      num_correspondences += num;
      num_observations += num > 0;
    }
    EXPECT_EQ(graph_.NumCorrespondences(a), num_correspondences);
    EXPECT_EQ(graph_.NumObservations(a), num_observations);
    num_edges += num_correspondences;

    std::vector<image_t> matched;
    for (const auto& [b, unused] : made_.num_keypoints) {
      PointMatches expected;
      for (const auto& [from, to] : made_.edges) {
        if (from.first == a && to.first == b) expected.push_back({from.second, to.second});
      }
      EXPECT_EQ(graph_.MatchesBetween(a, b), expected);
      EXPECT_EQ(graph_.NumMatches(a, b), expected.size());
      EXPECT_EQ(graph_.NumMatches(b, a), expected.size());
      if (!expected.empty()) matched.push_back(b);
    }
    std::vector<image_t> found;
    for (const MatchedImage& m : graph_.MatchedImages(a)) {
      found.push_back(m.image_id);
      EXPECT_EQ(m.num_matches, graph_.NumMatches(a, m.image_id));
    }
    EXPECT_EQ(found, matched);
  }
  EXPECT_EQ(num_edges, made_.edges.size());
}

TEST_P(RandomGraphs, FindWhatIsSomeMatchesAway) {
  std::vector<Correspondence> found;
  for (const auto& [image_id, num_keypoints] : made_.num_keypoints) {
    for (point2D_t idx = 0; idx < num_keypoints; ++idx) {
      std::set<Node> reached = {{image_id, idx}};
      graph_.FindTransitive(image_id, idx, 0, &found);
      EXPECT_THAT(found, IsEmpty());
      for (int depth = 1; depth <= 5; ++depth) {
        for (const Node& node : std::set<Node>(reached)) {
          for (const Node& next : NeighboursByBruteForce(made_, node)) reached.insert(next);
        }
        std::set<Node> others = reached;
        others.erase({image_id, idx});
        graph_.FindTransitive(image_id, idx, depth, &found);
        EXPECT_THAT(Nodes(found), UnorderedElementsAreArray(others)) << "depth " << depth;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomGraphs, testing::Range<uint64_t>(1, 13));

TEST(CorrespondenceGraph, KeepsOneToManyMatchesAndDropsRepetitions) {
  CorrespondenceGraphBuilder builder;
  builder.AddImage(1, 3);
  builder.AddImage(2, 3);
  builder.AddMatches(1, 2, {{0, 0}, {0, 1}, {0, 0}, {2, 2}});
  builder.AddMatches(2, 1, {{1, 0}});
  const CorrespondenceGraph graph = builder.Build();
  EXPECT_EQ(builder.num_duplicates(), 2u);
  EXPECT_THAT(Nodes(graph.CorrespondencesOf(1, 0)), ElementsAre(Node{2, 0}, Node{2, 1}));
  EXPECT_THAT(Nodes(graph.CorrespondencesOf(2, 1)), ElementsAre(Node{1, 0}));
  EXPECT_FALSE(graph.IsTwoViewObservation(2, 1));
  EXPECT_TRUE(graph.IsTwoViewObservation(1, 2));
  EXPECT_FALSE(graph.IsTwoViewObservation(1, 1));
  EXPECT_EQ(graph.NumMatches(1, 2), 3u);
  EXPECT_EQ(graph.NumObservations(1), 2u);
}

TEST(CorrespondenceGraph, HoldsMatchesOfSegments) {
  CorrespondenceGraphBuilder builder;
  builder.AddImage(5, 0, 2);
  builder.AddImage(3, 4, 3);
  builder.AddImage(9, 1);
  builder.AddLineMatches(5, 3, {{0, 2, 0.5f}, {0, 1, 0.25f}, {1, 0, 0.75f}, {0, 2, 0.125f}});
  const CorrespondenceGraph graph = builder.Build();
  EXPECT_EQ(builder.num_duplicates(), 1u);
  EXPECT_THAT(graph.image_ids(), ElementsAre(3, 5, 9));
  EXPECT_EQ(graph.NumSegments(3), 3u);
  EXPECT_EQ(graph.NumLineMatches(3, 5), 3u);
  EXPECT_EQ(graph.NumMatches(3, 5), 0u);
  const auto of_first = graph.LineCorrespondencesOf(5, 0);
  ASSERT_EQ(of_first.size(), 2u);
  // The best first; of one match given twice the better.
  EXPECT_EQ(of_first[0].line2D_idx, 2u);
  EXPECT_EQ(of_first[0].distance, 0.125f);
  EXPECT_EQ(of_first[1].line2D_idx, 1u);
  const auto back = graph.LineCorrespondencesOf(3, 0);
  ASSERT_EQ(back.size(), 1u);
  EXPECT_EQ(back[0].image_id, 5u);
  EXPECT_EQ(back[0].line2D_idx, 1u);
  ASSERT_EQ(graph.MatchedImages(5).size(), 1u);
  EXPECT_EQ(graph.MatchedImages(5)[0].num_line_matches, 3u);
  EXPECT_THAT(graph.MatchedImages(9), IsEmpty());
}

TEST(CorrespondenceGraph, KnowsTheGeometryOfAPairBothWays) {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.E = Eigen::Matrix3d::Identity();
  (*geometry.E)(0, 2) = 4.0;
  geometry.inlier_matches = {{1, 0}};
  CorrespondenceGraphBuilder builder;
  builder.AddImage(1, 2);
  builder.AddImage(2, 1);
  builder.AddImage(3, 1);
  builder.AddTwoViewGeometry(2, 1, geometry.Swapped());
  const CorrespondenceGraph graph = builder.Build();
  EXPECT_EQ(graph.GeometryBetween(1, 2).config, TwoViewConfig::kCalibrated);
  EXPECT_EQ(*graph.GeometryBetween(1, 2).E, *geometry.E);
  EXPECT_EQ(*graph.GeometryBetween(2, 1).E, geometry.E->transpose());
  EXPECT_EQ(graph.MatchesBetween(2, 1), PointMatches({{0, 1}}));
  EXPECT_EQ(graph.GeometryBetween(1, 3).config, TwoViewConfig::kUndefined);
}

TEST(CorrespondenceGraph, RefusesWhatCannotBe) {
  CorrespondenceGraphBuilder builder;
  builder.AddImage(1, 2);
  EXPECT_THROW(builder.AddImage(1, 2), CheckError);
  EXPECT_THROW(builder.AddMatches(1, 1, {{0, 1}}), CheckError);
  builder.AddImage(2, 2);
  builder.AddMatches(1, 2, {{0, 2}});  // the third keypoint of two
  EXPECT_THROW(builder.Build(), CheckError);
  const CorrespondenceGraph empty = CorrespondenceGraphBuilder().Build();
  EXPECT_TRUE(empty.image_ids().empty());
  EXPECT_FALSE(empty.Contains(1));
  EXPECT_THROW(empty.NumKeypoints(1), CheckError);
}

}  // namespace
}  // namespace holba
