// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/covisibility.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

// Points in random images, some twice in one image; image ids are not their positions.
Reconstruction RandomTracks(uint64_t seed, size_t num_images, size_t num_points) {
  Random random(seed);
  Reconstruction model;
  for (size_t i = 0; i < num_images; ++i) {
    model.images.Add(static_cast<image_t>(100 - 2 * i), Image{});
  }
  for (point3D_t id = 1; id <= num_points; ++id) {
    Point3D point;
    const size_t length = random.Index(6);
    for (size_t k = 0; k < length; ++k) {
      const auto image_id = static_cast<image_t>(100 - 2 * random.Index(num_images));
      std::vector<Point2D>& points2D = model.images.at(image_id).points2D;
      point.track.push_back({image_id, static_cast<point2D_t>(points2D.size())});
      points2D.push_back({{0, 0}, 7 * id});
    }
    model.points3D.Add(7 * id, point);
  }
  return model;
}

using Sighting = std::tuple<uint32_t, point2D_t, point2D_t>;

// All pairs of observations of all tracks, the plain way.
std::map<std::pair<size_t, size_t>, std::vector<Sighting>> ByBruteForce(
    const Reconstruction& model) {
  std::map<std::pair<size_t, size_t>, std::vector<Sighting>> shared;
  uint32_t point_idx = 0;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& a : point.track) {
      for (const PointObservation& b : point.track) {
        if (a.image_id == b.image_id) continue;
        shared[{model.images.IndexOf(a.image_id), model.images.IndexOf(b.image_id)}].emplace_back(
            point_idx, a.point2D_idx, b.point2D_idx);
      }
    }
    ++point_idx;
  }
  return shared;
}

TEST(Covisibility, AgreesWithAllPairsOfObservations) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Reconstruction model = RandomTracks(seed, 2 + seed, 15 * seed);
    const auto expected = ByBruteForce(model);
    const Covisibility covisibility(model);
    ASSERT_EQ(covisibility.num_images(), model.images.size());
    size_t num_pairs = 0;
    for (size_t i = 0; i < covisibility.num_images(); ++i) {
      const auto neighbours = covisibility.NeighboursOf(i);
      const Covisibility::Shared shared = covisibility.SharedWithNeighbours(i);
      ASSERT_EQ(shared.size(), neighbours.size());
      num_pairs += neighbours.size();
      for (size_t k = 0; k < neighbours.size(); ++k) {
        if (k > 0) {
          EXPECT_LT(neighbours[k - 1].image_idx, neighbours[k].image_idx);
        }
        std::vector<Sighting> found;
        std::set<uint32_t> points;
        for (const SharedSighting& s : shared[k]) {
          found.emplace_back(s.point_idx, s.point2D_idx1, s.point2D_idx2);
          points.insert(s.point_idx);
        }
        // In the same order, too.
        EXPECT_EQ(found, expected.at({i, neighbours[k].image_idx}));
        EXPECT_EQ(neighbours[k].num_points, points.size());
        EXPECT_EQ(neighbours[k].num_sightings, found.size());
      }
      std::set<point3D_t> seen;
      for (const Point2D& p : (model.images.begin() + i)->second.points2D) {
        seen.insert(p.point3D_id);
      }
      EXPECT_EQ(covisibility.NumPoints(i), seen.size());
    }
    EXPECT_EQ(num_pairs, expected.size());
  }
}

TEST(Covisibility, IsSymmetric) {
  const Covisibility covisibility(RandomTracks(5, 12, 60));
  for (uint32_t i = 0; i < covisibility.num_images(); ++i) {
    for (const Covisibility::Neighbour& n : covisibility.NeighboursOf(i)) {
      bool found = false;
      for (const Covisibility::Neighbour& back : covisibility.NeighboursOf(n.image_idx)) {
        if (back.image_idx != i) continue;
        found = true;
        EXPECT_EQ(back.num_points, n.num_points);
        EXPECT_EQ(back.num_sightings, n.num_sightings);
      }
      EXPECT_TRUE(found);
    }
  }
}

TEST(Covisibility, HoldsNothingForImagesThatShareNothing) {
  // A chain: each point in two images that follow each other.
  constexpr uint32_t kNum = 5000;
  std::vector<CovisibleSighting> sightings;
  for (uint32_t i = 0; i + 1 < kNum; ++i) {
    sightings.push_back({i, i, 0});
    sightings.push_back({i, i + 1, 1});
  }
  const Covisibility covisibility(kNum + 1, kNum - 1, sightings);
  size_t num_neighbours = 0;
  for (size_t i = 0; i <= kNum; ++i) num_neighbours += covisibility.NeighboursOf(i).size();
  EXPECT_EQ(num_neighbours, 2u * (kNum - 1));
  EXPECT_TRUE(covisibility.NeighboursOf(kNum).empty());
  EXPECT_EQ(covisibility.SharedWithNeighbours(kNum).size(), 0u);
}

TEST(Covisibility, OfWhatIsNotThereIsAFault) {
  const std::vector<CovisibleSighting> sightings = {{0, 3, 0}};
  EXPECT_THROW(Covisibility(3, 1, sightings), CheckError);
  EXPECT_THROW(Covisibility(4, 0, sightings), CheckError);
}

}  // namespace
}  // namespace holba
