// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/name_pairing.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

constexpr size_t kNone = static_cast<size_t>(-1);

// For each name of `a` the index in `b`.
std::vector<size_t> Pairs(const std::vector<std::string_view>& a,
                          const std::vector<std::string_view>& b) {
  std::vector<size_t> pairs;
  const NamePairing pairing = PairNames(a, b);
  for (const auto& j : pairing.b_of_a) pairs.push_back(j.value_or(kNone));
  return pairs;
}
using Indices = std::vector<size_t>;

TEST(PairNames, TakesEqualNamesFirst) {
  const NamePairing pairing = PairNames(std::vector<std::string_view>{"a.jpg", "b.jpg", "c"},
                                        std::vector<std::string_view>{"x/a.jpg", "b.jpg", "a.jpg"});
  EXPECT_EQ(pairing.b_of_a[0], 2u);
  EXPECT_EQ(pairing.b_of_a[1], 1u);
  EXPECT_EQ(pairing.num_whole, 2u);
  EXPECT_EQ(pairing.num_by_ending, 0u);
  EXPECT_EQ(pairing.unpaired_a, 2u);
  EXPECT_EQ(pairing.unpaired_b, 0u);
}

TEST(PairNames, LooksThroughExtensionCaseSeparatorAndFoldersBefore) {
  EXPECT_EQ(Pairs({"1.png", "2.png"}, {"2.jpg", "1.jpg"}), (Indices{1, 0}));
  EXPECT_EQ(Pairs({"IMG_1.JPG"}, {"img_1.jpg"}), (Indices{0}));
  EXPECT_EQ(Pairs({"images\\1.png"}, {"1.png"}), (Indices{0}));
  EXPECT_EQ(Pairs({"./1.png"}, {"set//1.png"}), (Indices{0}));
  EXPECT_EQ(Pairs({"1403636579.763"}, {"rgb/1403636579.763.png"}), (Indices{0}));
  EXPECT_EQ(Pairs({"cam1/000.png", "cam0/000.png"}, {"seq/cam0/000.png", "seq/cam1/000.png"}),
            (Indices{1, 0}));
  const NamePairing pairing = PairNames(std::vector<std::string_view>{"1.png", "Two.png"},
                                        std::vector<std::string_view>{"1.jpg", "two.png"});
  EXPECT_EQ(pairing.num_by_ending, 2u);
  EXPECT_EQ(pairing.examples, "'1.png' is '1.jpg', 'Two.png' is 'two.png'");
}

TEST(PairNames, DecidesByCaseAndExtensionWhereTheEndingIsShared) {
  EXPECT_EQ(Pairs({"x/a.jpg", "x/A.jpg"}, {"A.png", "a.png"}), (Indices{1, 0}));
  EXPECT_EQ(Pairs({"x/a.png"}, {"a.jpg", "a.png"}), (Indices{1}));
}

TEST(PairNames, LeavesOutWhatIsNotDecided) {
  EXPECT_EQ(Pairs({"c"}, {"x/c", "y/c"}), (Indices{kNone}));
  EXPECT_EQ(Pairs({"x/c", "y/c"}, {"c"}), (Indices{kNone, kNone}));
  EXPECT_EQ(
      PairNames(std::vector<std::string_view>{"c"}, std::vector<std::string_view>{"x/c", "y/c"})
          .num_ambiguous,
      1u);
  EXPECT_EQ(Pairs({"a"}, {"b"}), (Indices{kNone}));
  EXPECT_EQ(Pairs({}, {"b"}), (Indices{}));
}

TEST(PairNames, DoesNotTakeAFolderThatBothHaveForAnother) {
  // Of each camera one image is missing in one list: they are not each other.
  EXPECT_EQ(Pairs({"cam0/0.png", "cam0/1.png", "cam1/1.png"},
                  {"seq/cam1/0.png", "seq/cam0/1.png", "seq/cam1/1.png"}),
            (Indices{kNone, 1, 2}));
  // Folders that only one of them has may be the same.
  EXPECT_EQ(Pairs({"truth/0.png"}, {"model/0.png"}), (Indices{0}));
}

}  // namespace
}  // namespace holba
