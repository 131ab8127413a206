// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/union_find.h"

#include <gtest/gtest.h>

#include <vector>

#include "holba/base/random.h"

namespace holba {
namespace {

TEST(UnionFind, ASetKeepsTheRootThatItWasJoinedInto) {
  UnionFind sets(5);
  for (uint32_t i = 0; i < 5; ++i) EXPECT_EQ(sets.Root(i), i);
  sets.Join(3, 1);
  sets.Join(0, 4);
  sets.Join(1, 4);  // elements stand for their sets
  for (const uint32_t i : {0u, 1u, 3u, 4u}) EXPECT_EQ(sets.Root(i), 3u);
  EXPECT_EQ(sets.Root(2), 2u);
  sets.Join(0, 1);  // of one set: nothing
  EXPECT_EQ(sets.Root(0), 3u);
}

TEST(UnionFind, SetsAreThoseOfLabelsThatAreReplacedOneByOne) {
  constexpr uint32_t kSize = 200;
  Random random(1);
  UnionFind sets(kSize);
  std::vector<uint32_t> label(kSize);
  for (uint32_t i = 0; i < kSize; ++i) label[i] = i;
  for (int step = 0; step < 150; ++step) {
    const auto a = static_cast<uint32_t>(random.Index(kSize));
    const auto b = static_cast<uint32_t>(random.Index(kSize));
    sets.Join(a, b);
    const uint32_t into = label[a], from = label[b];
    for (uint32_t& l : label) l = l == from ? into : l;
    for (uint32_t i = 0; i < kSize; ++i) ASSERT_EQ(sets.Root(i), label[i]);
  }
}

}  // namespace
}  // namespace holba
