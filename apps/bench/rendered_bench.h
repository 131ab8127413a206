// SPDX-License-Identifier: BSD-3-Clause
// The paper's tables on rendered places, whose truth is exact.
//   geometry    Tables 2 and 3: points and lines with the cameras held where they truly are,
//   without
//               groups and wireframe, with groups, with both
//   poses       Table 4: cameras of the mapper with points, points and lines, everything
//   ablation    Table 5: groups and wireframe in pixels against distances in space
//   primitives  the teaser: what is found of labelled objects
#pragma once

#include "apps/bench/paper_bench.h"

namespace holba {

PaperBenchReport BenchGeometry(const PaperBenchOptions& options);
PaperBenchReport BenchPoses(const PaperBenchOptions& options);
PaperBenchReport BenchAblation(const PaperBenchOptions& options);
PaperBenchReport BenchPrimitives(const PaperBenchOptions& options);

}  // namespace holba
