// SPDX-License-Identifier: BSD-3-Clause
// Preconditioned conjugate gradients (Hestenes and Stiefel 1952) for A x = b, where A is symmetric
// positive definite and given by its product with vectors. The iteration ends by the decrease of
// the quadratic model (Nash and Sofer 1990), which suits inexact Newton steps, or by the residual.
// Sums are taken in a fixed order.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "holba/linear/block_matrix.h"

namespace holba {

// y = A x, plain vectors of one size that do not overlap.
class LinearOperator {
 public:
  virtual ~LinearOperator() = default;
  virtual void Apply(const double* x, double* y) = 0;
};

// z = M^-1 r, plain vectors of one size that do not overlap. M is symmetric positive definite.
class Preconditioner {
 public:
  virtual ~Preconditioner() = default;
  virtual void Apply(const double* r, double* z) = 0;
};

// The product with a matrix in memory. `matrix` must outlive this object; its values may change
// between products.
class BlockMatrixOperator : public LinearOperator {
 public:
  explicit BlockMatrixOperator(const BlockMatrix* matrix, int num_threads = 1)
      : matrix_(matrix), num_threads_(num_threads) {}
  void Apply(const double* x, double* y) override {
    matrix_->Multiply(x, y, num_threads_, &scratch_);
  }

 private:
  const BlockMatrix* matrix_;
  int num_threads_;
  std::vector<double> scratch_;
};

struct ConjugateGradientsOptions {
  int max_iterations = 500;
  int min_iterations = 0;  // the tests below apply from this number of iterations on
  // The iteration ends when i * (Q_i - Q_{i-1}) / Q_i < eta, where Q_i = x^T A x / 2 - b^T x after
  // iteration i: the last step decreased Q by less than eta times the average step. 0: off.
  double eta = 0.1;
  double residual_tolerance = 0.0;  // ends once |r| <= residual_tolerance * |b|; 0: off
};

enum class ConjugateGradientsEnd {
  kConverged,  // by one of the two tests, or the residual is 0
  kMaxIterations,
  kNegativeCurvature,  // p^T A p <= 0: A is not positive definite (or rounding says so)
  kBadPreconditioner,  // r^T M^-1 r <= 0
  kNotFinite,          // b, A or M^-1 gave infinities or NaN
};
std::string_view NameOf(ConjugateGradientsEnd end);

struct ConjugateGradientsResult {
  ConjugateGradientsEnd end = ConjugateGradientsEnd::kConverged;
  int iterations = 0;              // steps taken: updates of x
  double relative_residual = 0.0;  // |r| / |b|, by the recurrence
  double model_change = 0.0;       // Q(x), <= 0: what the quadratic model says that x gains
};

// Keeps its vectors from call to call, so a call with a size that was seen before allocates
// nothing.
class ConjugateGradients {
 public:
  // b and x are plain vectors of `size` that do not overlap. Starts at x = 0, so that every
  // iteration decreases Q: x is a descent direction for every end, or 0 if iterations == 0. A null
  // preconditioner means none.
  ConjugateGradientsResult Solve(LinearOperator* A, Preconditioner* preconditioner, size_t size,
                                 const double* b, const ConjugateGradientsOptions& options,
                                 double* x);

  // r = b - A x of the last Solve, by the recurrence.
  std::span<const double> residual() const { return r_; }

 private:
  std::vector<double> r_, z_, p_, q_;
};

}  // namespace holba
