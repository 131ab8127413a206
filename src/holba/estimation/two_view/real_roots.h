// SPDX-License-Identifier: BSD-3-Clause
// Real roots of polynomials, isolated by Sturm's theorem: the number of different roots in an
// interval is the difference of the numbers of sign changes along the polynomial's Sturm sequence
// at its ends.
#pragma once

#include <span>

namespace holba {

inline constexpr int kMaxPolynomialDegree = 10;

// Different real roots, ascending, of sum_k coefficients[k] x^k; a multiple root is given once.
// `roots` has room for kMaxPolynomialDegree. Returns their number: 0 for a constant, also for zero.
// Roots of magnitude over 1e6 times the unit in which the coefficients are balanced are not looked
// for.
int RealRoots(std::span<const double> coefficients, double* roots);

}  // namespace holba
