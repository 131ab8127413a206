// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `local`: a part of a large model adjusted in place against the part alone.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/table.h"
#include "holba/bundle/bundle_options.h"
#include "holba/solver/solver.h"

namespace holba {

struct LocalBenchOptions {
  std::vector<int> num_images = {2000};  // of the streets (synthetic/point_graph.h, kSequence)
  uint64_t seed = 0;
  int part_images = 12;  // in a row
  int max_parts = 50;    // spread over the street, none shares an image with another
  BundleOptions bundle;  // configuration apart
  SolverOptions solver;
};

// Seconds of the steps of one adjustment.
struct LocalTimes {
  double select = 0.0, build = 0.0, solve = 0.0, write_back = 0.0;
  double SetUp() const { return select + build; }
  double Adjustment() const { return build + solve + write_back; }
};

struct LocalBenchResult {
  int num_images = 0;
  size_t num_points = 0;                      // mean of the parts
  std::vector<LocalTimes> in_model, alone;    // of the same parts
  std::vector<double> in_model_costs, alone_costs;  // at the end
};

// Each part is adjusted once in the model and once as a model of its own, in turn; both from the
// same start.
std::vector<LocalBenchResult> BenchLocal(const LocalBenchOptions& options);

// One table for each street: medians over the parts.
std::vector<Table> LocalTables(const LocalBenchOptions& options,
                               const std::vector<LocalBenchResult>& results);
nlohmann::json LocalBenchToJson(const std::vector<LocalBenchResult>& results);

}  // namespace holba
