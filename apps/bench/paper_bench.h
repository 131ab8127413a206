// SPDX-License-Identifier: BSD-3-Clause
// What the benchmarks of the paper's tables and figures are told, and what they give.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "apps/bench/seed_table.h"

namespace holba {

// kSmall: seconds, to see that all works; kMedium: minutes, what docs/results.md is made of;
// kPaper: the paper's numbers of images, scenes and pixels.
enum class BenchSize { kSmall, kMedium, kPaper };

struct PaperBenchOptions {
  BenchSize size = BenchSize::kMedium;
  uint64_t seed = 0;            // the first one
  int num_seeds = 0;            // 0: by size
  std::vector<int> num_images;  // empty: by size
  int num_threads = -1;
  // Folder where renderings and their databases stay for the next run; empty: none.
  std::string work_path;

  // 2, 5 and 8 scenes (the paper has 8 of Hypersim).
  int NumSeeds() const;
  // "0", "1", ...
  std::vector<std::string> SeedNames() const;
  // The given one, else the one for the size.
  int NumImages(int small, int medium, int paper) const;
};

struct PaperBenchReport {
  std::vector<SeedTable> tables;
  std::string plot;  // SVG
};

// {"benchmark", "tables": [..]}
nlohmann::ordered_json PaperBenchToJson(std::string_view benchmark, const PaperBenchReport& report);

}  // namespace holba
