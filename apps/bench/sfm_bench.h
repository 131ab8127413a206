// SPDX-License-Identifier: BSD-3-Clause
// The benchmarks `sfm` and `breakdown`: the mapper on synthetic databases with points alone and
// with structure; the paper's Table 1 with errors against the truth, and its runtime figure c.
#pragma once

#include <string>
#include <vector>

#include "apps/bench/paper_bench.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

struct SfmBenchOptions {
  PaperBenchOptions bench;
  PhotoSetOptions photos;  // number of images and seed apart
  // Names of --Mapper.structure.
  std::vector<std::string> structures = {"none", "lines", "groups", "holistic"};
  // Of the page that shows the last model beside the truth; empty: none.
  std::string page_path;
};

// `holba map` with its defaults, intrinsics that the database knows exactly held. Databases and
// models are made in the folder for temporary files and removed. Tables `sfm_runtime` and `sfm`,
// and `breakdown`: first and later iterations of the same runs.
PaperBenchReport BenchSfm(const SfmBenchOptions& options);
PaperBenchReport BenchBreakdown(const SfmBenchOptions& options);

}  // namespace holba
