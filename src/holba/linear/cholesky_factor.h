// SPDX-License-Identifier: BSD-3-Clause
// The two Cholesky factors behind ReducedSolver: dense and sparse, in double or float.
#pragma once

#include <cstddef>
#include <memory>

#include "holba/linear/block_matrix.h"

namespace holba {

class CholeskyFactor {
 public:
  virtual ~CholeskyFactor() = default;

  // Of S, or with `scale` (num_unknowns entries, and kScaleMargin more on either side that may be
  // read) of diag(scale) S diag(scale). False: a pivot is not above min_pivot.
  static constexpr int kScaleMargin = 16;
  virtual bool Factorise(const BlockMatrix& S, const double* scale, double min_pivot) = 0;
  // Solves with what was factorised; b and x are plain vectors and may be the same.
  virtual void Solve(const double* b, double* x) = 0;
  // Z = blocks of the inverse of what was factorised.
  virtual void SelectedInverse(BlockMatrix* Z) = 0;
  virtual double Flops() const = 0;
  virtual size_t MemoryBytes() const = 0;
};

template <typename Real>
std::unique_ptr<CholeskyFactor> MakeDenseFactor(const BlockPattern& pattern, int num_threads);

struct Elimination;
template <typename Real>
std::unique_ptr<CholeskyFactor> MakeSparseFactor(const BlockPattern& pattern,
                                                 std::shared_ptr<const Elimination> elimination,
                                                 int num_threads);

// Numbers for factors, at a multiple of 64 bytes, all zero. (Large pages make factors 4 % faster,
// but the first of them in a process may cost a second to get.)
template <typename Real>
class FactorMemory {
 public:
  FactorMemory() = default;
  explicit FactorMemory(size_t size);
  FactorMemory(FactorMemory&& other) noexcept;
  FactorMemory& operator=(FactorMemory&& other) noexcept;
  ~FactorMemory();

  Real* data() { return data_; }
  const Real* data() const { return data_; }
  size_t size() const { return size_; }

 private:
  Real* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace holba
