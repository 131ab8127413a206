// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/lines_from_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "holba/estimation/lines/line_testing.h"
#include "holba/estimation/lines/line_uncertainty.h"

namespace holba {
namespace {

// Edge that most segments of a line come from; -1: none has three quarters.
int EdgeOf(const TestHouse& house, const Line3D& line) {
  std::map<int, size_t> edges;
  for (const LineObservation& o : line.track)
    ++edges[house.edge_of_segment.at(o.image_id)[o.line2D_idx]];
  for (const auto& [edge, count] : edges) {
    if (4 * count >= 3 * line.track.size()) return edge;
  }
  return -1;
}

size_t NumStrangers(const TestHouse& house, const Line3D& line) {
  size_t count = 0;
  for (const LineObservation& o : line.track)
    count += house.edge_of_segment.at(o.image_id)[o.line2D_idx] != EdgeOf(house, line);
  return count;
}

// How far the line is from an edge, at the worse of its ends.
double Distance(const Line3D& line, const Edge3d& edge) {
  return std::max(line.line.Distance(edge.first), line.line.Distance(edge.second));
}

std::vector<int> EdgesOfLines(const TestHouse& house) {
  std::vector<int> edges;
  for (const auto& [id, line] : house.model.lines3D) edges.push_back(EdgeOf(house, line));
  std::sort(edges.begin(), edges.end());
  return edges;
}

std::vector<int> AllEdges(const TestHouse& house) {
  std::vector<int> edges;
  for (size_t e = 0; e < house.edges.size(); ++e) edges.push_back(static_cast<int>(e));
  return edges;
}

TEST(LinesFromSegments, ExactSegmentsGiveEveryEdgeExactlyAndNothingElse) {
  TestHouse house = MakeTestHouse({});
  const LineReport report = BuildLines({}, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(report.num_lines, house.edges.size());
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  for (const auto& [id, line] : house.model.lines3D) {
    const Edge3d& edge = house.edges[EdgeOf(house, line)];
    EXPECT_LT(Distance(line, edge), 1e-6);
    EXPECT_EQ(line.track.size(), house.model.images.size());
    EXPECT_EQ(NumStrangers(house, line), 0u);
    EXPECT_LT(line.error, 1e-5);
    // The extent is what the segments show, in their sense.
    const Eigen::Vector3d across = edge.second - edge.first;
    EXPECT_LT((line.start - (edge.first + 0.02 * across)).norm(), 1e-5);
    EXPECT_LT((line.end - (edge.second - 0.02 * across)).norm(), 1e-5);
  }
  EXPECT_EQ(house.model.FindInconsistency(), std::nullopt);
}

TEST(LinesFromSegments, NoiseAndClutterLoseNoEdgeAndMakeNoFalseLine) {
  TestHouse house = MakeTestHouse({.noise_px = 0.3, .num_clutter = 150});
  const LineReport report = BuildLines({}, house.features, nullptr, 2, &house.model);
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  size_t observations = 0, strangers = 0;
  for (const auto& [id, line] : house.model.lines3D) {
    ASSERT_GE(EdgeOf(house, line), 0);
    const Edge3d& edge = house.edges[EdgeOf(house, line)];
    strangers += NumStrangers(house, line);
    // A pixel is 0.013 here.
    EXPECT_LT(Distance(line, edge), 0.02);
    observations += line.track.size();
  }
  EXPECT_GT(observations, 0.97 * house.edges.size() * house.model.images.size());
  // Of 1200 segments of clutter one or the other happens to lie on an edge.
  EXPECT_LE(strangers, 3u);
  EXPECT_EQ(report.num_observations, observations);
  EXPECT_EQ(report.num_reliable, house.edges.size());
  EXPECT_EQ(house.model.FindInconsistency(), std::nullopt);
}

TEST(LinesFromSegments, DistortedCamerasSeeTheSameLines) {
  TestHouse house =
      MakeTestHouse({.camera = "SIMPLE_RADIAL", .camera_params = {700.0, 400.0, 300.0, -0.12}});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  for (const auto& [id, line] : house.model.lines3D)
    EXPECT_LT(Distance(line, house.edges[EdgeOf(house, line)]), 1e-5);
}

TEST(LinesFromSegments, EdgesAlongTheBaselineNeedGroupsAndPixelsCallThemUnreliable) {
  const TestHouseOptions noisy{.noise_px = 0.2};
  const auto is_along = [](const TestHouse& house, const Line3D& line) {
    const int e = EdgeOf(house, line);
    return e >= 0 &&
           std::abs((house.edges[e].second - house.edges[e].first).normalized().x()) > 0.9;
  };
  // Without groups or points the intersections of rays and planes have no depth.
  TestHouse bare = MakeTestFacade(noisy);
  BuildLines({}, bare.features, nullptr, 1, &bare.model);
  for (const auto& [id, line] : bare.model.lines3D) EXPECT_FALSE(is_along(bare, line));

  TestHouse house = MakeTestFacade(noisy);
  AddFacadeGroups(&house);
  const LineOptions options;
  const LineReport report = BuildLines(options, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  EXPECT_EQ(report.num_reliable, 12u);
  for (const auto& [id, line] : house.model.lines3D) {
    EXPECT_LT(Distance(line, house.edges[EdgeOf(house, line)]), 0.02);
    const auto uncertainty = UncertaintyOfLine(house.model, ViewMap(house.model), id, 0.5);
    ASSERT_TRUE(uncertainty.has_value());
    const bool along = is_along(house, line);
    EXPECT_EQ(uncertainty->RelativeSigma() < options.max_relative_sigma, !along);
    EXPECT_EQ(report.plane_of_line.contains(id), along);
    EXPECT_EQ(report.vp_of_line.contains(id), along);
  }
}

TEST(LinesFromSegments, GivenMatchesAreTheOnlyCandidates) {
  TestHouse house = MakeTestHouse({.noise_px = 0.2});
  LineMatchMap matches;
  BuildLines({}, house.features, &matches, 1, &house.model);
  EXPECT_TRUE(house.model.lines3D.empty());
  // Of edges 0 to 4 only, right ones, and a wrong one for each.
  for (const auto& [id1, f1] : house.features) {
    for (const auto& [id2, f2] : house.features) {
      if (id1 >= id2) continue;
      for (line2D_t e = 0; e < 5; ++e) {
        matches[{id1, id2}].push_back({e, e, 0.1f});
        matches[{id1, id2}].push_back({e, (e + 3) % 5, 0.2f});
      }
    }
  }
  // Claims need no match.
  LineOptions options;
  options.refinement_rounds = 0;
  BuildLines(options, house.features, &matches, 1, &house.model);
  EXPECT_THAT(EdgesOfLines(house), testing::ElementsAre(0, 1, 2, 3, 4));
}

TEST(LinesFromSegments, DescriptorsThatDifferPreventAMatch) {
  TestHouse house = MakeTestHouse({.noise_px = 0.2});
  const auto describe = [&](bool alike) {
    int image_idx = 0;
    for (auto& [id, f] : house.features) {
      f.segment_descriptors.assign(f.segments.size() * kSegmentDescriptorSize, 0.0f);
      for (size_t s = 0; s < f.segments.size(); ++s)
        f.segment_descriptors[s * kSegmentDescriptorSize + (alike ? s : image_idx)] = 1.0f;
      ++image_idx;
    }
  };
  describe(true);
  BuildLines({}, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  describe(false);
  const LineReport report = BuildLines({}, house.features, nullptr, 1, &house.model);
  EXPECT_TRUE(house.model.lines3D.empty());
  EXPECT_GT(report.dropped.at("candidate: descriptors differ"), 0u);
}

TEST(LinesFromSegments, OppositeSegmentsMatchOnlyIfNotOriented) {
  TestHouse house = MakeTestHouse({});
  for (auto& [id, f] : house.features) {
    for (size_t s = 0; s < f.segments.size(); ++s) {
      if ((id + s) % 2) std::swap(f.segments[s].start, f.segments[s].end);
    }
  }
  LineOptions options;
  options.oriented = false;
  BuildLines(options, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(EdgesOfLines(house), AllEdges(house));
  for (const auto& [id, line] : house.model.lines3D) EXPECT_EQ(line.track.size(), 8u);
  options.oriented = true;
  BuildLines(options, house.features, nullptr, 1, &house.model);
  ASSERT_FALSE(house.model.lines3D.empty());
  for (const auto& [id, line] : house.model.lines3D) {
    for (const LineObservation& o : line.track) {
      const LineSegment2d& segment =
          house.model.images.at(o.image_id).lines2D[o.line2D_idx].segment;
      const Eigen::Vector3d image = *IdealView(house.model, o.image_id).Project(line.line);
      EXPECT_GT(image.head<2>().dot(segment.Line().head<2>()), 0.99);
    }
  }
}

TEST(LinesFromSegments, TheNumberOfThreadsChangesNoBit) {
  TestHouse a = MakeTestHouse({.noise_px = 0.4, .num_clutter = 100});
  TestHouse b = a;
  const LineReport ra = BuildLines({}, a.features, nullptr, 1, &a.model);
  const LineReport rb = BuildLines({}, b.features, nullptr, 2, &b.model);
  EXPECT_EQ(ra.dropped, rb.dropped);
  EXPECT_EQ(ra.proposals, rb.proposals);
  ASSERT_EQ(a.model.lines3D.size(), b.model.lines3D.size());
  for (const auto& [id, line] : a.model.lines3D) {
    const Line3D& other = b.model.lines3D.at(id);
    EXPECT_EQ(line.line.direction, other.line.direction);
    EXPECT_EQ(line.line.moment, other.line.moment);
    EXPECT_EQ(line.start, other.start);
    EXPECT_EQ(line.end, other.end);
    EXPECT_EQ(line.error, other.error);
    ASSERT_EQ(line.track.size(), other.track.size());
  }
}

TEST(LinesFromSegments, NothingInNothingOut) {
  Reconstruction empty;
  EXPECT_EQ(BuildLines({}, {}, nullptr, 2, &empty).num_lines, 0u);

  // Segments without points have no neighbours: the report says so.
  TestHouse house = MakeTestHouse({});
  house.model.points3D = {};
  for (auto& [id, image] : house.model.images) image.points2D.clear();
  const LineReport report = BuildLines({}, house.features, nullptr, 2, &house.model);
  EXPECT_EQ(report.num_lines, 0u);
  EXPECT_EQ(report.dropped.at("image: no neighbour with enough shared points"), 8u);
  EXPECT_EQ(report.dropped.at("segment: no candidate in any neighbour"), report.num_segments);
  for (const auto& [id, image] : house.model.images)
    EXPECT_EQ(image.lines2D.size(), house.features.at(id).segments.size());
}

TEST(LinesFromSegments, FormerLinesAreReplaced) {
  TestHouse house = MakeTestHouse({});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  const point3D_t point = house.model.points3D.begin()->first;
  house.model.wireframe.push_back({point, 1, 3});
  BuildLines({}, house.features, nullptr, 1, &house.model);
  EXPECT_EQ(house.model.lines3D.size(), house.edges.size());
  EXPECT_TRUE(house.model.wireframe.empty());
  EXPECT_EQ(house.model.FindInconsistency(), std::nullopt);
}

}  // namespace
}  // namespace holba
