// SPDX-License-Identifier: BSD-3-Clause
// docs/results.md from the results of the benchmarks: the paper's figures beside ours, whether the
// paper's order of rows holds, and what differs.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "apps/bench/paper_bench.h"

namespace holba {

// Benchmarks of the page, in its order.
std::vector<std::string> BenchmarksOfPage();

// By benchmark, from FOLDER/NAME.json; one that is not there is said on the log. Throws InputError
// for a file that is no result, and if there is none.
std::map<std::string, std::vector<SeedTable>> ReadResults(const std::filesystem::path& folder);

// Markdown. `plots`: where the plots are as seen from the page ("results"), of benchmarks in
// `results` alone.
std::string ResultsPage(const std::map<std::string, std::vector<SeedTable>>& results,
                        const std::string& plots);

// Figures of ours with the paper's in parentheses, where there are such.
Table BesidePaper(const SeedTable& table);
// "In 5 of 6 comparisons ... ". Empty: nothing can be compared.
std::string OrderText(const SeedTable& table);

}  // namespace holba
