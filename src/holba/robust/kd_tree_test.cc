// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/kd_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "holba/base/random.h"

namespace holba {
namespace {

std::vector<uint32_t> NearestByForce(const std::vector<Eigen::Vector3d>& points,
                                     const Eigen::Vector3d& x, size_t k) {
  std::vector<uint32_t> order(points.size());
  for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return (points[a] - x).squaredNorm() < (points[b] - x).squaredNorm();
  });
  order.resize(std::min(k, order.size()));
  return order;
}

std::vector<uint32_t> Indices(const std::vector<KdTree::Neighbour>& neighbours) {
  std::vector<uint32_t> indices;
  for (const KdTree::Neighbour& n : neighbours) indices.push_back(n.index);
  return indices;
}

TEST(KdTree, FindsTheSameNeighboursAsComparingAll) {
  Random random(1);
  for (const size_t size : {1, 2, 13, 500}) {
    std::vector<Eigen::Vector3d> points(size);
    for (Eigen::Vector3d& X : points) {
      // Rounded, so that many distances are equal.
      for (double& x : X) x = std::round(random.Normal(4.0));
    }
    const KdTree tree(points);
    EXPECT_EQ(tree.size(), size);
    for (const size_t k : {1, 7, 60}) {
      for (int trial = 0; trial < 50; ++trial) {
        const Eigen::Vector3d x(random.Normal(5.0), random.Normal(5.0),
                                std::round(random.Normal()));
        EXPECT_EQ(Indices(tree.Nearest(x, k)), NearestByForce(points, x, k));
      }
    }
  }
}

TEST(KdTree, OfNoPointsHasNoNeighbours) {
  EXPECT_THAT(KdTree({}).Nearest(Eigen::Vector3d::Zero(), 3), testing::IsEmpty());
}

}  // namespace
}  // namespace holba
