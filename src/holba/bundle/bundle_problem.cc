// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/bundle_problem.h"

#include "holba/bundle/problem_builder.h"

namespace holba {

void ProblemBuilder::Build(std::span<const GroupMeasurement> measurements) {
  AddPosesAndCameras();
  AddPriors();
  AddPoints();
  if (options_.config >= BundleConfig::kPointLine) AddLines();
  if (options_.config >= BundleConfig::kGroups) {
    AddGroups();
    AddGroupTerms();
    AddRelations();
    AddMeasurements(measurements);
  }
  if (options_.config >= BundleConfig::kHolistic) AddWireframe();
  for (auto& [key, batch] : batches_) problem_.AddBatch(std::move(batch));
}

BundleProblem BuildProblem(const Reconstruction& model, const BundleOptions& options,
                           const BundleSelection& selection,
                           std::span<const GroupMeasurement> measurements,
                           const AssociationFilter* filter) {
  BundleProblem bundle;
  const AssociationFilter none;
  ProblemBuilder(model, options, selection, filter ? *filter : none, &bundle).Build(measurements);
  return bundle;
}

BundleProblem BuildProblem(const Reconstruction& model, const BundleOptions& options,
                           std::span<const GroupMeasurement> measurements,
                           const AssociationFilter* filter) {
  return BuildProblem(model, options, BundleSelection::Everything(model, options), measurements,
                      filter);
}

}  // namespace holba
