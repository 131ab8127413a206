// SPDX-License-Identifier: BSD-3-Clause
// The normal equations of a problem, reduced to the kept unknowns, and back-substitution: all
// passes of an iteration over the residuals. elimination.h has the equations.
#pragma once

#include <cstdint>
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
#include "holba/solver/solve_journal.h"

namespace holba::native {

// The form in which the reduced system is stored.
enum class SchurForm {
  // All blocks of S.
  kExplicit,
  // U, and T in single precision; a product with S is two passes over T. Of S only the diagonal
  // blocks, for a preconditioner.
  kImplicit,
  // The same, and the blocks of S in the rows of the border.
  kImplicitWithBorder,
};

// Cost of all residuals at one state, by batch.
struct StateCost {
  double total = 0.0;
  std::vector<TermCost> batches;
  // Cost of the residuals that are present for the first time. It is not part of the above, since
  // the cost before did not have it.
  std::vector<TermCost> appeared;

  void CountAppeared();  // adds it to the above
};

struct Linearisation {
  double max_gradient = 0.0;
  double evaluation_share = 0.0;  // share of the time spent in evaluating; the rest is elimination
  StateCost cost;
};

// Squared norms of a step and of the state before it.
struct StepSquares {
  double step = 0.0, state = 0.0;
};

struct Trial {
  StateCost cost;
  double model_change = 0.0;                 // change of the cost that the linear model predicts
  StepSquares squares;                       // over the values of all variable blocks
  double step_norm = 0.0, state_norm = 0.0;  // their roots

  void SetNorms();
};

// Damping of a kept unknown with this entry on the diagonal of U (Marquardt, with the floor of
// FactoriseFeatures).
double KeptDamping(double diagonal, double radius);

class NormalEquations {
 public:
  NormalEquations();
  ~NormalEquations();

  // Analyses `problem`, which must keep its structure and exist until the next call or the end of
  // this object. True: it has the structure of the last problem (fingerprint.h), whose analysis and
  // form are used again.
  bool Begin(const Problem& problem, int num_threads);
  // Pattern of the whole reduced system; needs no form.
  const BlockPattern& FindPattern();
  void SetForm(SchurForm form);

  // Linearises at problem.state() and eliminates the features. The damping is 1 / radius; an
  // infinite radius means none.
  void Linearise(double radius, Linearisation* out);
  // The same where others hold residuals of the same kept blocks: the features are damped and
  // eliminated, while S, the right hand side and max_gradient have no share of the kept unknowns'
  // damping and gradient yet. These follow from the sums over all holders of gradient(),
  // diagonal() and reduction().
  void LinearisePart(double radius, Linearisation* out);
  // Padded vectors (structure().node_padded_offset): g_k, the diagonal of U, and sum T y.
  std::span<const double> gradient() const { return gradient_; }
  std::span<const double> diagonal() const { return diagonal_; }
  std::span<const double> reduction() const { return reduction_; }
  // By block id: kept blocks that another holder counts in the norms of steps. Empty: none.
  void SetCountedElsewhere(std::vector<uint8_t> blocks) { counted_elsewhere_ = std::move(blocks); }
  // Damped S (explicit form), or its diagonal and border blocks (implicit forms), where the blocks
  // that the form leaves out are those of U.
  const BlockMatrix& matrix() const { return S_; }
  const BlockPattern& pattern() const { return pattern_; }
  // Changes whenever the pattern changes.
  uint64_t pattern_version() const { return pattern_version_; }
  const BlockMatrix& U() const { return U_; }  // U + D (implicit)
  // The right hand side of S k = b.
  std::span<const double> rhs() const { return rhs_; }
  // y = (U + D - S) x (implicit).
  void MultiplyEliminated(const double* x, double* y);

  // Computes the step of the features from that of the kept unknowns, the state after both,
  // trial_state(), and the cost there.
  void Step(std::span<const double> kept_step, Trial* out);
  const std::vector<double>& trial_state() const { return trial_state_; }
  // Makes the trial state the state of the problem. Residuals that are absent there keep their last
  // value.
  void Accept(Problem* problem);
  // The values of residuals when they were last present, by batch and residual; and back.
  std::vector<RememberedResidual> Remembered() const;
  void Remember(std::span<const RememberedResidual> remembered);

  // Covariances of the features in the order of the structure: F x F entries of feature i from
  // (*begin)[i] on. Z has the blocks of S^-1, where S is the explicit form without damping.
  // Linearise must be called again before the next Step.
  void FeatureCovariances(const BlockMatrix& Z, std::vector<size_t>* begin,
                          std::vector<double>* covariances);

  const Structure& structure() const { return structure_; }
  size_t num_slices() const { return num_slices_; }  // of the form

 private:
  bool IsImplicit() const { return form_ != SchurForm::kExplicit; }

