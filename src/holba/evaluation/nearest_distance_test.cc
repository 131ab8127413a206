// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/nearest_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "holba/evaluation/test_scenes.h"

namespace holba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Triangle = std::array<uint32_t, 3>;
using Segment = std::array<Eigen::Vector3d, 2>;

// By another way than the tested code's: the nearest point of the triangle as that of least
// |a + s u + t v - x|, found by cutting the plane of (s, t) down to ever smaller triangles.
double DistanceBySubdivision(const Eigen::Vector3d& x, Eigen::Vector3d a, Eigen::Vector3d b,
                             Eigen::Vector3d c) {
  // A convex function: of the four parts, the best 8 candidates of each level are kept.
  struct Part {
    Eigen::Vector3d a, b, c;
    double bound;  // no point of the part is nearer
  };
  const auto part_of = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::Vector3d& c) {
    const Eigen::Vector3d middle = (a + b + c) / 3.0;
    const double reach = std::max({(a - middle).norm(), (b - middle).norm(), (c - middle).norm()});
    return Part{a, b, c, (x - middle).norm() - reach};
  };
  std::vector<Part> parts{part_of(a, b, c)};
  double best = kInfinity;
  for (int level = 0; level < 40 && !parts.empty(); ++level) {
    std::vector<Part> next;
    for (const Part& p : parts) {
      best = std::min({best, (x - p.a).norm(), (x - p.b).norm(), (x - p.c).norm()});
      const Eigen::Vector3d ab = 0.5 * (p.a + p.b), bc = 0.5 * (p.b + p.c), ca = 0.5 * (p.c + p.a);
      best = std::min({best, (x - ab).norm(), (x - bc).norm(), (x - ca).norm()});
      for (const Part& q : {part_of(p.a, ab, ca), part_of(ab, p.b, bc), part_of(ca, bc, p.c),
                            part_of(ab, bc, ca)}) {
        next.push_back(q);
      }
    }
    std::erase_if(next, [&](const Part& p) { return !(p.bound < best); });
    std::sort(next.begin(), next.end(),
              [](const Part& a, const Part& b) { return a.bound < b.bound; });
    if (next.size() > 64) next.resize(64);
    parts = std::move(next);
  }
  return best;
}

double DistanceToTriangle(const Eigen::Vector3d& x, const Eigen::Vector3d& a,
                          const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return std::sqrt(SquaredDistanceToTriangle(x, a, b, c));
}

TEST(SquaredDistanceToTriangle, IsThatOfSubdivision) {
  Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    Eigen::Vector3d a = RandomVector(&random), b = RandomVector(&random), c = RandomVector(&random);
    if (trial % 5 == 1) c = a + random.Uniform(-1, 2) * (b - a);  // a segment
    if (trial % 5 == 2) c = b;                                    // twice the same corner
    if (trial % 5 == 3) b = c = a;                                // a point
    if (trial % 5 == 4) c = 0.3 * a + 0.7 * b + 1e-7 * RandomVector(&random);  // a sliver
    const Eigen::Vector3d x = 2.0 * RandomVector(&random);
    EXPECT_NEAR(DistanceToTriangle(x, a, b, c), DistanceBySubdivision(x, a, b, c), 2e-7) << trial;
  }
}

TEST(SquaredDistanceToTriangle, IsExactAtCornersEdgesAndAboveTheFace) {
  const Eigen::Vector3d a(0, 0, 0), b(2, 0, 0), c(0, 2, 0);
  EXPECT_EQ(DistanceToTriangle({-3, -4, 0}, a, b, c), 5.0);
  EXPECT_EQ(DistanceToTriangle({1, -2, 0}, a, b, c), 2.0);
  EXPECT_EQ(DistanceToTriangle({0.5, 0.5, -7}, a, b, c), 7.0);
  EXPECT_EQ(DistanceToTriangle({0.5, 0.5, 0}, a, b, c), 0.0);
  EXPECT_NEAR(DistanceToTriangle({2, 2, 0}, a, b, c), std::sqrt(2.0), 1e-15);
  // Also where all of it is far from the origin, and tiny.
  const Eigen::Vector3d far(1e6, -2e6, 3e6);
  EXPECT_NEAR(DistanceToTriangle(far + Eigen::Vector3d(1, 1, 3), far + a, far + b, far + c), 3.0,
              1e-8);
  EXPECT_NEAR(DistanceToTriangle({5e-7, 5e-7, 3e-6}, 1e-6 * a, 1e-6 * b, 1e-6 * c), 3e-6, 1e-20);
}

// A mesh with faces of all sizes, a tenth of them degenerate.
struct Soup {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;

  Soup(size_t size, uint64_t seed) {
    Random random(seed);
    for (size_t i = 0; i < size; ++i) {
      const Eigen::Vector3d at = 5.0 * RandomVector(&random);
      const double reach = std::pow(10.0, random.Uniform(-3, 0));
      const auto first = static_cast<uint32_t>(vertices.size());
      for (int k = 0; k < 3; ++k) vertices.push_back(at + reach * RandomVector(&random));
      if (i % 10 == 0) vertices.back() = 0.5 * (vertices[first] + vertices[first + 1]);
      if (i % 30 == 0) vertices[first + 1] = vertices[first + 2] = vertices[first];
      triangles.push_back({first, first + 1, first + 2});
    }
  }
};

std::vector<Eigen::Vector3d> RandomPoints(size_t size, double reach, uint64_t seed) {
  Random random(seed);
  std::vector<Eigen::Vector3d> points;
  for (size_t i = 0; i < size; ++i) points.push_back(reach * RandomVector(&random));
  return points;
}

