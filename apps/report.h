// SPDX-License-Identifier: BSD-3-Clause
// Costs and summaries as JSON and as tables (DESIGN.md, "The program").
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "holba/bundle/adjust_bundle.h"

namespace holba {

// {"point": {"residuals": N, "sum_squares": S, "absent": n}, ...}; residuals counts the present
// ones.
nlohmann::json TermsToJson(std::span<const TermCost> terms);

// "12 images, 100 points, 3 lines and 1 group".
std::string ContentsText(const Reconstruction& model);

nlohmann::json SummaryToJson(const BundleSummary& summary);
std::string SummaryToText(const BundleSummary& summary);

// Warns of what in a model contradicts its observations (bundle/plausibility.h). `when`: "Before
// the adjustment".
void WarnOfDoubts(const std::string& when, const Reconstruction& model);
// Warns of what the adjustment left out or held because the observations are too few.
void WarnOfWhatWasHeld(const BundleSummary& summary);
// Throws InputError where no point is in front of a camera and there are no lines.
void RefuseWithoutResiduals(const std::string& path, const Reconstruction& model);
// Whether no residual was defined, neither before nor after.
bool NothingWasAdjusted(const BundleSummary& summary);

// One line per iteration: costs by term, step, damping, time. The header says the terms of the
// record.
std::string IterationHeader(const IterationRecord& record);
std::string IterationLine(const IterationRecord& record);

// A text file of directions of groups measured in images, one per line after '#' comments:
// IMAGE_ID GROUP3D_ID DX DY DZ SIGMA_DEG, the direction in the camera frame, its sign free.
std::vector<GroupMeasurement> ReadGroupMeasurements(const std::string& path,
                                                    const Reconstruction& model);

}  // namespace holba
