// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `density`: how many pairs of cameras the reduced system couples, without and with
// the wireframe (the paper's table "Schur complement density analysis").
#pragma once

#include <vector>

#include "apps/bench/paper_bench.h"
#include "holba/bundle/bundle_options.h"
#include "holba/scene/reconstruction.h"
#include "holba/synthetic/photo_set.h"

namespace holba {

// Images, points, lines, edges of the wireframe; percent of the pairs of frames that are coupled
// without and with the wireframe, and by how many percent of the former these are more (not a
// number where none is).
std::vector<double> DensityOf(const Reconstruction& model, const BundleOptions& bundle);

// Of the true features of sets of photographs, each with the tracks that matching gives.
PaperBenchReport BenchDensity(const PaperBenchOptions& options, const PhotoSetOptions& photos,
                              const BundleOptions& bundle);

}  // namespace holba
