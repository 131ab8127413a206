// SPDX-License-Identifier: BSD-3-Clause
// Which members of groups and which point-line incidences agree with the features as they are seen.
// Each association is a hypothesis: it is tested against the covariance of the feature estimated
// without it, never against the residual that it has helped to make small.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "holba/scene/types.h"

namespace holba {

class Reconstruction;
struct BundleProblem;
struct BundleSelection;

// Associations that take no part in an adjustment, and how much those of some groups count.
struct AssociationFilter {
  std::set<std::pair<group3D_t, point3D_t>> points;
  std::set<std::pair<group3D_t, line3D_t>> lines;
  std::set<std::pair<point3D_t, line3D_t>> edges;
  std::set<group3D_t> groups;  // with all their members and relations
  // Members of a group count 2^-halvings: they scatter more than their noise explains (walls are
  // not flat to a tenth of a pixel) or, below 0, are more parallel than their weight says. Missing:
  // 0.
  std::map<group3D_t, int> halvings;
};

struct AssociationCount {
  size_t tested = 0;
  size_t rejected = 0;
};

struct AssociationReport {
  AssociationFilter filter;
  // By "PLANE points", "VP lines", "wireframe edges", ...
  std::map<std::string, AssociationCount> counts;
  size_t groups_dropped = 0;
  // Parameters (plain values of the file) of the groups that were kept, estimated robustly from
  // their members.
  std::map<group3D_t, std::vector<double>> group_params;
};

// Tests every association of the selection. `features` is a problem of points and lines alone
// (configuration point_line, the current cameras), solved: it holds the features' values, and their
// covariances follow from its Jacobians with the cameras held and the noise measured from its
// residuals. Groups are re-estimated by RANSAC on distances in standard deviations (the model's own
// parameters being one hypothesis). Repeatable.
// `cameras_know_structure`: whether the cameras were adjusted to the groups already. What members
// side by side have in common is counted only then (coherent_scatter.h): before, cameras that are a
// little off bend the features of their part of the scene together, which is what groups are to
// mend. `confidence`: share of the right associations that passes.
AssociationReport TestAssociations(const Reconstruction& model, const BundleSelection& selection,
                                   const BundleProblem& features, bool cameras_know_structure,
                                   double confidence = 0.99);

// Variance of a normal distribution, in units of the one assumed (at least 1), of which the values
// that pass a test at `confidence` have this mean square. What lies beyond the test, right or
// wrong, does not enter.
double VarianceOfPassed(double mean_square, double confidence);

// Quantile of the chi-square distribution with 1 to 4 degrees of freedom.
double ChiSquareQuantile(double probability, int degrees_of_freedom);

}  // namespace holba
