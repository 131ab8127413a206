// SPDX-License-Identifier: BSD-3-Clause
// Direct solvers of the reduced camera system S x = b, S symmetric positive definite. Results are
// the same bit for bit for every number of threads.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "holba/linear/block_matrix.h"

namespace holba {

enum class Precision {
  kDouble,
  // The factor in float (half the memory, up to twice the speed); Solve repairs it by conjugate
  // gradients on S in double. Where float breaks down, the factor is made again in double.
  kMixed,
};

// Made for one pattern: the analysis and all memory belong to the constructor, Factorise and Solve
// allocate nothing (but for the double factor that replaces a float one at its first breakdown).
class ReducedSolver {
 public:
  virtual ~ReducedSolver() = default;

  // `S`: of the solver's pattern; must stay as it is until the last Solve with this factor, which
  // kMixed still reads it in. False: not positive definite (to working precision) or not finite.
  virtual bool Factorise(const BlockMatrix& S) = 0;

  // Forgets how former factors went (kMixed turns to double for a while after a breakdown), so that
  // results do not depend on them.
  virtual void Reset() = 0;

  // Plain vectors of num_unknowns; b and x may be the same. The residual b - S x, of S scaled to a
  // unit diagonal, is about 1e-12 of b, or as small as rounding in double lets it be. Needs a
  // Factorise that returned true. False: the result is not finite.
  virtual bool Solve(const double* b, double* x) = 0;

  // The blocks of the inverse of S on the pattern of S, into a Z of that pattern. Needs a Factorise
  // that returned true; kMixed makes a factor in double for it. False: the result is not finite.
  virtual bool SelectedInverse(BlockMatrix* Z) = 0;

  // Multiplications and additions of one factorisation, with the zeros that the solver stores.
  virtual double FactorFlops() const = 0;
  virtual size_t MemoryBytes() const = 0;
  virtual std::string Name() const = 0;  // such as "dense, double"
};

// `pattern` must outlive the solver. num_threads: -1 for one per hardware thread.
std::unique_ptr<ReducedSolver> MakeDenseSolver(const BlockPattern& pattern, Precision precision,
                                               int num_threads);
std::unique_ptr<ReducedSolver> MakeSparseSolver(const BlockPattern& pattern, Precision precision,
                                                int num_threads);

// Multiplications and additions of a dense factorisation, and of a sparse one (with the ordering
// that MakeSparseSolver would choose, without zeros stored in excess).
double PredictDenseFlops(const BlockPattern& pattern);
double PredictSparseFlops(const BlockPattern& pattern);

}  // namespace holba
