// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/local_bench.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace holba {
namespace {

using ::testing::SizeIs;

TEST(BenchLocal, AdjustsTheSamePartsInTheModelAndAlone) {
  LocalBenchOptions options;
  options.num_images = {60, 40};
  options.max_parts = 4;
  options.bundle.refine_focal_length = options.bundle.refine_extra_params = false;
  options.solver.num_threads = 1;
  const std::vector<LocalBenchResult> results = BenchLocal(options);
  ASSERT_THAT(results, SizeIs(2));
  ASSERT_THAT(results[0].alone, SizeIs(4));
  ASSERT_THAT(results[1].alone, SizeIs(3)) << "no image is in two parts";
  for (const LocalBenchResult& result : results) {
    EXPECT_EQ(result.in_model_costs, result.alone_costs);
    EXPECT_GT(result.num_points, 100u);
  }
  for (const Table& table : LocalTables(options, results)) {
    EXPECT_THAT(table.rows, SizeIs(6));
    for (const auto& row : table.rows) EXPECT_THAT(row, SizeIs(table.header.size()));
  }
  EXPECT_THAT(LocalBenchToJson(results), SizeIs(2));
}

}  // namespace
}  // namespace holba
