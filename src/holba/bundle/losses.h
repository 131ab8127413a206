// SPDX-License-Identifier: BSD-3-Clause
// Losses of the terms: as the options name them, and the scales that are measured.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "holba/bundle/bundle_options.h"
#include "holba/problem/problem.h"

namespace holba {

// kAuto is Cauchy at the settings' scale until that is measured.
Loss ToLoss(const TermSettings& settings);

// Standard deviation of the residuals of a term in its unit, from the median (so that outliers do
// not count); of lines: of the distances of single end points. 0 without residuals.
double RobustSigma(const Problem& problem, const std::string& term);

// Factors on the weights of the terms that structure brings, by what they are observations of.
struct StructureWeights {
  double lines = 1.0;
  double corners = 1.0;  // points that were made from structure
  double groups = 1.0;   // members, relations and measurements of groups, incidences

  double Of(const std::string& term) const;
  bool operator==(const StructureWeights&) const = default;
};

// Robust standard deviation of the residuals of a term, by its name, in its unit.
using NoiseSigmas = std::map<std::string, double>;

// Terms whose loss scale is measured, and the weight of angular terms, which follows the noise in
// pixels: cost in px^2 is noise^2 times a chi-square, so a variance in an angle needs that factor
// to weigh what it says. Scales outlive a problem: the next one begins where the last one ended.
class AutoScales {
 public:
  // `known`: standard deviations that an earlier adjustment of these features measured; the scales
  // of their terms start at their goals instead of being annealed from far. The options must
  // outlive this.
  explicit AutoScales(const BundleOptions& options, const NoiseSigmas& known = {});

  // Sets the losses and weights of a new problem. True: some scale is new and has to be annealed.
  bool Begin(const Problem& problem);
  // Halves the scales towards their goals. True: they had arrived.
  bool Tighten(const Problem& problem);
  // From now on, and of the problem at hand.
  void Weigh(const StructureWeights& factors);
  // The problem at hand goes away, or waits for another Begin with its weights as given.
  void Leave();

  // Whether the loss of a term follows its noise.
  bool Measures(const std::string& term) const;
  const std::map<std::string, double>& scales() const { return scales_; }
  const std::map<std::string, double>& sigmas() const { return sigmas_; }
  std::string Text() const;
  // Variance of the noise of one coordinate, px^2, where it is measured; 1: the weights of angular
  // terms as they are.
  double AngularFactor() const;
  // Variance of the noise of points by that of points of structure, where both are measured: what
  // is placed worse weighs less.
  double StructurePointFactor() const;

 private:
  void Apply(const Problem& problem) const;
  double FactorOf(const ResidualBatch& batch) const;
  double Goal(const Problem& problem, const std::string& term);
  double GoalOf(const std::string& term, double sigma) const;

  const BundleOptions& options_;
  std::set<std::string> terms_;                             // of the problem at hand
  std::vector<std::pair<ResidualBatch*, double>> batches_;  // of it, with their weights as given
  StructureWeights factors_;
  std::map<std::string, double> scales_;
  std::map<std::string, double> sigmas_;
};

}  // namespace holba
