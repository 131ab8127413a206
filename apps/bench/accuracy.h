// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `accuracy`: errors of adjusted synthetic scenes against their truth, seed by seed.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/table.h"
#include "holba/bundle/bundle_options.h"
#include "holba/evaluation/alignment.h"
#include "holba/solver/solver.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {

struct AccuracyOptions {
  std::vector<Visibility> visibilities;
  int num_seeds = 10;          // scene.seed and the following ones
  BundleProblemOptions scene;  // visibility apart
  BundleOptions bundle;        // configuration apart
  SolverOptions solver;
  AlignmentBasis alignment = AlignmentBasis::kAuto;
  // Of the errors of one scene: the median instead of the root mean square.
  bool median = false;
};

// Errors of one method, one number per seed, by the names of AccuracyMeasures().
struct AccuracyRow {
  std::string method;
  std::vector<std::vector<double>> errors;
  std::vector<double> iterations, seconds;  // per seed
};
struct AccuracyResult {
  Visibility visibility = Visibility::kRandom;
  std::vector<AccuracyRow>
      rows;  // Start, Point, Point-Line, Groups, Holistic, Holistic with strong weights
};

// Names with units, in the order of AccuracyRow::errors.
const std::vector<std::string>& AccuracyMeasures();

std::vector<AccuracyResult> MeasureAccuracy(const AccuracyOptions& options);

// For each visibility a table of means over the seeds, and one of the ratios to Point seed by seed.
std::vector<Table> AccuracyTables(const AccuracyOptions& options,
                                  const std::vector<AccuracyResult>& results);
nlohmann::json AccuracyToJson(const std::vector<AccuracyResult>& results);

}  // namespace holba
