// SPDX-License-Identifier: BSD-3-Clause
// The normal equations of a problem, reduced to the kept unknowns, and the way back: everything of
// an iteration that goes over all residuals. elimination.h says what is computed.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "holba/base/threads.h"
#include "holba/linear/block_matrix.h"
#include "holba/linear/conjugate_gradients.h"
#include "holba/problem/problem.h"
#include "holba/solver/native/elimination.h"
#include "holba/solver/native/fingerprint.h"
#include "holba/solver/native/structure.h"

namespace holba::native {

// What the reduced system is kept as.
enum class SchurForm {
  kExplicit,  // all its blocks
  // U and T (single precision): products with S cost two passes over T. Of S itself the diagonal
  // blocks, for a preconditioner ...
  kImplicit,
  // ... and those of border nodes.
  kImplicitWithBorder,
};

// Cost of all residuals at one state, by batch.
struct StateCost {
  double total = 0.0;
  std::vector<TermCost> batches;
  // Of residuals that were never present before, not in the above: what they add cannot be compared
  // with the cost before.
  std::vector<TermCost> appeared;

  void CountAppeared();
};

struct Linearisation {
  double max_gradient = 0.0;
  double evaluation_share = 0.0;  // of the time: residuals and Jacobians; the rest is elimination
  StateCost cost;
};

struct Trial {
  StateCost cost;
  double model_change = 0.0;                 // of the cost, by the linear model; negative
  double step_norm = 0.0, state_norm = 0.0;  // of all variable blocks' values
};

class NormalEquations {
 public:
  NormalEquations();
  ~NormalEquations();

  // Analyses `problem`, which must outlive this or the next call and keep its structure. True: it
  // has the structure of the last one (fingerprint.h), and everything stands as it did.
  bool Begin(const Problem& problem, int num_threads);
  // Pattern of the whole reduced system, before a form is chosen.
  const BlockPattern& FindPattern();
  void SetForm(SchurForm form);

  // Linearises at problem.state() and eliminates the features, damped by 1 / radius; an infinite
  // radius: not at all.
  void Linearise(double radius, Linearisation* out);
  // S, damped (explicit), or its diagonal (and border) blocks (implicit): blocks of its pattern
  // that the form leaves out are U's.
  const BlockMatrix& matrix() const { return S_; }
  const BlockPattern& pattern() const { return pattern_; }
  // Differs between any two patterns of these equations that differ.
  uint64_t pattern_version() const { return pattern_version_; }
  const BlockMatrix& U() const { return U_; }  // U + D (implicit)
  // The right hand side of S k = b.
  std::span<const double> rhs() const { return rhs_; }
  // y = (U + D - S) x (implicit).
  void MultiplyEliminated(const double* x, double* y);

  // The features' step for the kept unknowns' step, and the cost where both lead, in trial_state().
  void Step(std::span<const double> kept_step, Trial* out);
  const std::vector<double>& trial_state() const { return trial_state_; }
  // The trial state becomes the problem's; remembers what residuals were that are absent there.
  void Accept(Problem* problem);

  // After Linearise with an infinite radius (explicit form), Z the blocks of S^-1: covariances of
  // the features in the structure's order, F x F entries of feature i from (*begin)[i] on.
  // Linearise must be called again before anything else.
  void FeatureCovariances(const BlockMatrix& Z, std::vector<size_t>* begin,
                          std::vector<double>* covariances);

  const Structure& structure() const { return structure_; }

 private:
  bool IsImplicit() const { return form_ != SchurForm::kExplicit; }

  struct Scratch;
  struct SliceData;
  struct Evaluated;

  void MakePattern(SchurForm form);
  void MakeSlices();
  void MakeOffsets(SliceData* slice);
  void AddFixedCosts();
  ChunkFeatures FeaturesOf(const Chunk& chunk, const SliceData& slice, Scratch* scratch);
  Sums SumsOf(SliceData* slice) const;
  void Evaluate(const ChunkPart& chunk_part, const double* state, bool jacobians, Scratch* scratch,
                Evaluated* out) const;
  void MakePanel(const ChunkPart& chunk_part, const Evaluated& evaluated, Panel* panel) const;
  void AddRemembered(const ChunkPart& chunk_part, const Evaluated& evaluated, TermCost* cost) const;
  void CompareWithTrial(const ChunkPart& chunk_part, const Evaluated& now, const Evaluated& trial,
                        SliceData* slice) const;
  // `visit`, unless null: called for each chunk of features once its T stand in the scratch; then
  // nothing is subtracted from S.
  void LineariseSlice(
      SliceData* slice, double inverse_radius, Scratch* scratch,
      const FunctionRef<void(const Chunk&, const ChunkFeatures&, const Sums&)>* visit);
  void StepSlice(SliceData* slice, Scratch* scratch);
  void MergeBlocks();
  template <typename Body>
  void ForEachSlice(const Body& body);
  void CollectCost(bool trial, StateCost* out) const;
  size_t offset_of(BlockId id) const { return problem_->values(id) - problem_->state().data(); }

  const Problem* problem_ = nullptr;
  Fingerprint fingerprint_{};
  int num_threads_ = 1;
  SchurForm form_ = SchurForm::kExplicit;
  bool pattern_found_ = false;  // pattern_ is the explicit form's
  bool formed_ = false;         // all memory is laid out for form_
  uint64_t pattern_version_ = 0;
  Structure structure_;
  BlockPattern pattern_;
  BlockMatrix S_, U_;
  std::vector<uint32_t> unknown_offset_;
  std::vector<size_t> row_offset_;
  std::vector<std::unique_ptr<SliceData>> slices_;
  size_t num_slices_ = 0;
  std::vector<std::unique_ptr<Scratch>> scratches_;
  std::vector<std::vector<uint32_t>> cross_;  // by part: offsets of pairs of segments
  std::vector<double> factors_;
  std::vector<float> stored_;
  std::vector<size_t> stored_begin_;  // by chunk
  std::vector<double> gradient_, diagonal_, reduction_, damping_, rhs_, padded_step_, padded_sum_;
  std::vector<double> trial_state_;
  std::vector<TermCost> fixed_costs_;  // of batches' residuals that nothing moves
  // Values of residuals when they were last present, by batch; empty until needed.
  struct Memory {
    std::vector<double> values;
    std::vector<uint8_t> known;
  };
  std::vector<Memory> memory_;
};

}  // namespace holba::native
