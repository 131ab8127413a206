// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `sfm`: the mapper on synthetic databases with points alone and with structure; the
// paper's table of runtime and reconstruction, with errors against the truth.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/bench/table.h"
#include "holba/base/options.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

struct SfmBenchOptions {
  PhotoSetOptions photos;  // number of images apart
  std::vector<int> num_images = {100};
  // Names of --Mapper.structure.
  std::vector<std::string> structures = {"none", "lines", "groups", "holistic"};
  int num_threads = -1;
  // Of the page that shows the last model beside the truth; empty: none.
  std::string page_path;
};

struct SfmBenchReport {
  std::vector<Table> tables;
  nlohmann::json results;  // an object for each size and structure
};

// `holba map` with its defaults, intrinsics that the database knows exactly held. Databases and
// models are made in the folder for temporary files and removed.
SfmBenchReport BenchSfm(const SfmBenchOptions& options);

}  // namespace holba
