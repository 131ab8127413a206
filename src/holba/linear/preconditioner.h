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
  // Largest number of unknowns of the core. The border nodes that are coupled with most nodes enter
  // it first. The remaining ones are leaves, like the poses: the preconditioner uses their diagonal
  // blocks and their couplings with the core.
  int max_core_unknowns = 2000;
  // Largest number of multiplications and additions for forming the Schur complement, without its
  // factorisation: about half a second.
  double max_schur_flops = 5e9;
};

// Exact solution of the arrow matrix M = [D E; E^T C]. C has all blocks of the core, the nodes that
// many others are coupled with (shared intrinsics, groups); D has the diagonal blocks of the leaves
// (poses); E has the couplings of leaves with the core. Blocks of S between two leaves are ignored
// and may be missing. The Schur complement C - E^T D^-1 E is factorised, as a dense or a sparse
// matrix, whichever costs less.
//
// The complement is positive definite where S itself is an arrow, like U. Where blocks between
// leaves are ignored it may be indefinite; then E is scaled down until the complement is positive
// definite, and if not even C is, M is block Jacobi. Set and Apply allocate no memory but what
// reduced_solver.h names.
class BorderPreconditioner : public Preconditioner {
 public:
  // Nodes from first_border_node on are the border. `pattern` must outlive this object; matrices
  // given to Set have this pattern.
  BorderPreconditioner(const BlockPattern& pattern, int first_border_node,
                       const BorderOptions& options = {}, int num_threads = 1);
  BorderPreconditioner(const BorderPreconditioner&) = delete;  // holds pointers into itself
  BorderPreconditioner& operator=(const BorderPreconditioner&) = delete;

  void Set(const BlockMatrix& S);
  void Apply(const double* r, double* z) override;

  int num_core_nodes() const { return static_cast<int>(core_.size()); }
  size_t num_core_unknowns() const { return core_pattern_.num_unknowns; }
  // The factor of E after the last Set. 1: nothing was repaired; 0: core and leaves are uncoupled.
  double coupling() const { return coupling_; }
  bool is_block_jacobi() const { return !core_solved_; }  // no core, or not even C is definite
  double SetFlops() const { return set_flops_; }  // multiplications and additions, approximately
  size_t MemoryBytes() const;

 private:
  // A block of E, the coupling of a leaf with a core node. The arms of a core node are consecutive,
  // with their leaves ascending.
  struct Arm {
    int core = 0, leaf = 0;
    size_t block = 0;         // in S
    bool transposed = false;  // the block in S is (leaf, core)
    size_t begin = 0;         // in arm_values_: its block of E^T D^-1, columns as in BlockMatrix
  };
  // Consecutive arms of a core node, with a sum of their own, so that several threads share a core
  // node that is coupled with all leaves.
  struct Chunk {
    int core = 0;
    size_t begin = 0, end = 0;  // arms
  };

  // A leaf that is coupled with the rows of one task, and the range of leaf_arms_ with those
  // couplings.
  struct LeafOfRows {
    int leaf = 0;
    size_t begin = 0, end = 0;
  };
  // Rows of the Schur complement that one task computes, so that it reads each leaf once.
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
  void ReduceToCore(const double* r);
  void SubstituteToLeaves(const double* r, double* z) const;

  const BlockPattern* pattern_;
  int num_threads_;
  BlockJacobiPreconditioner diagonal_;  // of all nodes
  std::vector<int> core_;               // nodes, ascending
  std::vector<int> core_of_node_;       // -1: a leaf
  std::vector<Arm> arms_;
  std::vector<size_t> core_arms_;  // first arm of each core node; one entry more than core nodes
  std::vector<size_t> leaf_arms_begin_, leaf_arms_;  // arms of each node, by ascending core node
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

// M^-1 = sum_{i=0}^{order} (U^-1 E)^i U^-1 with S = U - E, the first terms of the power series of
// S^-1 (Weber, Demmel, Chan and Cremers 2023, "Power bundle adjustment"). The series converges if U
// and S are positive definite. M is positive definite if E is also positive semidefinite. Both hold
// in bundle adjustment, where U is the damped U of the normal equations and E = W V^-1 W^T. Each
// term costs a product with E.
class PowerSeriesPreconditioner : public Preconditioner {
 public:
  // Both must outlive this object. A BorderPreconditioner is an exact u_inverse if U is an arrow.
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
