// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/paper_bench.h"

namespace holba {

int PaperBenchOptions::NumSeeds() const {
  if (num_seeds > 0) return num_seeds;
  return size == BenchSize::kSmall ? 2 : size == BenchSize::kMedium ? 5 : 8;
}

std::vector<std::string> PaperBenchOptions::SeedNames() const {
  std::vector<std::string> names;
  for (int i = 0; i < NumSeeds(); ++i)
    names.push_back(std::to_string(seed + static_cast<uint64_t>(i)));
  return names;
}

int PaperBenchOptions::NumImages(int small, int medium, int paper) const {
  if (!num_images.empty()) return num_images.front();
  return size == BenchSize::kSmall ? small : size == BenchSize::kMedium ? medium : paper;
}

nlohmann::ordered_json PaperBenchToJson(std::string_view benchmark,
                                        const PaperBenchReport& report) {
  nlohmann::ordered_json json = {{"benchmark", benchmark}};
  json["tables"] = nlohmann::ordered_json::array();
  for (const SeedTable& table : report.tables) json["tables"].push_back(SeedTableToJson(table));
  return json;
}

}  // namespace holba
