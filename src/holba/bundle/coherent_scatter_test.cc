// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/coherent_scatter.h"

#include <gtest/gtest.h>

#include "holba/base/random.h"

namespace holba {
namespace {

// Members in a square of the plane z = 0 with independent offsets of one standard deviation, and
// `step` more on the right half.
std::vector<MemberOffset> Members(size_t count, double step, uint64_t seed) {
  Random random(seed);
  std::vector<MemberOffset> members;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d X(random.Uniform(-1.0, 1.0), random.Uniform(-1.0, 1.0), 0.0);
    const double offset = random.Normal() + (X.x() > 0.0 ? 0.5 * step : -0.5 * step);
    members.push_back({X, offset * Eigen::Vector3d::UnitZ()});
  }
  return members;
}

TEST(CoherentVariance, IsAtMostOneOfIndependentMembers) {
  int num_above = 0;
  for (uint64_t seed = 0; seed < 100; ++seed) {
    std::vector<MemberOffset> members = Members(300, 0.0, seed);
    num_above += CoherentVariance(3, &members) > 1.0;
  }
  // Each of the levels (8, 16, 32, 64 blocks) is a test at 95 %.
  EXPECT_LE(num_above, 25);
}

TEST(CoherentVariance, GrowsWithTheMembersThatAreOffTogether) {
  // Blocks of a eighth of the members, each half a step off: n / 8 (step / 2)^2 and the noise's 1,
  // times 8 blocks over the quantile of 5 degrees of freedom (11.07).
  for (const double step : {1.0, 2.0, 4.0}) {
    std::vector<MemberOffset> members = Members(800, step, 3);
    const double expected = (100.0 * 0.25 * step * step + 1.0) * 8.0 / 11.07;
    EXPECT_NEAR(CoherentVariance(3, &members), expected, 0.15 * expected + 1.0);
  }
}

TEST(CoherentVariance, DoesNotDependOnTheSideThatOffsetsPointTo) {
  std::vector<MemberOffset> members = Members(500, 1.0, 5), mirrored = members;
  for (MemberOffset& member : mirrored) member.offset = -member.offset;
  EXPECT_EQ(CoherentVariance(3, &members), CoherentVariance(3, &mirrored));
}

TEST(CoherentVariance, FewMembersSayNothing) {
  std::vector<MemberOffset> members = Members(31, 10.0, 7);
  EXPECT_EQ(CoherentVariance(3, &members), 0.0);
  std::vector<MemberOffset> none;
  EXPECT_EQ(CoherentVariance(3, &none), 0.0);
}

}  // namespace
}  // namespace holba