  struct Scratch;
  struct SliceData;
  struct Evaluated;

  void MakePattern(SchurForm form);
  void PlaceSumBlocks();
  void ReserveBuffers();
  void MakeSlices();
  void MakeOffsets(SliceData* slice);
  void FindPairsOfCliques(SliceData* slice) const;
  void FindLoosePairs(SliceData* slice);
  void PlaceInFullSums(SliceData* slice);
  void PlaceInOwnSums(SliceData* slice);
  template <typename Visitor>
  void ForEachLooseChunk(const SliceData& slice, const Visitor& visit) const;

  void AddFixedCosts();
  ChunkFeatures FeaturesOf(const Chunk& chunk, const SliceData& slice, Scratch* scratch);
  Sums SumsOf(SliceData* slice) const;
  void Evaluate(const ChunkPart& chunk_part, const double* state, bool jacobians, Scratch* scratch,
                Evaluated* out) const;
  void MakePanel(const ChunkPart& chunk_part, const Evaluated& evaluated, Panel* panel) const;
  void AddRemembered(const ChunkPart& chunk_part, const Evaluated& evaluated, TermCost* cost) const;
  void CompareWithTrial(const ChunkPart& chunk_part, const Evaluated& now, const Evaluated& trial,
                        SliceData* slice) const;

  void ClearSums(SliceData* slice) const;
  void MakeRows(const ChunkPart& chunk_part, SliceData* slice, Scratch* scratch,
                Panel* panel) const;
  void LineariseSlice(SliceData* slice, double inverse_radius, Scratch* scratch);
  void LineariseFeatures(uint32_t chunk_idx, double inverse_radius, const Sums& sums,
                         SliceData* slice, Scratch* scratch);
  void LineariseLoose(const Chunk& chunk, const Sums& sums, SliceData* slice,
                      Scratch* scratch) const;
  void MergeBlocks();
  void MergeVectors(Linearisation* out);
  void AddDamping(double radius, Linearisation* out);
  void FindInverseBlocks(const ChunkFeatures& features, const BlockMatrix& Z,
                         std::vector<size_t>* z_offset, std::vector<size_t>* z_begin) const;
  void SetUnconstrainedToInfinity(const Chunk& chunk, const ChunkFeatures& features,
                                  double* covariances) const;

  StepSquares MoveKeptBlocks();
  void MoveBlock(const ManifoldOps& manifold, size_t at, const double* delta, StepSquares* squares);
  void StepSlice(SliceData* slice, Scratch* scratch);
  ChunkFeatures BeginStep(const Chunk& chunk, const SliceData& slice, Scratch* scratch);
  void ApplyKeptStep(const Chunk& chunk, const ChunkFeatures& features, Scratch* scratch) const;
  void FindStepBases(const Panel& panel, const ChunkFeatures& features, Scratch* scratch,
                     const int64_t** bases) const;
  void MoveFeatures(const Chunk& chunk, const ChunkFeatures& features, SliceData* slice,
                    Scratch* scratch);
  void EvaluateTrial(const Chunk& chunk, SliceData* slice, Scratch* scratch) const;

  template <typename Body>
  void ForEachSlice(const Body& body);
  void CollectCost(bool trial, StateCost* out) const;
  size_t offset_of(BlockId id) const { return problem_->values(id) - problem_->state().data(); }

  const Problem* problem_ = nullptr;
  Fingerprint fingerprint_{};
  int num_threads_ = 1;
  SchurForm form_ = SchurForm::kExplicit;
  bool pattern_found_ = false;  // pattern_ is the explicit form's
  bool formed_ = false;         // the memory is laid out for form_
  uint64_t pattern_version_ = 0;
  Structure structure_;
  BlockPattern pattern_;
  BlockMatrix S_, U_;
  std::vector<uint32_t> unknown_offset_;
  std::vector<size_t> row_offset_;
  std::vector<std::unique_ptr<SliceData>> slices_;
  size_t num_slices_ = 0;
  std::vector<std::unique_ptr<Scratch>> scratches_;
  std::vector<std::vector<uint32_t>> cross_;  // by part: offsets of the pairs of its segments
  std::vector<double> factors_;
  std::vector<float> stored_;
  std::vector<size_t> stored_begin_;  // by chunk
  std::vector<double> gradient_, diagonal_, reduction_, damping_, rhs_, padded_step_, padded_sum_;
  std::vector<double> trial_state_;
  std::vector<uint8_t> counted_elsewhere_;
  std::vector<TermCost> fixed_costs_;  // by batch: residuals of constant blocks only
  // By batch: the values of residuals when they were last present. Empty until needed.
  struct Memory {
    std::vector<double> values;
    std::vector<uint8_t> known;
  };
  std::vector<Memory> memory_;
};

}  // namespace holba::native
