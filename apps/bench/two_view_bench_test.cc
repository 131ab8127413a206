// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/two_view_bench.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "holba/base/error.h"
#include "holba/base/temporary_paths.h"
#include "holba/estimation/two_view/two_view_testing.h"

namespace holba {
namespace {

class TwoViewBench : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& text) {
    const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "pairs.txt";
    std::ofstream(path) << text;
    return path;
  }
};

TEST_F(TwoViewBench, PairsAreReadAndTheirPosesFound) {
  std::string text;
  std::vector<TestPair> truth;
  for (uint64_t seed = 0; seed < 3; ++seed) {
    truth.push_back(MakeTestPair({.num_right = 50, .num_wrong = 10, .seed = seed}));
    text += "pair 800 600 700 710 405 295 60\n";
    for (size_t i = 0; i < 60; ++i) {
      for (const auto& x : {truth.back().pixels1[i], truth.back().pixels2[i]})
        text += std::to_string(x.x()) + " " + std::to_string(x.y()) + " ";
      text += "\n";
    }
  }
  const auto pairs = ReadMatchedPairs(Write(text));
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[2].pixels1.size(), 60u);
  const auto results = EstimateRelativePoses({}, pairs);
  for (size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(results[i].cam2_from_cam1);
    EXPECT_LT(RotationErrorDeg(*results[i].cam2_from_cam1, truth[i].cam2_from_cam1), 1e-2);
    EXPECT_GE(results[i].num_inliers, 50u);
  }
  EXPECT_EQ(RelativePosesToJson(results)[1]["qvec"].size(), 4u);
}

TEST_F(TwoViewBench, DamagedFilesAreNamedWithTheirLine) {
  EXPECT_THROW(ReadMatchedPairs("no/such/file"), InputError);
  EXPECT_THROW(ReadMatchedPairs(Write("pair 800 600\n")), InputError);
  EXPECT_THROW(ReadMatchedPairs(Write("pair 800 600 1 1 1 1 2\n1 2 3 4\n")), InputError);
  EXPECT_THROW(ReadMatchedPairs(Write("pair 800 600 1 1 1 1 1\n1 2 x 4\n")), InputError);
}

}  // namespace
}  // namespace holba
