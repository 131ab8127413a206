// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/density_bench.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>

#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

using Pair = std::pair<image_t, image_t>;

template <typename Track>
std::set<image_t> ImagesOf(const Track& track) {
  std::set<image_t> images;
  for (const auto& observation : track) images.insert(observation.image_id);
  return images;
}

void AddPairs(const std::set<image_t>& images, std::set<Pair>* pairs) {
  for (const image_t a : images)
    for (const image_t b : images)
      if (a < b) pairs->insert({a, b});
}

// The paper's count, made from the tracks alone: a point and a line that an edge ties are each
// seen, as far as the reduced system is concerned, by all images that see either.
std::pair<double, double> CountedDensities(const Reconstruction& model) {
  std::set<Pair> without;
  for (const auto& [id, point] : model.points3D) AddPairs(ImagesOf(point.track), &without);
  for (const auto& [id, line] : model.lines3D) AddPairs(ImagesOf(line.track), &without);
  std::map<point3D_t, std::set<image_t>> of_point;
  std::map<line3D_t, std::set<image_t>> of_line;
  for (const WireframeEdge& edge : model.wireframe) {
    const auto point = ImagesOf(model.points3D.at(edge.point3D_id).track);
    const auto line = ImagesOf(model.lines3D.at(edge.line3D_id).track);
    for (auto* joined : {&of_point[edge.point3D_id], &of_line[edge.line3D_id]}) {
      joined->insert(point.begin(), point.end());
      joined->insert(line.begin(), line.end());
    }
  }
  std::set<Pair> with = without;
  for (const auto& [id, images] : of_point) AddPairs(images, &with);
  for (const auto& [id, images] : of_line) AddPairs(images, &with);
  const double n = static_cast<double>(model.images.size());
  const double all = 0.5 * n * (n - 1.0);
  return {100.0 * static_cast<double>(without.size()) / all,
          100.0 * static_cast<double>(with.size()) / all};
}

TEST(Density, IsTheShareOfPairsThatTracksCount) {
  for (const Visibility visibility : {Visibility::kNear, Visibility::kCluster}) {
    BundleProblemOptions scene;
    scene.num_images = 60;
    scene.visibility = visibility;
    const Reconstruction model = MakeBundleProblem(scene).truth;
    const auto [without, with] = CountedDensities(model);
    const std::vector<double> density = DensityOf(model, {});
    EXPECT_EQ(density[0], 60.0);
    EXPECT_EQ(density[1], static_cast<double>(model.points3D.size()));
    EXPECT_EQ(density[2], static_cast<double>(model.lines3D.size()));
    EXPECT_EQ(density[3], static_cast<double>(model.wireframe.size()));
    EXPECT_NEAR(density[4], without, 1e-9);
    EXPECT_NEAR(density[5], with, 1e-9);
    EXPECT_NEAR(density[6], 100.0 * (with - without) / without, 1e-9);
    EXPECT_LT(without, with);
    EXPECT_LT(with, 100.0);
  }
}

TEST(Density, HasARowForEachSceneAndTheWireframeTakesNoPairAway) {
  PaperBenchOptions options;
  options.size = BenchSize::kSmall;
  options.seed = 3;
  const PaperBenchReport report = BenchDensity(options, {}, {});
  ASSERT_EQ(report.tables.size(), 1u);
  const SeedTable& table = report.tables[0];
  EXPECT_THAT(table.rows, ::testing::ElementsAre("sphere", "street", "collection"));
  EXPECT_THAT(table.cases, ::testing::ElementsAre("3", "4"));
  for (size_t r = 0; r < table.rows.size(); ++r) {
    for (size_t s = 0; s < 2; ++s) {
      EXPECT_EQ(table.values[r][0][s], 50.0);
      EXPECT_GT(table.values[r][4][s], 0.0);
      EXPECT_LE(table.values[r][4][s], table.values[r][5][s]);
    }
  }
}

}  // namespace
}  // namespace holba
