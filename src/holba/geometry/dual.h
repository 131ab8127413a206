// SPDX-License-Identifier: BSD-3-Clause
// Dual numbers: a value and its N partial derivatives (forward-mode differentiation). Every formula
// that is a template on the scalar can be differentiated exactly with them; hand-written Jacobians
// are tested against them.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace holba {

template <int N>
struct Dual {
  using Gradient = Eigen::Matrix<double, N, 1>;

  double value = 0.0;
  Gradient gradient = Gradient::Zero();

  Dual() = default;
  Dual(double v) : value(v) {}  // NOLINT: constants mix with dual numbers as with doubles
  Dual(double v, const Gradient& g) : value(v), gradient(g) {}
  // The k-th independent variable.
  static Dual Variable(double v, int k) {
    Dual x(v);
    x.gradient[k] = 1.0;
    return x;
  }

  Dual operator-() const { return {-value, -gradient}; }
  Dual& operator+=(const Dual& y) { return *this = *this + y; }
  Dual& operator-=(const Dual& y) { return *this = *this - y; }
  Dual& operator*=(const Dual& y) { return *this = *this * y; }
  Dual& operator/=(const Dual& y) { return *this = *this / y; }

  friend Dual operator+(const Dual& x, const Dual& y) {
    return {x.value + y.value, x.gradient + y.gradient};
  }
  friend Dual operator-(const Dual& x, const Dual& y) {
    return {x.value - y.value, x.gradient - y.gradient};
  }
  friend Dual operator*(const Dual& x, const Dual& y) {
    return {x.value * y.value, y.value * x.gradient + x.value * y.gradient};
  }
  friend Dual operator/(const Dual& x, const Dual& y) {
    const double q = x.value / y.value;
    return {q, (x.gradient - q * y.gradient) / y.value};
  }
  // Order is that of the values: branches are taken as the double formula takes them.
  friend bool operator<(const Dual& x, const Dual& y) { return x.value < y.value; }
  friend bool operator>(const Dual& x, const Dual& y) { return x.value > y.value; }
  friend bool operator<=(const Dual& x, const Dual& y) { return x.value <= y.value; }
  friend bool operator>=(const Dual& x, const Dual& y) { return x.value >= y.value; }
  friend bool operator==(const Dual& x, const Dual& y) { return x.value == y.value; }
  friend bool operator!=(const Dual& x, const Dual& y) { return x.value != y.value; }

  // f(x) with derivative d = f'(x).
  Dual Chain(double f, double d) const { return {f, d * gradient}; }
};

template <int N>
Dual<N> sqrt(const Dual<N>& x) {
  const double r = std::sqrt(x.value);
  return x.Chain(r, 0.5 / r);
}
template <int N>
Dual<N> exp(const Dual<N>& x) {
  const double e = std::exp(x.value);
  return x.Chain(e, e);
}
template <int N>
Dual<N> log(const Dual<N>& x) {
  return x.Chain(std::log(x.value), 1.0 / x.value);
}
template <int N>
Dual<N> sin(const Dual<N>& x) {
  return x.Chain(std::sin(x.value), std::cos(x.value));
}
template <int N>
Dual<N> cos(const Dual<N>& x) {
  return x.Chain(std::cos(x.value), -std::sin(x.value));
}
template <int N>
Dual<N> tan(const Dual<N>& x) {
  const double t = std::tan(x.value);
  return x.Chain(t, 1.0 + t * t);
}
template <int N>
Dual<N> atan(const Dual<N>& x) {
  return x.Chain(std::atan(x.value), 1.0 / (1.0 + x.value * x.value));
}
template <int N>
Dual<N> atan2(const Dual<N>& y, const Dual<N>& x) {
  const double n = x.value * x.value + y.value * y.value;
  return {std::atan2(y.value, x.value), (x.value * y.gradient - y.value * x.gradient) / n};
}
template <int N>
Dual<N> abs(const Dual<N>& x) {
  return x.value < 0 ? -x : x;
}
template <int N>
Dual<N> abs2(const Dual<N>& x) {
  return x * x;
}

inline double ValueOf(double x) { return x; }
template <int N>
double ValueOf(const Dual<N>& x) {
  return x.value;
}

}  // namespace holba

namespace Eigen {

template <int N>
struct NumTraits<holba::Dual<N>> : NumTraits<double> {
  using Real = holba::Dual<N>;
  using NonInteger = holba::Dual<N>;
  using Nested = holba::Dual<N>;
  using Literal = double;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1 + N,
    MulCost = 3 + 2 * N
  };
};
template <int N, typename BinaryOp>
struct ScalarBinaryOpTraits<holba::Dual<N>, double, BinaryOp> {
  using ReturnType = holba::Dual<N>;
};
template <int N, typename BinaryOp>
struct ScalarBinaryOpTraits<double, holba::Dual<N>, BinaryOp> {
  using ReturnType = holba::Dual<N>;
};

}  // namespace Eigen
