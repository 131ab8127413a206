// SPDX-License-Identifier: BSD-3-Clause
// A floor plan as SVG: the scene from above along its vertical, planes that stand upright as broad
// traces of their members' extent, lines in the colours of their directions, cameras as arrowheads.
#pragma once

#include <filesystem>
#include <ostream>

#include "holba/scene/reconstruction.h"

namespace holba {

// The level direction of most lines runs to the right. One unit of the model has the length that
// the attribute data-px-per-unit of the root says, and a bar shows. Covers the 1st to the 99th
// percentile of the lines (of the points, where there are none) and the cameras. Creates the parent
// folders. Throws InputError if the file cannot be written.
void WriteFloorPlan(const Reconstruction& model, const std::filesystem::path& path);
void FormatFloorPlan(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
