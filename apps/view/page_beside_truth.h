// SPDX-License-Identifier: BSD-3-Clause
// The page of a model with the truth it is judged by.
#pragma once

#include <filesystem>

#include "holba/scene/reconstruction.h"

namespace holba {

// Writes the page of the model over its truth, the truth moved to where the model is, and says
// where it is. Where the two have no image in common, the model alone.
void WritePageBesideTruth(const Reconstruction& model, Reconstruction truth,
                          const std::filesystem::path& path);

}  // namespace holba
