// SPDX-License-Identifier: BSD-3-Clause
// Relative-pose accuracy of a model against a true one, and the area under its recall curve (AUC).
//
// Every unordered pair of true images counts. With R_ij = R_j R_i^T and t_ij = t_j - R_ij t_i,
//   rotation error     angle of R_ij(model) R_ij(truth)^T,
//   translation error  angle between t_ij(model) and t_ij(truth) in [0, 180] degrees (a
//                      reconstruction knows the sign, so it is not folded unless asked for); where
//                      the true baseline is at most min_baseline times the median one the direction
//                      means nothing and the error is 0,
//   pair error         the larger of the two; infinite if the model lacks one of the images.
// All are free of the gauge of either model. Source of the trapezoid convention: the pose AUC of
// SuperGlue (Sarlin et al., CVPR 2020), used by hloc and COLMAP's benchmarks too.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "holba/evaluation/image_pairing.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PoseErrorOptions {
  double min_baseline = 1e-3;     // as a part of the median true baseline
  bool fold_translation = false;  // take min(e, 180 - e), as benchmarks of essential matrices do
};

struct PoseErrors {
  size_t images = 0;            // of the truth
  size_t registered = 0;        // of those, how many the model has
  size_t registered_pairs = 0;  // finite pair errors
  // One for each pair of true images, in order of their names; infinite for lost pairs. Degrees.
  std::vector<double> rotation_deg, translation_deg, pair_deg;
  ImagePairing pairing;
};

// Images are paired by name: first whole, then by the end of the path (scene/name_pairing.h).
PoseErrors ComparePoses(const Reconstruction& model, const Reconstruction& truth,
                        const PoseErrorOptions& options = {});

enum class AucConvention {
  kStep,       // exact area under the step curve: the mean of max(0, 1 - error / threshold)
  kTrapezoid,  // the steps joined by straight lines, as SuperGlue, hloc and COLMAP's benchmarks do
};

// Area under the recall curve on [0, threshold_deg], divided by threshold_deg: in [0, 1]. 0 without
// errors. threshold_deg > 0.
double PoseAuc(std::span<const double> errors_deg, double threshold_deg,
               AucConvention convention = AucConvention::kStep);

}  // namespace holba
