// SPDX-License-Identifier: BSD-3-Clause
#include "holba/robust/j_linkage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <vector>

#include "holba/base/random.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

using Clusters = std::vector<std::vector<size_t>>;

PreferenceSets ToBits(const std::vector<std::set<size_t>>& sets, size_t num_hypotheses) {
  PreferenceSets bits(sets.size(), num_hypotheses);
  for (size_t i = 0; i < sets.size(); ++i) {
    for (const size_t hypothesis : sets[i]) bits.Insert(i, hypothesis);
  }
  return bits;
}

// The definition, word for word: all pairs anew in every step.
Clusters Reference(std::vector<std::set<size_t>> sets) {
  Clusters clusters;
  for (size_t i = 0; i < sets.size(); ++i) clusters.push_back({i});
  while (true) {
    double least = 1.0;
    size_t a = 0, b = 0;
    std::set<size_t> merged;
    for (size_t i = 0; i < sets.size(); ++i) {
      for (size_t j = i + 1; j < sets.size(); ++j) {
        std::set<size_t> common, either;
        std::set_intersection(sets[i].begin(), sets[i].end(), sets[j].begin(), sets[j].end(),
                              std::inserter(common, common.end()));
        std::set_union(sets[i].begin(), sets[i].end(), sets[j].begin(), sets[j].end(),
                       std::inserter(either, either.end()));
        if (common.empty()) continue;
        const double distance = 1.0 - static_cast<double>(common.size()) / either.size();
        if (distance < least) {
          least = distance;
          a = i;
          b = j;
          merged = common;
        }
      }
    }
    if (least == 1.0) break;
    sets[a] = merged;
    sets.erase(sets.begin() + b);
    clusters[a].insert(clusters[a].end(), clusters[b].begin(), clusters[b].end());
    std::sort(clusters[a].begin(), clusters[a].end());
    clusters.erase(clusters.begin() + b);
  }
  return clusters;
}

TEST(JLinkage, GivesTheClustersOfTheDefinition) {
  Random random(3);
  size_t num_merged = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const size_t num_items = 1 + random.Index(25);
    // Small counts make many equal distances; large ones several words.
    const size_t num_hypotheses = 1 + random.Index(trial % 2 == 0 ? 10 : 300);
    const double density = random.Uniform(0.02, 0.6);
    std::vector<std::set<size_t>> sets(num_items);
    for (auto& set : sets) {
      for (size_t j = 0; j < num_hypotheses; ++j) {
        if (random.Uniform() < density) set.insert(j);
      }
    }
    const Clusters clusters = ClusterByJLinkage(ToBits(sets, num_hypotheses));
    ASSERT_EQ(clusters, Reference(sets)) << "trial " << trial;
    num_merged += num_items - clusters.size();
  }
  EXPECT_GT(num_merged, 1000u);
}

TEST(JLinkage, TakesTheLeastOfAllDistancesNotOfAChain) {
  // 0 and 1 have 2 of 6 in common; 2 has 2 of 4 in common with each, but is all of what they share:
  // after one merge, the set of the pair is the third one's.
  const std::vector<std::set<size_t>> sets = {{0, 1, 2, 3}, {0, 1, 4, 5}, {0, 1}, {7, 8}, {7}};
  EXPECT_EQ(ClusterByJLinkage(ToBits(sets, 9)), Reference(sets));
  EXPECT_THAT(ClusterByJLinkage(ToBits(sets, 9)),
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(3, 4)));
}

TEST(JLinkage, LeavesItemsThatAgreeWithNothingAlone) {
  EXPECT_THAT(ClusterByJLinkage(PreferenceSets(0, 10)), IsEmpty());
  EXPECT_THAT(ClusterByJLinkage(PreferenceSets(1, 10)), ElementsAre(ElementsAre(0)));
  EXPECT_THAT(ClusterByJLinkage(PreferenceSets(3, 10)),
              ElementsAre(ElementsAre(0), ElementsAre(1), ElementsAre(2)));
  EXPECT_THAT(ClusterByJLinkage(PreferenceSets(2, 0)), ElementsAre(ElementsAre(0), ElementsAre(1)));
}

TEST(JLinkage, JoinsItemsWithEqualSets) {
  PreferenceSets sets(300, 130);
  for (size_t i = 0; i < 300; ++i) {
    sets.Insert(i, i % 3);
    sets.Insert(i, 127 + i % 3);
  }
  const Clusters clusters = ClusterByJLinkage(sets);
  ASSERT_EQ(clusters.size(), 3u);
  for (size_t c = 0; c < 3; ++c) {
    ASSERT_EQ(clusters[c].size(), 100u);
    for (const size_t i : clusters[c]) EXPECT_EQ(i % 3, c);
  }
}

}  // namespace
}  // namespace holba
