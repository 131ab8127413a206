// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/descriptor_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "holba/base/random.h"
#include "holba/simd/targets.h"

namespace holba {
namespace {

// Near each other in groups, so that limits and ties matter. Length about 512.
Descriptors RandomBytes(size_t count, int length, uint64_t seed) {
  Random random(seed), common(99);
  Descriptors descriptors;
  descriptors.num_bytes = length;
  std::vector<std::vector<double>> centres(40, std::vector<double>(length));
  for (auto& centre : centres) {
    for (double& x : centre) x = std::abs(common.Normal());
  }
  for (size_t i = 0; i < count; ++i) {
    std::vector<double> x = centres[random.Index(centres.size())];
    double squared = 0.0;
    for (double& v : x) {
      v = std::abs(v + random.Normal(0.2));
      squared += v * v;
    }
    for (double v : x)
      descriptors.data.push_back(uint8_t(std::min(255.0, 512 * v / std::sqrt(squared))));
  }
  return descriptors;
}

Descriptors ToFloats(const Descriptors& bytes) {
  Descriptors floats;
  floats.type = 1;
  floats.num_bytes = 4 * bytes.num_bytes;
  floats.data.resize(4 * bytes.data.size());
  for (size_t k = 0; k < bytes.data.size(); ++k) {
    const float v = bytes.data[k];
    std::memcpy(floats.data.data() + 4 * k, &v, 4);
  }
  return floats;
}

TEST(DescriptorMatching, FloatsOfTheTypeUndefinedAreFloats) {
  Random random(9);
  Descriptors aliked;
  aliked.type = 1;
  aliked.num_bytes = 4 * 64;
  for (int k = 0; k < 50 * 64; ++k) {
    const auto value = static_cast<float>(random.Normal());
    const auto* bytes = reinterpret_cast<const uint8_t*>(&value);
    aliked.data.insert(aliked.data.end(), bytes, bytes + 4);
  }
  Descriptors undefined = aliked;
  undefined.type = -1;
  const PackedDescriptors a(aliked, 100), b(undefined, 100);
  EXPECT_TRUE(b.are_floats());
  EXPECT_EQ(b.length(), 64);
  EXPECT_EQ(MatchDescriptors({}, a, b).matches.size(), 50u);
  undefined.type = 0;
  EXPECT_FALSE(PackedDescriptors(undefined, 100).are_floats());
}

// By the definition, one pair after the other.
PointMatches Plain(const DescriptorMatchOptions& options, const PackedDescriptors& a,
                   const PackedDescriptors& b) {
  const double max_distance = a.are_floats() ? std::acos(options.min_cossim) : options.max_distance;
  const auto nearest = [&](const PackedDescriptors& from, size_t i, const PackedDescriptors& to) {
    double best = 0.0, second = 0.0;
    int idx = -1;
    for (size_t j = 0; j < to.size(); ++j) {
      const double c = from.Cosine(i, to, j);
      if (c > best) {
        second = best;
        best = c;
        idx = int(j);
      } else if (c > second) {
        second = c;
      }
    }
    const double distance = std::acos(std::min(best, 1.0));
    if (distance > max_distance || distance >= options.max_ratio * std::acos(std::min(second, 1.0)))
      idx = -1;
    return idx;
  };
  PointMatches matches;
  for (size_t i = 0; i < a.size(); ++i) {
    const int j = nearest(a, i, b);
    if (j < 0 || (options.cross_check && nearest(b, j, a) != int(i))) continue;
    matches.push_back({point2D_t(i), point2D_t(j)});
  }
  return matches;
}

class EveryTarget : public testing::TestWithParam<SimdTarget> {
 protected:
  void SetUp() override {
    if (!IsSupported(GetParam())) GTEST_SKIP() << "not on this processor";
    before_ = CurrentSimdTarget();
    SetSimdTarget(GetParam());
  }
  void TearDown() override {
    if (IsSupported(GetParam())) SetSimdTarget(before_);
  }
  SimdTarget before_ = SimdTarget::kScalar;
};

TEST_P(EveryTarget, MatchesAreThoseOfThePlainDefinition) {
  size_t total = 0;
  for (const auto& [n1, n2] : {std::pair{1, 1}, {5, 63}, {64, 65}, {130, 77}, {201, 320}}) {
    for (int length : {128, 36, 30}) {
      const Descriptors d1 = RandomBytes(n1, length, 1), d2 = RandomBytes(n2, length, 2);
      for (bool floats : {false, true}) {
        for (bool cross_check : {false, true}) {
          const DescriptorMatchOptions options{
              .max_ratio = 0.97, .max_distance = 0.8, .cross_check = cross_check};
          const PackedDescriptors a(floats ? ToFloats(d1) : d1, 1000);
          const PackedDescriptors b(floats ? ToFloats(d2) : d2, 1000);
          PointMatches found = MatchDescriptors(options, a, b).matches;
          std::sort(found.begin(), found.end());
          EXPECT_EQ(found, Plain(options, a, b)) << n1 << " " << n2 << " " << length;
          total += found.size();
        }
      }
    }
  }
  EXPECT_GT(total, 100u);
}

TEST_P(EveryTarget, TheLargestBytesDoNotOverflow) {
  Descriptors d;
  d.num_bytes = 128;
  d.data.assign(128 * 3, 255);
  std::fill_n(d.data.begin() + 128, 256, 0);
  d.data[128] = 255;
  const PackedDescriptors packed(d, 10);
  DescriptorMatchOptions options;
  options.max_ratio = 1.0;
  const PointMatches matches = MatchDescriptors(options, packed, packed).matches;
  ASSERT_FALSE(matches.empty());
  EXPECT_THAT(matches, testing::Contains(std::array<point2D_t, 2>{0, 0}));
}

INSTANTIATE_TEST_SUITE_P(Targets, EveryTarget,
                         testing::Values(SimdTarget::kScalar, SimdTarget::kVec128,
                                         SimdTarget::kVec256, SimdTarget::kVec512),
                         [](const auto& info) { return std::string(NameOf(info.param)); });

TEST(MatchDescriptors, TheBestRatioComesFirst) {
  const PackedDescriptors a(RandomBytes(200, 128, 1), 1000), b(RandomBytes(200, 128, 2), 1000);
  DescriptorMatchOptions options;
  options.max_ratio = 0.97;
  const PointMatches all = MatchDescriptors(options, a, b).matches;
  options.max_ratio = 0.92;
  const PointMatches few = MatchDescriptors(options, a, b).matches;
  ASSERT_LT(few.size(), all.size());
  EXPECT_TRUE(std::equal(few.begin(), few.end(), all.begin()));
}

TEST(MatchDescriptors, DifferentKindsAndNothingHaveNoMatches) {
  const Descriptors bytes = RandomBytes(20, 128, 1);
  const PackedDescriptors a(bytes, 100), none(Descriptors{}, 100), limited(bytes, 0);
  EXPECT_TRUE(MatchDescriptors({}, a, none).matches.empty());
  EXPECT_TRUE(MatchDescriptors({}, limited, a).matches.empty());
  EXPECT_TRUE(MatchDescriptors({}, a, PackedDescriptors(ToFloats(bytes), 100)).matches.empty());
  EXPECT_TRUE(MatchDescriptors({}, a, PackedDescriptors(RandomBytes(9, 64, 1), 9)).matches.empty());
  EXPECT_EQ(PackedDescriptors(bytes, 7).size(), 7u);
}

}  // namespace
}  // namespace holba
