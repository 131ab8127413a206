// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/losses.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "holba/robust/median.h"

namespace holba {
namespace {

// Scales that differ less than this are the same.
constexpr double kScaleTolerance = 0.02;
// Sine of 0.01 degrees: no direction is known better.
constexpr double kMinAngularScale = 1.7e-4;

}  // namespace

Loss ToLoss(const TermSettings& settings) {
  switch (settings.loss.value_or(LossChoice::kTrivial)) {
    case LossChoice::kTrivial:
      return {LossType::kTrivial, settings.loss_scale};
    case LossChoice::kHuber:
      return {LossType::kHuber, settings.loss_scale};
    case LossChoice::kSoftL1:
      return {LossType::kSoftL1, settings.loss_scale};
    case LossChoice::kCauchy:
    case LossChoice::kAuto:
      return {LossType::kCauchy, settings.loss_scale};
  }
  return {};
}

double RobustSigma(const Problem& problem, const std::string& term) {
  std::vector<double> values = ResidualNorms(problem, term, true);
  if (term == "line" || term == "group_line") {
    // Perpendicular vectors, two components each: their length is the distance.
    for (size_t i = 0; i + 1 < values.size(); i += 2)
      values[i / 2] = std::hypot(values[i], values[i + 1]);
    values.resize(values.size() / 2);
  }
  return kSigmaPerMedian * Median(std::move(values));
}

double StructureWeights::Of(const std::string& term) const {
  if (term == "point" || term == "principal_point_prior") return 1.0;
  if (term == "line") return lines;
  return term == "structure_point" ? corners : groups;
}

AutoScales::AutoScales(const BundleOptions& options, const NoiseSigmas& known)
    : options_(options), sigmas_(known) {
  for (const auto& [term, sigma] : sigmas_) scales_[term] = GoalOf(term, sigma);
}

bool AutoScales::Begin(const Problem& problem) {
  bool fresh = false;
  terms_.clear();
  batches_.clear();
  for (const auto& batch : problem.batches()) {
    const std::string& term = batch->term();
    batches_.emplace_back(batch.get(), batch->weight);
    if (options_[FamilyOf(term)].loss != LossChoice::kAuto || term.ends_with("_3d") ||
        terms_.contains(term))
      continue;
    terms_.insert(term);
    if (scales_.contains(term)) continue;
    fresh = true;
    scales_[term] = options_.auto_start_multiple * Goal(problem, term);
  }
  Apply(problem);
  return fresh;
}

bool AutoScales::Tighten(const Problem& problem) {
  bool arrived = true;
  for (const std::string& term : terms_) {
    double& scale = scales_[term];
    const double next = std::max(Goal(problem, term), 0.5 * scale);
    if (std::abs(next - scale) > kScaleTolerance * scale) arrived = false;
    scale = next;
  }
  Apply(problem);
  return arrived;
}

bool AutoScales::Measures(const std::string& term) const {
  return options_[FamilyOf(term)].loss == LossChoice::kAuto;
}

std::string AutoScales::Text() const {
  std::string text;
  for (const std::string& term : terms_) {
    text += fmt::format("{} {} {:.3f} px", text.empty() ? "" : ",", term, scales_.at(term));
  }
  return text;
}

void AutoScales::Apply(const Problem& problem) const {
  for (const auto& batch : problem.batches()) {
    if (terms_.contains(batch->term()))
      batch->loss = {LossType::kCauchy, scales_.at(batch->term())};
  }
  for (const auto& [batch, weight] : batches_) batch->weight = FactorOf(*batch) * weight;
}

void AutoScales::Leave() {
  for (const auto& [batch, weight] : batches_) batch->weight = weight;
  terms_.clear();
  batches_.clear();
}

double AutoScales::FactorOf(const ResidualBatch& batch) const {
  double factor = factors_.Of(batch.term());
  if (batch.angular) factor *= AngularFactor();
  if (batch.term() == "structure_point") factor *= StructurePointFactor();
  return factor;
}

void AutoScales::Weigh(const StructureWeights& factors) {
  factors_ = factors;
  for (const auto& [batch, weight] : batches_) batch->weight = FactorOf(*batch) * weight;
}

double AutoScales::AngularFactor() const {
  for (const char* term : {"point", "line"}) {
    const auto sigma = sigmas_.find(term);
    if (sigma == sigmas_.end()) continue;
    const double least = options_.auto_min_scale_px / options_.auto_num_sigmas;
    return std::pow(std::max(sigma->second, least), 2);
  }
  return 1.0;
}

double AutoScales::StructurePointFactor() const {
  const auto points = sigmas_.find("point"), of_structure = sigmas_.find("structure_point");
  if (points == sigmas_.end() || of_structure == sigmas_.end()) return 1.0;
  if (!(of_structure->second > points->second)) return 1.0;
  return std::pow(points->second / of_structure->second, 2);
}

double AutoScales::Goal(const Problem& problem, const std::string& term) {
  const double sigma = RobustSigma(problem, term);
  sigmas_[term] = sigma;
  return GoalOf(term, sigma);
}

double AutoScales::GoalOf(const std::string& term, double sigma) const {
  return std::max(options_.auto_num_sigmas * sigma,
                  IsAngular(FamilyOf(term)) ? kMinAngularScale : options_.auto_min_scale_px);
}

}  // namespace holba
