// SPDX-License-Identifier: BSD-3-Clause
// Whether points that an adjustment has not seen are predicted better by cameras whose intrinsics
// were freer.
#pragma once

#include <optional>

#include "holba/bundle/bundle_options.h"
#include "holba/bundle/held_out.h"
#include "holba/bundle/losses.h"
#include "holba/scene/reconstruction.h"
#include "holba/solver/solver.h"

namespace holba {

// By so many standard errors freer intrinsics have to predict better to be taken: several are
// tried, and a lens that is simpler than it might be costs little where points say little of it.
inline constexpr double kMinGainErrors = 3.0;

// A model of points, adjusted with these options.
struct AdjustedPoints {
  const BundleOptions& options;
  const Reconstruction& model;
};

// Options to adjust the points of a model alone, from near the optimum or far from it. Empty: their
// noise is not measured, so that they cannot judge.
std::optional<BundleOptions> PointsAlone(const BundleOptions& options);

// Mean cost of the tracks left out with the cameras of `free`, less that with those of `held`, in
// the same tracks (held_out.h); both adjusted on what stays in, each from where it is. Both models
// have the same points. `sigmas`: the noise of the points. No tracks: all zero.
PairedMean ComparePredictions(const AdjustedPoints& free, const AdjustedPoints& held,
                              const NoiseSigmas& sigmas, const SolverOptions& solver_options);

// The same where intrinsics are carried from images to others: half of the images, on one side of
// the plane across their widest spread, adjust their points with the intrinsics; the other half
// holds these, adjusts poses and points, and predicts tracks left out; both ways. What bends with
// the motion of a few images and not with the lens (a walk straight ahead leaves focal length and
// distortion nearly open, so that any common error of the points bends them) helps the images that
// it was taken from, and no others. No tracks: all zero.
PairedMean CompareCarried(const AdjustedPoints& free, const AdjustedPoints& held,
                          const NoiseSigmas& sigmas, const SolverOptions& solver_options);

}  // namespace holba
