// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/real_roots.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "holba/base/check.h"

namespace holba {
namespace {

using Coefficients = std::array<double, kMaxPolynomialDegree + 1>;

// Leading coefficients below this share of the largest are rounding: their roots lie outside of
// what is looked for.
constexpr double kNegligible = 1e-14;
constexpr double kMaxMagnitude = 1e6;

double Evaluate(const Coefficients& p, int degree, double x) {
  double value = p[degree];
  for (int k = degree - 1; k >= 0; --k) value = value * x + p[k];
  return value;
}

class SturmSequence {
 public:
  SturmSequence(const Coefficients& p, int degree) : degree_{degree} {
    sequence_[0] = p;
    degrees_[0] = degree;
    for (int k = 1; k <= degree; ++k) sequence_[1][k - 1] = k * p[k];
    degrees_[1] = degree - 1;
    Normalise(&sequence_[1], degrees_[1]);
    length_ = 2;
    while (degrees_[length_ - 1] > 0) {
      Coefficients rest = sequence_[length_ - 2];
      int rest_degree = degrees_[length_ - 2];
      const Coefficients& divisor = sequence_[length_ - 1];
      const int divisor_degree = degrees_[length_ - 1];
      for (; rest_degree >= divisor_degree; --rest_degree) {
        const double factor = rest[rest_degree] / divisor[divisor_degree];
        for (int k = 0; k < divisor_degree; ++k)
          rest[rest_degree - divisor_degree + k] -= factor * divisor[k];
      }
      double largest = 0.0;
      for (int k = 0; k <= rest_degree; ++k) largest = std::max(largest, std::abs(rest[k]));
      // The rest is zero up to rounding: a multiple root, of which the divisor is the factor.
      if (largest < kNegligible) break;
      while (rest_degree > 0 && std::abs(rest[rest_degree]) < kNegligible * largest) --rest_degree;
      for (int k = 0; k <= rest_degree; ++k) rest[k] = -rest[k] / largest;
      sequence_[length_] = rest;
      degrees_[length_] = rest_degree;
      ++length_;
    }
  }

  int SignChanges(double x) const {
    int changes = 0;
    double last = 0.0;
    for (int i = 0; i < length_; ++i) {
      const double value = Evaluate(sequence_[i], degrees_[i], x);
      if (value == 0.0) continue;
      if (last * value < 0.0) ++changes;
      last = std::copysign(1.0, value);
    }
    return changes;
  }

  // The only root in (low, high].
  double Polish(double low, double high) const {
    const Coefficients& p = sequence_[0];
    double at_low = Evaluate(p, degree_, low);
    const double at_high = Evaluate(p, degree_, high);
    if (at_high == 0.0) return high;
    // A double root has no change of sign, but its derivative has.
    const bool changes = at_low * at_high < 0.0;
    const Coefficients& f = changes ? p : sequence_[1];
    const int degree = changes ? degree_ : degree_ - 1;
    if (!changes) {
      at_low = Evaluate(f, degree, low);
      if (at_low * Evaluate(f, degree, high) > 0.0) return 0.5 * (low + high);
    }
    // Newton's steps as long as they stay inside, else halves.
    double x = 0.5 * (low + high);
    for (int iteration = 0; iteration < 100; ++iteration) {
      double value = f[degree], slope = 0.0;
      for (int k = degree - 1; k >= 0; --k) {
        slope = slope * x + value;
        value = value * x + f[k];
      }
      if (value == 0.0) break;
      (value * at_low > 0.0 ? low : high) = x;
      double next = x - value / slope;
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      if (std::abs(next - x) <= 1e-15 * std::abs(x)) return next;
      x = next;
    }
    return x;
  }

 private:
  static void Normalise(Coefficients* p, int degree) {
    double largest = 0.0;
    for (int k = 0; k <= degree; ++k) largest = std::max(largest, std::abs((*p)[k]));
    if (largest > 0.0)
      for (int k = 0; k <= degree; ++k) (*p)[k] /= largest;
  }

  int degree_, length_ = 0;
  std::array<Coefficients, kMaxPolynomialDegree + 1> sequence_{};
  std::array<int, kMaxPolynomialDegree + 1> degrees_{};
};

void Isolate(const SturmSequence& sequence, double low, int changes_low, double high,
             int changes_high, int depth, double* roots, int* num_roots) {
  const int count = changes_low - changes_high;
  if (count <= 0 || *num_roots >= kMaxPolynomialDegree) return;
  const double middle = 0.5 * (low + high);
  // Roots that no double lies between count as one.
  if (count == 1 || depth == 0 || middle == low || middle == high) {
    roots[(*num_roots)++] = sequence.Polish(low, high);
    return;
  }
  const int changes = sequence.SignChanges(middle);
  Isolate(sequence, low, changes_low, middle, changes, depth - 1, roots, num_roots);
  Isolate(sequence, middle, changes, high, changes_high, depth - 1, roots, num_roots);
}

}  // namespace

int RealRoots(std::span<const double> coefficients, double* roots) {
  HOLBA_CHECK(coefficients.size() <= kMaxPolynomialDegree + 1);
  Coefficients p{};
  int degree = static_cast<int>(coefficients.size()) - 1;
  double largest = 0.0;
  for (int k = 0; k <= degree; ++k) {
    p[k] = coefficients[k];
    largest = std::max(largest, std::abs(p[k]));
  }
  if (!(largest > 0.0) || !std::isfinite(largest)) return 0;
  for (int k = 0; k <= degree; ++k) p[k] /= largest;
  while (degree > 0 && std::abs(p[degree]) < kNegligible) --degree;
  if (degree <= 0) return 0;

  // All roots are within 1 + max |p_k / p_n| (Cauchy).
  double bound = 0.0;
  for (int k = 0; k < degree; ++k) bound = std::max(bound, std::abs(p[k] / p[degree]));
  bound = std::min(1.0 + bound, kMaxMagnitude);
  const SturmSequence sequence(p, degree);
  int num_roots = 0;
  Isolate(sequence, -bound, sequence.SignChanges(-bound), bound, sequence.SignChanges(bound), 60,
          roots, &num_roots);
  return num_roots;
}

}  // namespace holba
