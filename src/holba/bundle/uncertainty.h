// SPDX-License-Identifier: BSD-3-Clause
// Covariances of poses, points, lines and groups of an adjusted model.
#pragma once

#include <optional>
#include <span>

#include "holba/bundle/adjust_bundle.h"
#include "holba/scene/uncertainty.h"

namespace holba {

// (J^T J)^-1 of the adjustment that `options` and `summary` describe (its losses at their measured
// scales, without the associations that were left out), times the variance of one observed
// coordinate of a point, measured robustly. Where the weights of what moves the cameras were chosen
// (weight_choice.h), poses and what moved them are as sure as these weights make them, and all else
// is as sure as it is given the cameras. Elements that nothing determines have no entry. Empty: the
// system is singular.
std::optional<ModelUncertainty> EstimateUncertainty(
    const Reconstruction& model, const BundleOptions& options, const BundleSummary& summary,
    int num_threads, std::span<const GroupMeasurement> measurements = {});

}  // namespace holba
