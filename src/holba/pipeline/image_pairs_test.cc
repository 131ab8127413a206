// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/image_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

// `num` points that these images see, each at pixels that tell the image and the point.
void AddPoints(const std::vector<image_t>& image_ids, int num, Reconstruction* model) {
  for (int i = 0; i < num; ++i) {
    const point3D_t id = model->points3D.size() + 1;
    Point3D point;
    for (const image_t image_id : image_ids) {
      model->images.Add(image_id, Image{});
      std::vector<Point2D>& points2D = model->images.at(image_id).points2D;
      point.track.push_back({image_id, static_cast<point2D_t>(points2D.size())});
      points2D.push_back({{image_id, static_cast<double>(id)}, id});
    }
    model->points3D.Add(id, point);
  }
}

TEST(ImagePairs, AreThoseThatShareMostPoints) {
  Reconstruction model;
  AddPoints({9, 2}, 12, &model);
  AddPoints({2, 5}, 11, &model);
  AddPoints({9, 5}, 9, &model);
  AddPoints({5, 7, 2}, 10, &model);
  // 2-5: 21, 2-9: 12, 2-7: 10, 5-7: 10, 5-9: 9.
  const auto sizes = [&](const ImagePairOptions& options) {
    std::map<ImagePair, size_t> numbers;
    for (const auto& [pair, points] : PairsWithSharedPoints(options, model)) {
      numbers[pair] = points.size();
    }
    return numbers;
  };
  using Sizes = std::map<ImagePair, size_t>;
  EXPECT_EQ(sizes({}), (Sizes{{{2, 5}, 21}, {{2, 7}, 10}, {{2, 9}, 12}, {{5, 7}, 10}}));
  EXPECT_EQ(sizes({.min_shared_points = 0}).size(), 5u);
  EXPECT_EQ(sizes({.min_shared_points = 13}), (Sizes{{{2, 5}, 21}}));
  // The best of each image; of equals (7 with 2 and 5) the smaller id.
  EXPECT_EQ(sizes({.max_pairs_per_image = 1}),
            (Sizes{{{2, 5}, 21}, {{2, 7}, 10}, {{2, 9}, 12}}));
}

TEST(ImagePairs, KnowWhereTheirImagesSeeTheSamePoints) {
  Reconstruction model;
  AddPoints({9, 2}, 1, &model);
  AddPoints({4}, 1, &model);
  AddPoints({2, 9}, 1, &model);
  const auto pairs = PairsWithSharedPoints({.min_shared_points = 1}, model);
  ASSERT_THAT(pairs, ElementsAre(Pair(ImagePair{2, 9}, testing::SizeIs(2))));
  EXPECT_THAT(pairs.at({2, 9}),
              ElementsAre(Pair(Eigen::Vector2d(2, 1), Eigen::Vector2d(9, 1)),
                          Pair(Eigen::Vector2d(2, 3), Eigen::Vector2d(9, 3))));
}

// All pairs of observations of all tracks, the plain way, in their order.
TEST(ImagePairs, AgreeWithAllPairsOfObservations) {
  Random random(4);
  Reconstruction model;
  for (int i = 0; i < 60; ++i) {
    std::vector<image_t> ids;
    const size_t length = 1 + random.Index(5);
    // An image may see a point twice.
    for (size_t k = 0; k < length; ++k) {
      ids.push_back(static_cast<image_t>(50 - 3 * random.Index(8)));
    }
    AddPoints(ids, 1, &model);
  }
  std::map<ImagePair, std::vector<SharedPoint>> expected;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& a : point.track) {
      for (const PointObservation& b : point.track) {
        if (a.image_id >= b.image_id) continue;
        expected[{a.image_id, b.image_id}].emplace_back(
            model.images.at(a.image_id).points2D[a.point2D_idx].xy,
            model.images.at(b.image_id).points2D[b.point2D_idx].xy);
      }
    }
  }
  EXPECT_EQ(PairsWithSharedPoints({.max_pairs_per_image = 100, .min_shared_points = 1}, model),
            expected);
}

}  // namespace
}  // namespace holba
