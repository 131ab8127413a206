// SPDX-License-Identifier: BSD-3-Clause
// Preconditioners of the reduced camera system S, for conjugate gradients. All are symmetric
// positive definite, whatever they are made from: what is not is repaired, and a count says so.
// Results are the same bit for bit for every number of threads.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "holba/linear/block_matrix.h"
#include "holba/linear/conjugate_gradients.h"
#include "holba/linear/reduced_solver.h"

namespace holba {

// M = the diagonal blocks of S. Allocates when made only.
class BlockJacobiPreconditioner : public Preconditioner {
 public:
  // `pattern` must outlive it; matrices given to Set have the same widths.
  explicit BlockJacobiPreconditioner(const BlockPattern& pattern, int num_threads = 1);

  // Inverts the diagonal blocks; reads nothing else. One that is not positive definite is, scaled
  // to a unit diagonal, raised by multiples of 1 until it is; a diagonal entry that is 0 or not
  // finite becomes 1, on its own, a negative one changes its sign.
  void Set(const BlockMatrix& S);
  void Apply(const double* r, double* z) override;

  // For nodes [begin, end) only, on the calling thread.
  void Apply(int begin, int end, const double* r, double* z) const;
  // Column by column, symmetric: widths[node] columns of widths[node].
  const double* Inverse(int node) const { return inverses_.data() + inverse_begin_[node]; }
  int num_repaired() const;  // blocks of the last Set
  size_t MemoryBytes() const { return sizeof(double) * inverses_.size(); }

 private:
  const BlockPattern* pattern_;
  int num_threads_;
  std::vector<size_t> inverse_begin_;
  std::vector<double> inverses_;
  std::vector<char> repaired_;  // of each node
};

struct BorderOptions {
  // Unknowns of the core at most. The border nodes that most nodes are coupled with come first, the
  // others are leaves as the poses are: of them the diagonal blocks count, and what couples them
  // with the core.
  int max_core_unknowns = 2000;
  // Multiplications and additions that make the Schur complement (without its factorisation) at
  // most, in the same order: half a second or so.
  double max_schur_flops = 5e9;
};

// The arrow matrix [D E; E^T C], solved exactly: C holds the core, whole: nodes that many others
// are coupled with (shared intrinsics, groups); D the diagonal blocks of the leaves (poses); E what
// couples leaves with the core. Blocks of S between two leaves are left out and need not be there.
// The Schur complement C - E^T D^-1 E is factorised, dense or sparse (as its leaves make it).
//
// It is positive definite where S is an arrow (such as U, the part of S before elimination), but
// need not be where blocks between leaves were left out. Then E is scaled down until it is; if not
// even C is, M is block Jacobi. Allocates when made only, but for what reduced_solver.h names.
class BorderPreconditioner : public Preconditioner {
 public:
  // Nodes from first_border_node on are the border. `pattern` must outlive it; matrices given to
  // Set have this pattern.
  BorderPreconditioner(const BlockPattern& pattern, int first_border_node,
                       const BorderOptions& options = {}, int num_threads = 1);
  BorderPreconditioner(const BorderPreconditioner&) = delete;  // holds pointers into itself
  BorderPreconditioner& operator=(const BorderPreconditioner&) = delete;

  void Set(const BlockMatrix& S);
  void Apply(const double* r, double* z) override;

  int num_core_nodes() const { return static_cast<int>(core_.size()); }
  size_t num_core_unknowns() const { return core_pattern_.num_unknowns; }
  // Of the last Set: what E was multiplied by. 1: nothing was repaired; 0: the core is on its own.
  double coupling() const { return coupling_; }
  bool is_block_jacobi() const { return !core_solved_; }  // no core, or not even C is definite
  double SetFlops() const { return set_flops_; }          // multiplications and additions, about
  size_t MemoryBytes() const;

 private:
  // A block of E: a leaf coupled with a core node. Of a core node they are consecutive, leaves
  // ascending.
  struct Arm {
    int core = 0, leaf = 0;
    size_t block = 0;         // in S
    bool transposed = false;  // S has it as (leaf, core)
    size_t begin = 0;  // of (its block of E^T) D^-1 in arm_values_: columns as in BlockMatrix
  };
  // Consecutive arms of a core node, with a sum of their own, so that one core node coupled with
  // all leaves is work for several threads.
  struct Chunk {
    int core = 0;
    size_t begin = 0, end = 0;  // arms
  };

  // A leaf of one task's rows, and where in leaf_arms_ its arms to those rows are.
  struct LeafOfRows {
    int leaf = 0;
    size_t begin = 0, end = 0;
  };
  // Rows of the Schur complement that one task computes: what they read of a leaf they read once.
  struct Rows {
    int begin = 0, end = 0;                   // core nodes
    size_t leaves_begin = 0, leaves_end = 0;  // in leaves_of_rows_
  };

  void ChooseCore(int first_border_node, const BorderOptions& options);
  void FindArms();
  void BuildSchurPattern();
  void GroupRows();
  void MultiplyArms(const BlockMatrix& S, const Chunk& chunk);
  void ComputeSchurRows(const BlockMatrix& S, size_t task);
  bool FactoriseSchur(const BlockMatrix& S);

  const BlockPattern* pattern_;
  int num_threads_;
  BlockJacobiPreconditioner diagonal_;  // of all nodes
  std::vector<int> core_;               // nodes, ascending
  std::vector<int> core_of_node_;       // -1: a leaf
  std::vector<Arm> arms_;
  std::vector<size_t> core_arms_;  // begin in arms_ of each core node, one more than those
  std::vector<size_t> leaf_arms_begin_, leaf_arms_;  // of each node: its arms, core ascending
  std::vector<Chunk> chunks_;
  std::vector<Rows> rows_;
  std::vector<LeafOfRows> leaves_of_rows_;
  std::vector<size_t> core_block_;  // of each block of the Schur complement: its block in S
  AlignedDoubles arm_values_;
  BlockPattern core_pattern_;
  BlockMatrix schur_;
  std::unique_ptr<ReducedSolver> solver_;  // null without a core
  double set_flops_ = 0.0;

  double coupling_ = 0.0;
  bool core_solved_ = false;
  std::vector<double> chunk_sums_;
  std::vector<double> core_r_, core_z_;
};

// M^-1 = sum_{i=0}^{order} (U^-1 E)^i U^-1, where S = U - E: the start of the power series of S^-1
// (Weber, Demmel, Chan and Cremers 2023, "Power bundle adjustment"). It converges if U and S are
// positive definite; M is positive definite if E is positive semidefinite, too, as in bundle
// adjustment, where U is S before elimination, damping included, and E = W V^-1 W^T. Each term
// costs a product with E.
class PowerSeriesPreconditioner : public Preconditioner {
 public:
  // Both must outlive it. U^-1 is exact where U is an arrow and the preconditioner a border one.
  PowerSeriesPreconditioner(Preconditioner* u_inverse, LinearOperator* e, size_t num_unknowns,
                            int order);
  void Apply(const double* r, double* z) override;

 private:
  Preconditioner* u_inverse_;
  LinearOperator* e_;
  int order_;
  std::vector<double> term_, product_;
};

}  // namespace holba
