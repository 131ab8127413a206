// SPDX-License-Identifier: BSD-3-Clause
// A nonlinear least-squares problem: cost = 1/2 sum weight * rho(|r|^2) over batches of residuals,
// which are functions of parameter blocks. The solvers eliminate the features by the Schur
// complement and keep the other blocks, so a residual may hold one feature at most. The problem is
// all that a solver sees of a scene.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "holba/geometry/manifold.h"
#include "holba/problem/residual_batch.h"

namespace holba {

// What a block is to the solvers. A feature is eliminated; every other block is kept in the reduced
// system, whose layout tells poses, intrinsics and the rest apart.
enum class BlockRole : uint8_t {
  kFeature,     // a point, a line: few residuals, independent of all other features
  kPose,        // of a frame; poses come first in the reduced system
  kIntrinsics,  // of a camera; shares the place of its pose where each pose has its own
  kGroup,       // any other kept block: a group, or a line or point that is not eliminated
  kSensorPose,  // of a sensor in its rig: all frames of the rig share it
};
constexpr bool IsKept(BlockRole role) { return role != BlockRole::kFeature; }

struct ParameterBlock {
  std::string_view kind;  // "pose", "point", ...: for messages only
  const ManifoldOps* manifold = nullptr;
  BlockRole role = BlockRole::kGroup;
  bool constant = false;
  uint32_t held = 0;  // bit i: tangent coordinate i is held at its value

  uint32_t FreeMask() const;  // bit i: tangent coordinate i is variable
  int FreeTangent() const;    // number of variable tangent coordinates
  bool IsVariable() const { return FreeMask() != 0; }
};

class Problem {
 public:
  // `kind` must outlive the problem: a string literal, or the name of a group type.
  BlockId AddBlock(std::string_view kind, const ManifoldOps& manifold, BlockRole role,
                   std::span<const double> values);
  // Refuses a batch with a residual of two features, or with slots that do not fit their blocks: a
  // CheckError that names the term and the blocks.
  void AddBatch(std::unique_ptr<ResidualBatch> batch);

  // Reserves memory for this many blocks and values.
  void Reserve(size_t num_blocks, size_t num_values);

  size_t num_blocks() const { return blocks_.size(); }
  ParameterBlock& block(BlockId id) { return blocks_[id]; }
  const ParameterBlock& block(BlockId id) const { return blocks_[id]; }
  const std::vector<std::unique_ptr<ResidualBatch>>& batches() const { return batches_; }

  double* values(BlockId id) { return state_.data() + offsets_[id]; }
  const double* values(BlockId id) const { return state_.data() + offsets_[id]; }
  std::vector<double>& state() { return state_; }
  const std::vector<double>& state() const { return state_; }
  ParameterReader Reader() const { return {state_.data(), offsets_.data()}; }

  size_t num_residuals() const;  // over all batches; one observation is one residual

 private:
  std::vector<ParameterBlock> blocks_;
  std::vector<size_t> offsets_;
  std::vector<double> state_;
  std::vector<std::unique_ptr<ResidualBatch>> batches_;
};

// Cost of one term, which may have several batches, at one state.
struct TermCost {
  std::string term;
  bool angular = false;
  size_t residuals = 0;      // including the absent ones
  size_t absent = 0;         // undefined at this state; they add nothing to the sums
  double sum_squares = 0.0;  // of the residual norms, before weight and loss
  double cost = 0.0;         // half of the weighted, robustified sum
};

// Costs of all terms at the problem's state, in the order in which the terms were added. Sums are
// taken in a fixed order.
std::vector<TermCost> EvaluateTerms(const Problem& problem);

// Norms of the present residuals of a term; with `components` the absolute values of their single
// components instead.
std::vector<double> ResidualNorms(const Problem& problem, std::string_view term, bool components);

// Number of variable tangent coordinates of all kept blocks.
size_t NumKeptUnknowns(const Problem& problem);

// The reduced system: the system of the kept unknowns after the features are eliminated.
struct ReducedSystem {
  size_t size = 0;       // scalar unknowns
  double density = 0.0;  // share of its entries that are structurally non-zero
  // Share of the pairs of poses that are coupled (paper, "Schur density"), with and without the
  // terms of the wireframe.
  double pose_density = 0.0;
  double pose_density_without_wireframe = 0.0;
};
ReducedSystem AnalyseReducedSystem(const Problem& problem);

}  // namespace holba
