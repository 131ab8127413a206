// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/dual.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include "holba/geometry/types.h"

namespace holba {
namespace {

// f at a dual number has the value of f and the slope of its central difference.
template <typename F>
void ExpectDerivative(const char* name, const F& f, const std::vector<double>& places) {
  for (const double x : places) {
    SCOPED_TRACE(::testing::Message() << name << " at " << x);
    const Dual<1> y = f(Dual<1>::Variable(x, 0));
    const double h = 1e-5 * std::max(1.0, std::abs(x));
    const double slope = (f(x + h) - f(x - h)) / (2 * h);
    EXPECT_DOUBLE_EQ(y.value, f(x));
    EXPECT_NEAR(y.gradient[0], slope, 1e-8 * std::max(1.0, std::abs(slope)));
  }
}

TEST(Dual, FunctionsHaveTheSlopesOfCentralDifferences) {
  const std::vector<double> any = {-2.3, -0.4, 0.0, 0.7, 3.1}, positive = {0.2, 1.0, 7.5};
  using std::abs, std::atan, std::atan2, std::cos, std::exp, std::log, std::sin, std::sqrt,
      std::tan;
  ExpectDerivative(
      "sqrt", [](auto x) { return sqrt(x); }, positive);
  ExpectDerivative(
      "exp", [](auto x) { return exp(x); }, any);
  ExpectDerivative(
      "log", [](auto x) { return log(x); }, positive);
  ExpectDerivative(
      "sin", [](auto x) { return sin(x); }, any);
  ExpectDerivative(
      "cos", [](auto x) { return cos(x); }, any);
  ExpectDerivative(
      "tan", [](auto x) { return tan(x); }, any);
  ExpectDerivative(
      "atan", [](auto x) { return atan(x); }, any);
  ExpectDerivative("abs", [](auto x) { return abs(x); }, {-2.3, -0.4, 0.7});
  ExpectDerivative(
      "abs2", [](auto x) { return decltype(x)(x * x); }, any);
  ExpectDerivative(
      "atan2(x, c)", [](auto x) { return atan2(x, decltype(x)(1.7)); }, any);
  // Off the cut along the negative axis.
  ExpectDerivative("atan2(x, -c)", [](auto x) { return atan2(x, decltype(x)(-1.7)); }, {-2.3, 0.7});
  ExpectDerivative(
      "atan2(c, x)", [](auto x) { return atan2(decltype(x)(0.6), x); }, any);
  EXPECT_EQ(abs2(Dual<1>::Variable(-3, 0)).value, 9);
  EXPECT_EQ(abs2(Dual<1>::Variable(-3, 0)).gradient[0], -6);
}

TEST(Dual, ArithmeticHasTheSlopesOfCentralDifferences) {
  const std::vector<double> places = {-2.3, -0.4, 0.7, 3.1};
  ExpectDerivative(
      "sum", [](auto x) { return 2.0 + x + x + 3.0; }, places);
  ExpectDerivative(
      "difference", [](auto x) { return 1.0 - x * x - 0.5; }, places);
  ExpectDerivative(
      "product", [](auto x) { return 3.0 * x * (x + 1.0) * 2.0; }, places);
  ExpectDerivative(
      "quotient", [](auto x) { return (x + 1.0) / (x * x + 2.0) / 4.0; }, places);
  ExpectDerivative(
      "reciprocal", [](auto x) { return 1.0 / x; }, places);
  ExpectDerivative(
      "negation", [](auto x) { return -(x * x); }, places);
  ExpectDerivative(
      "compound assignment",
      [](auto x) {
        auto y = x;
        y += x * x;
        y *= x;
        y -= 2.0 * x;
        y /= x * x + 1.0;
        return y;
      },
      places);
}

TEST(Dual, CompositionsFollowTheChainRule) {
  ExpectDerivative("composition",
                   [](auto x) {
                     using std::atan, std::cos, std::exp, std::log, std::sin, std::sqrt;
                     return sqrt(1.0 + exp(sin(x) * cos(x))) / log(3.0 + x * x) + atan(x / 2.0);
                   },
                   {-2.3, 0.0, 0.9, 4.0});
}

TEST(Dual, PartialDerivativesStayApart) {
  const Dual<3> x = Dual<3>::Variable(2, 0), y = Dual<3>::Variable(5, 1);
  const Dual<3> f = x * x * y + 7.0;
  EXPECT_EQ(f.value, 27);
  EXPECT_EQ(f.gradient, Eigen::Vector3d(20, 4, 0));
  const Dual<3> angle = atan2(y, x);  // d = (-y, x) / (x^2 + y^2)
  EXPECT_NEAR((angle.gradient - Eigen::Vector3d(-5, 2, 0) / 29).norm(), 0, 1e-15);
}

TEST(Dual, ConstantsHaveNoGradient) {
  EXPECT_EQ(Dual<2>(4.5).value, 4.5);
  EXPECT_EQ(Dual<2>(4.5).gradient, Eigen::Vector2d::Zero());
  EXPECT_EQ(Dual<2>().value, 0.0);
  EXPECT_EQ(Dual<2>().gradient, Eigen::Vector2d::Zero());
}

TEST(Dual, OrderIsThatOfTheValues) {
  const Dual<1> a = Dual<1>::Variable(1, 0), same(1.0), b(2.0);
  EXPECT_TRUE(a < b && b > a && a <= b && b >= a && a != b);
  EXPECT_TRUE(a == same && a <= same && a >= same);
  EXPECT_FALSE(a > b || a < same || a != same);
  EXPECT_TRUE(a < 1.5 && 0.5 < a);
}

TEST(Dual, ValueOfDropsTheGradient) {
  EXPECT_EQ(ValueOf(Dual<4>::Variable(3.25, 2)), 3.25);
  EXPECT_EQ(ValueOf(3.25), 3.25);
  static_assert(std::is_same_v<decltype(ValueOf(Dual<4>())), double>);
}

// f: 3-vector of the scalar -> 3-vector; its Jacobian by dual numbers against central differences.
template <typename F>
void ExpectJacobian(const F& f, const Eigen::Vector3d& x) {
  Vector3<Dual<3>> dual;
  for (int i = 0; i < 3; ++i) dual[i] = Dual<3>::Variable(x[i], i);
  const Vector3<Dual<3>> y = f(dual);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d h = 1e-6 * Eigen::Vector3d::Unit(i);
    const Eigen::Vector3d column = (f(Eigen::Vector3d(x + h)) - f(Eigen::Vector3d(x - h))) / 2e-6;
    for (int row = 0; row < 3; ++row) EXPECT_NEAR(y[row].gradient[i], column[row], 1e-8);
  }
}

TEST(Dual, WorksInsideEigen) {
  const Eigen::Vector3d x(0.3, -1.2, 2.1);
  ExpectJacobian([](const auto& v) { return std::decay_t<decltype(v)>(v.normalized()); }, x);
  ExpectJacobian(
      [](const auto& v) {
        using V = std::decay_t<decltype(v)>;
        const V w = V(v.y(), v.z(), v.x());
        return V(v.cross(w) * v.dot(w) + w / v.norm());
      },
      x);
  ExpectJacobian(
      [](const auto& v) {
        using V = std::decay_t<decltype(v)>;
        using T = typename V::Scalar;
        return V(CrossMatrix<T>(v) * (Matrix3<T>::Identity() * T(2.0) + v * v.transpose()) *
                 V(T(1.0), T(2.0), T(3.0)));
      },
      x);
}

TEST(CrossMatrix, IsTheCrossProduct) {
  const Eigen::Vector3d v(1, 2, 3), w(-4, 5, 0.5);
  EXPECT_LT((CrossMatrix<double>(v) * w - v.cross(w)).norm(), 1e-15);
}

}  // namespace
}  // namespace holba
