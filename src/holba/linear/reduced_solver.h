// SPDX-License-Identifier: BSD-3-Clause
// Direct solvers of the reduced system S x = b, where S is symmetric positive definite. Results are
// the same bit for bit for every number of threads.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "holba/linear/block_matrix.h"

namespace holba {

enum class Precision {
  kDouble,
  // A factor in float (half the memory, up to twice the speed); Solve refines its solutions by
  // conjugate gradients on S in double. Where float breaks down, the factor is computed in double.
  kMixed,
};

// A solver belongs to one pattern. The constructor does the analysis and allocates all memory;
// Factorise and Solve allocate nothing, except for the double factor at the first breakdown of a
// float one.
class ReducedSolver {
 public:
  virtual ~ReducedSolver() = default;

  // S has the solver's pattern. It must not change until the last Solve with this factor, since
  // kMixed reads it there. False: S is not positive definite (to working precision) or not finite.
  virtual bool Factorise(const BlockMatrix& S) = 0;

  // Forgets earlier breakdowns, after which kMixed uses double for a while, so that results do not
  // depend on them.
  virtual void Reset() = 0;

  // b and x are plain vectors of num_unknowns and may be the same. With S scaled to a unit diagonal
  // the residual b - S x is about 1e-12 of b, or as small as rounding in double allows. Needs a
  // Factorise that returned true. False: the result is not finite.
  virtual bool Solve(const double* b, double* x) = 0;

  // The blocks of the inverse of S on the pattern of S, into a Z of that pattern. Needs a Factorise
  // that returned true; kMixed makes a factor in double for it. False: the result is not finite.
  virtual bool SelectedInverse(BlockMatrix* Z) = 0;

  // Multiplications and additions of one factorisation, including those on stored zeros.
  virtual double FactorFlops() const = 0;
  virtual size_t MemoryBytes() const = 0;
  virtual std::string Name() const = 0;  // such as "dense, double"
};

// `pattern` must outlive the solver. num_threads: -1 for one per hardware thread.
std::unique_ptr<ReducedSolver> MakeDenseSolver(const BlockPattern& pattern, Precision precision,
                                               int num_threads);
std::unique_ptr<ReducedSolver> MakeSparseSolver(const BlockPattern& pattern, Precision precision,
                                                int num_threads);

// Multiplications and additions of a dense factorisation, and of a sparse one with the elimination
// order that MakeSparseSolver would choose and without stored zeros.
double PredictDenseFlops(const BlockPattern& pattern);
double PredictSparseFlops(const BlockPattern& pattern);

}  // namespace holba
