// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/conjugate_gradients.h"

#include <algorithm>
#include <cmath>

#include "holba/base/check.h"

namespace holba {
namespace {

// Eight partial sums: vectorises without a change of the order of summation, which is the same on
// every machine.
constexpr size_t kLanes = 8;
using EightDoubles =
    double __attribute__((vector_size(kLanes * sizeof(double)), aligned(8), may_alias));

#define HOLBA_LANES(pointer) (*reinterpret_cast<EightDoubles*>(pointer))
#define HOLBA_CONST_LANES(pointer) (*reinterpret_cast<const EightDoubles*>(pointer))

double SumOfLanes(const double* lanes) {
  return ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) +
         ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
}

// With eight partial sums.
double DotOfEight(const std::vector<double>& x, const std::vector<double>& y) {
  const size_t n = x.size();
  double sums[kLanes] = {};
  size_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    HOLBA_LANES(sums) += HOLBA_CONST_LANES(x.data() + i) * HOLBA_CONST_LANES(y.data() + i);
  }
  for (size_t lane = 0; i < n; ++i, ++lane) sums[lane] += x[i] * y[i];
  return SumOfLanes(sums);
}

// p = z + beta p.
void Turn(const std::vector<double>& z, double beta, std::vector<double>* p) {
  const size_t n = z.size();
  size_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    HOLBA_LANES(p->data() + i) =
        HOLBA_CONST_LANES(z.data() + i) + beta * HOLBA_CONST_LANES(p->data() + i);
  }
  for (; i < n; ++i) (*p)[i] = z[i] + beta * (*p)[i];
}

// x += alpha p, r -= alpha q; the new |r|^2.
double Step(double alpha, const std::vector<double>& p, const std::vector<double>& q, double* x,
            std::vector<double>* r) {
  const size_t n = p.size();
  double sums[kLanes] = {};
  size_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    HOLBA_LANES(x + i) += alpha * HOLBA_CONST_LANES(p.data() + i);
    EightDoubles& r_lanes = HOLBA_LANES(r->data() + i);
    r_lanes -= alpha * HOLBA_CONST_LANES(q.data() + i);
    HOLBA_LANES(sums) += r_lanes * r_lanes;
  }
  for (size_t lane = 0; i < n; ++i, ++lane) {
    x[i] += alpha * p[i];
    (*r)[i] -= alpha * q[i];
    sums[lane] += (*r)[i] * (*r)[i];
  }
  return SumOfLanes(sums);
}

}  // namespace

std::string_view NameOf(ConjugateGradientsEnd end) {
  switch (end) {
    case ConjugateGradientsEnd::kConverged:
      return "converged";
    case ConjugateGradientsEnd::kMaxIterations:
      return "iteration limit";
    case ConjugateGradientsEnd::kNegativeCurvature:
      return "negative curvature";
    case ConjugateGradientsEnd::kBadPreconditioner:
      return "preconditioner not positive definite";
    case ConjugateGradientsEnd::kNotFinite:
      return "not finite";
  }
  HOLBA_CHECK(false);
}

ConjugateGradientsResult ConjugateGradients::Solve(LinearOperator* A,
                                                   Preconditioner* preconditioner, size_t size,
                                                   const double* b,
                                                   const ConjugateGradientsOptions& options,
                                                   double* x) {
  using End = ConjugateGradientsEnd;
  ConjugateGradientsResult result;
  r_.assign(b, b + size);
  z_.resize(size);
  p_.assign(size, 0.0);
  q_.resize(size);
  std::fill(x, x + size, 0.0);

  const double b_squared = DotOfEight(r_, r_);
  if (!std::isfinite(b_squared)) {
    result.end = End::kNotFinite;
    result.relative_residual = 1.0;
    return result;
  }
  if (b_squared == 0.0) return result;
  const auto end_with = [&](End end, double r_squared) {
    result.end = end;
    result.relative_residual = std::sqrt(r_squared / b_squared);
    return result;
  };

  double r_squared = b_squared;
  double last_rho = 0.0;
  // Of Q: step i lowers it by alpha rho / 2, so neither test needs Q itself or cancels digits.
  double gain = 0.0;
  while (true) {
    if (result.iterations >= options.max_iterations)
      return end_with(End::kMaxIterations, r_squared);
    const std::vector<double>& z = preconditioner != nullptr ? z_ : r_;
    if (preconditioner != nullptr) preconditioner->Apply(r_.data(), z_.data());
    const double rho = DotOfEight(r_, z);
    if (!std::isfinite(rho)) return end_with(End::kNotFinite, r_squared);
    if (rho <= 0.0) return end_with(End::kBadPreconditioner, r_squared);
    Turn(z, last_rho > 0.0 ? rho / last_rho : 0.0, &p_);
    last_rho = rho;
    A->Apply(p_.data(), q_.data());
    const double curvature = DotOfEight(p_, q_);
    // Finite only if all of p and q are: infinity times 0 is NaN.
    if (!std::isfinite(curvature)) return end_with(End::kNotFinite, r_squared);
    const double alpha = rho / curvature;
    if (curvature <= 0.0 || !std::isfinite(alpha)) {
      return end_with(End::kNegativeCurvature, r_squared);
    }
    r_squared = Step(alpha, p_, q_, x, &r_);
    ++result.iterations;
    const double step_gain = alpha * rho;
    gain += step_gain;
    result.model_change = -0.5 * gain;
    if (r_squared == 0.0) return end_with(End::kConverged, r_squared);
    if (result.iterations < options.min_iterations) continue;
    if (options.eta > 0.0 && result.iterations * step_gain < options.eta * gain) {
      return end_with(End::kConverged, r_squared);
    }
    if (options.residual_tolerance > 0.0 &&
        r_squared <= options.residual_tolerance * options.residual_tolerance * b_squared) {
      return end_with(End::kConverged, r_squared);
    }
  }
}

}  // namespace holba
