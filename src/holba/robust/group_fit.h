// SPDX-License-Identifier: BSD-3-Clause
// Parameters of one group of any type from its members, some of which may be wrong: RANSAC with
// local optimisation (Chum et al. 2003) on the type's FitMinimal. The caller says how far a member
// is from a group: pixels, standard deviations, units of the model.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "holba/geometry/line.h"
#include "holba/group/group_type.h"

namespace holba {

// Writes the residuals of all points, then of all lines, for in-memory parameters g. Infinite where
// a member has no projection. The vector has the right size when it is passed.
using GroupResiduals = std::function<void(const double* g, std::vector<double>* residuals)>;

struct GroupFit {
  std::array<double, kMaxGroupParams> g{};  // in memory
  std::vector<double> residuals;            // of the points, then of the lines
  size_t num_inliers = 0;                   // within the limit
  double gain = 0.0;                        // sum of 1 - (residual / limit)^2 over the inliers
  std::vector<double> FileParams(const GroupType& type) const;
};

struct GroupRansacOptions {
  double limit = 1.0;  // of an inlier's residual
  // Samples are drawn until a right one has been among them with this probability, if the share of
  // inliers is that of the best fit so far.
  double confidence = 0.999;
  int max_samples = 300;
  // The local optimisation goes down from the sampled parameters by least squares of distances,
  // instead of fitting anew by FitMinimal, whose error is an algebraic one for some types and which
  // may end in another minimum for types of many parameters. For points only.
  bool refine_distances = false;
  uint64_t seed = 0;
};

// Number of samples after which one has been right with this probability, where a sample is right
// with probability share^sample_size. Infinite for a share of 0.
double NumSamplesNeeded(double confidence, double share, size_t sample_size);

// How well given parameters fit num_members members.
GroupFit JudgeGroup(const GroupType& type, const double* g, size_t num_members,
                    const GroupResiduals& residuals, double limit);

// The parameters of the greatest gain. `start`: in-memory parameters that are considered too, or
// null. Empty: too few members for the type, or nothing fits.
std::optional<GroupFit> FitGroupRobustly(const GroupType& type,
                                         std::span<const Eigen::Vector3d> points,
                                         std::span<const PlueckerLine> lines,
                                         const GroupResiduals& residuals,
                                         const GroupRansacOptions& options,
                                         const double* start = nullptr);

}  // namespace holba