TEST(NearestDistance, IsTheLeastOfAllTriangles) {
  const Soup soup(3000, 2);
  const auto nearest = NearestDistance::ToTriangles(soup.vertices, soup.triangles);
  EXPECT_EQ(nearest.size(), 3000u);
  const std::vector<Eigen::Vector3d> points = RandomPoints(1500, 6.0, 3);
  const std::vector<double> distances = nearest.Of(points, 2);
  for (size_t i = 0; i < points.size(); ++i) {
    double least = kInfinity;
    for (const auto& [a, b, c] : soup.triangles) {
      least = std::min(least, DistanceToTriangle(points[i], soup.vertices[a], soup.vertices[b],
                                                 soup.vertices[c]));
    }
    EXPECT_NEAR(distances[i], least, 1e-14 * least);
    EXPECT_NEAR(nearest.Of(points[i]), least, 1e-14 * least);
  }
}

TEST(NearestDistance, IsTheSameBitForBitForAnyNumberOfThreads) {
  const Soup soup(2000, 4);
  const auto nearest = NearestDistance::ToTriangles(soup.vertices, soup.triangles);
  const std::vector<Eigen::Vector3d> points = RandomPoints(5000, 4.0, 5);
  const std::vector<double> one = nearest.Of(points, 1);
  EXPECT_EQ(one, nearest.Of(points, 2));
  EXPECT_EQ(one, nearest.Of(points, 7));
}

TEST(NearestDistance, OfPointsAndOfSegmentsIsTheLeastOfAll) {
  const std::vector<Eigen::Vector3d> cloud = RandomPoints(2000, 3.0, 6);
  std::vector<Segment> segments;
  for (size_t i = 0; i + 1 < cloud.size(); i += 2) segments.push_back({cloud[i], cloud[i + 1]});
  const auto to_cloud = NearestDistance::ToPoints(cloud);
  const auto to_segments = NearestDistance::ToSegments(segments);
  const std::vector<Eigen::Vector3d> points = RandomPoints(400, 5.0, 7);
  const std::vector<double> of_cloud = to_cloud.Of(points, 1),
                            of_segments = to_segments.Of(points, 1);
  for (size_t i = 0; i < points.size(); ++i) {
    double least = kInfinity, least_segment = kInfinity;
    for (const Eigen::Vector3d& x : cloud) least = std::min(least, (points[i] - x).norm());
    for (const Segment& s : segments) {
      least_segment =
          std::min(least_segment, std::sqrt(SquaredDistanceToSegment(points[i], s[0], s[1])));
    }
    EXPECT_NEAR(of_cloud[i], least, 1e-14);
    EXPECT_NEAR(of_segments[i], least_segment, 1e-14);
  }
}

TEST(NearestDistance, AlongLeavesOutSegmentsOfOtherDirections) {
  const std::vector<Segment> segments{{Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(1, 0, 0)},
                                      {Eigen::Vector3d(-1, 0, 3), Eigen::Vector3d(-1, 5, 3)}};
  const auto nearest = NearestDistance::ToSegments(segments);
  const Eigen::Vector3d x(-1, 1, 1), along_x = Eigen::Vector3d::UnitX();
  EXPECT_EQ(nearest.Along(x, along_x, 0.99)->index, 0u);
  EXPECT_NEAR(nearest.Along(x, along_x, 0.99)->distance, std::sqrt(2.0), 1e-15);
  EXPECT_NEAR(nearest.Along(x, -along_x, 0.99)->distance, std::sqrt(2.0), 1e-15);
  EXPECT_EQ(nearest.Along(x, Eigen::Vector3d::UnitY(), 0.99)->index, 1u);
  EXPECT_NEAR(nearest.Along(x, Eigen::Vector3d::UnitY(), 0.99)->distance, 2.0, 1e-15);
  EXPECT_FALSE(nearest.Along(x, Eigen::Vector3d::UnitZ(), 0.99));
}

TEST(NearestDistance, IsInfiniteWithoutAnythingAndFoundAmongThousandsInOnePlace) {
  EXPECT_EQ(NearestDistance::ToPoints({}).Of(Eigen::Vector3d::Zero()), kInfinity);
  EXPECT_EQ(NearestDistance::ToTriangles({}, {}).Of(RandomPoints(3, 1.0, 8), 1),
            std::vector<double>(3, kInfinity));
  const std::vector<Eigen::Vector3d> same(10000, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(NearestDistance::ToPoints(same).Of(Eigen::Vector3d(1, 2, 5)), 2.0);
  EXPECT_EQ(NearestDistance::ToPoints(std::span(same).first(1)).Of(Eigen::Vector3d(1, 2, 5)), 2.0);
}

TEST(BoxTree, ForEachNearVisitsAllThatIsNear) {
  const std::vector<Eigen::Vector3d> cloud = RandomPoints(3000, 1.0, 9);
  std::vector<Box3d> boxes(cloud.size());
  for (size_t i = 0; i < cloud.size(); ++i) boxes[i].Extend(cloud[i]);
  const BoxTree tree(boxes);
  for (const Eigen::Vector3d& x : RandomPoints(50, 1.0, 10)) {
    const double radius = 0.4;
    std::vector<uint32_t> found, expected;
    tree.ForEachNear(x, radius, [&](uint32_t slot) {
      const uint32_t i = tree.order()[slot];
      if ((cloud[i] - x).norm() <= radius) found.push_back(i);
    });
    for (uint32_t i = 0; i < cloud.size(); ++i) {
      if ((cloud[i] - x).norm() <= radius) expected.push_back(i);
    }
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected);
  }
}

}  // namespace
}  // namespace holba
