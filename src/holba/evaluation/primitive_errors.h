// SPDX-License-Identifier: BSD-3-Clause
// The groups of a model against those of a true model whose ids mean nothing to it: who is who is
// found by where they are.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PrimitiveOptions {
  // A surface that is farther from the members of the other, in the median, than this part of their
  // spread is another one's.
  double max_distance = 0.1;
  // Directions (vanishing points), and normals and axes, that differ by more are others'. A
  // detector of vanishing points takes lines within 5 degrees, so that two it holds apart are at
  // least 10 apart.
  double max_angle_deg = 10.0;

  void Describe(OptionTable* table) const;
};

struct PrimitivePair {
  group3D_t model_id = kNoId, truth_id = kNoId;
  const GroupType* type = nullptr;
  size_t num_members = 0;  // of the model's
  // The larger of two medians: of the true members from the model's surface, and the other way
  // round; of directions the angle in degrees.
  double distance = 0.0;
  std::vector<std::pair<std::string, double>> errors;  // group_comparison.h
  std::optional<double> radius_percent;                // of the true radius, of types with one
};

struct PrimitiveErrors {
  std::vector<PrimitivePair> pairs;  // by the id of the true group
  std::vector<group3D_t> missed;     // true groups without a pair
  std::vector<group3D_t> extra;      // groups of the model without one
};

// One to one, of equal types, nearest pairs first. `truth_from_model`: identity where both are in
// one frame. Surfaces of which neither has members cannot be told apart, and have no pair.
PrimitiveErrors MeasurePrimitives(const Reconstruction& model, const Reconstruction& truth,
                                  const Sim3d& truth_from_model, const PrimitiveOptions& options);

}  // namespace holba
