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

  // Factorises S, or diag(scale) S diag(scale) unless `scale` is null: num_unknowns entries, with
  // kScaleMargin entries on either side that may be read. False: a pivot is not above min_pivot.
  static constexpr int kScaleMargin = 16;
  virtual bool Factorise(const BlockMatrix& S, const double* scale, double min_pivot) = 0;
  // Solves with the factorised matrix; b and x are plain vectors and may be the same.
  virtual void Solve(const double* b, double* x) = 0;
  // Z = blocks of the inverse of the factorised matrix.
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

// Memory for factors at a multiple of 64 bytes, all zero. Large pages would make factors 4 %
// faster, but the first one in a process may take a second to allocate.
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
