// SPDX-License-Identifier: BSD-3-Clause
// The laws of a manifold (manifold.h), for every manifold.
#include "holba/geometry/manifold.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {
namespace {

// Random points of a manifold, written to x, and how far x is from being one.
template <int N>
void Sample(Euclidean<N>, Random* random, double* x) {
  for (int i = 0; i < N; ++i) x[i] = random->Normal(3.0);
}
template <int N>
double Violation(Euclidean<N>, const double*) {
  return 0.0;
}
void Sample(UnitVector3, Random* random, double* x) {
  Eigen::Map<Eigen::Vector3d>{x} =
      Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()).normalized();
}
double Violation(UnitVector3, const double* x) {
  return std::abs(Eigen::Map<const Eigen::Vector3d>(x).norm() - 1.0);
}
void Sample(UnitQuaternion, Random* random, double* x) {
  Eigen::Map<Eigen::Vector4d>{x} =
      Eigen::Vector4d(random->Normal(), random->Normal(), random->Normal(), random->Normal())
          .normalized();
}
double Violation(UnitQuaternion, const double* x) {
  return std::abs(Eigen::Map<const Eigen::Vector4d>(x).norm() - 1.0);
}
void Sample(LineManifold, Random* random, double* x) {
  Sample(UnitVector3(), random, x);
  Sample(Euclidean<3>(), random, x + 3);
}
double Violation(LineManifold, const double* x) { return Violation(UnitVector3(), x); }
template <typename A>
void Sample(Product<A>, Random* random, double* x) {
  Sample(A(), random, x);
}
template <typename A>
double Violation(Product<A>, const double* x) {
  return Violation(A(), x);
}
template <typename A, typename B, typename... Rest>
void Sample(Product<A, B, Rest...>, Random* random, double* x) {
  Sample(A(), random, x);
  Sample(Product<B, Rest...>(), random, x + A::kAmbient);
}
template <typename A, typename B, typename... Rest>
double Violation(Product<A, B, Rest...>, const double* x) {
  return std::max(Violation(A(), x), Violation(Product<B, Rest...>(), x + A::kAmbient));
}

template <typename M>
class ManifoldContract : public ::testing::Test {
 protected:
  static constexpr int A = M::kAmbient, T = M::kTangent;
  using Point = Eigen::Matrix<double, A, 1>;
  using Tangent = Eigen::Matrix<double, T, 1>;
  using PlusJ = RowMajor<A, T>;
  using MinusJ = RowMajor<T, A>;

  Point RandomPoint() {
    Point x;
    Sample(M(), &random_, x.data());
    return x;
  }
  // At most `longest` in every direction.
  Tangent RandomTangent(double longest) {
    Tangent d;
    for (int i = 0; i < T; ++i) d[i] = random_.Uniform(-1, 1);
    return longest / std::sqrt(static_cast<double>(T)) * d;
  }
  static Point Plus(const Point& x, const Tangent& d) {
    Point y = Point::Constant(std::numeric_limits<double>::quiet_NaN());
    M::Plus(x.data(), d.data(), y.data());
    return y;
  }
  static Tangent Minus(const Point& y, const Point& x) {
    Tangent d = Tangent::Constant(std::numeric_limits<double>::quiet_NaN());
    M::Minus(y.data(), x.data(), d.data());
    return d;
  }
  static PlusJ PlusJacobian(const Point& x) {
    PlusJ J = PlusJ::Constant(std::numeric_limits<double>::quiet_NaN());
    M::PlusJacobian(x.data(), J.data());
    return J;
  }
  static MinusJ MinusJacobian(const Point& x) {
    MinusJ J = MinusJ::Constant(std::numeric_limits<double>::quiet_NaN());
    M::MinusJacobian(x.data(), J.data());
    return J;
  }

  static constexpr int kTrials = 50;
  Random random_{7};
};

using Manifolds =
    ::testing::Types<Euclidean<1>, Euclidean<3>, Euclidean<8>, UnitVector3, UnitQuaternion,
                     PoseManifold, LineManifold, Product<UnitVector3, Euclidean<1>>,
                     Product<LineManifold, Euclidean<1>>,
                     Product<UnitQuaternion, Euclidean<3>, Euclidean<3>>>;
TYPED_TEST_SUITE(ManifoldContract, Manifolds);

TYPED_TEST(ManifoldContract, PlusZeroStays) {
  for (int trial = 0; trial < this->kTrials; ++trial) {
    const auto x = this->RandomPoint();
    EXPECT_LT((this->Plus(x, TestFixture::Tangent::Zero()) - x).norm(), 1e-14);
    EXPECT_LT(this->Minus(x, x).norm(), 1e-14);
  }
}

TYPED_TEST(ManifoldContract, MinusInvertsPlus) {
  for (const double longest : {1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.0}) {
    for (int trial = 0; trial < this->kTrials; ++trial) {
      const auto x = this->RandomPoint();
      const auto d = this->RandomTangent(longest);
      EXPECT_LT((this->Minus(this->Plus(x, d), x) - d).norm(), 1e-9 * longest + 1e-14)
          << d.transpose();
    }
  }
}

TYPED_TEST(ManifoldContract, PlusInvertsMinus) {
  for (int trial = 0; trial < this->kTrials; ++trial) {
    const auto x = this->RandomPoint();
    const auto y = this->Plus(x, this->RandomTangent(2.0));
    EXPECT_LT((this->Plus(x, this->Minus(y, x)) - y).norm(), 1e-12);
  }
}

TYPED_TEST(ManifoldContract, PlusStaysOnTheManifold) {
  for (int trial = 0; trial < this->kTrials; ++trial) {
    auto x = this->RandomPoint();
    for (int step = 0; step < 100; ++step) x = this->Plus(x, this->RandomTangent(5.0));
    EXPECT_LT(Violation(TypeParam(), x.data()), 1e-14);
  }
}

TYPED_TEST(ManifoldContract, PlusMayOverwriteItsInput) {
  const auto x = this->RandomPoint();
  const auto d = this->RandomTangent(0.5);
  auto in_place = x;
  TypeParam::Plus(in_place.data(), d.data(), in_place.data());
  EXPECT_EQ(in_place, this->Plus(x, d));
}

TYPED_TEST(ManifoldContract, MinusJacobianInvertsPlusJacobian) {
  for (int trial = 0; trial < this->kTrials; ++trial) {
    const auto x = this->RandomPoint();
    const auto product = (this->MinusJacobian(x) * this->PlusJacobian(x)).eval();
    EXPECT_LT((product - decltype(product)::Identity()).norm(), 1e-13);
  }
}

TYPED_TEST(ManifoldContract, PlusJacobianAgreesWithCentralDifferences) {
  using Tangent = typename TestFixture::Tangent;
  for (int trial = 0; trial < this->kTrials; ++trial) {
    const auto x = this->RandomPoint();
    typename TestFixture::PlusJ numeric;
    for (int i = 0; i < TypeParam::kTangent; ++i) {
      const Tangent h = 1e-6 * Tangent::Unit(i);
      numeric.col(i) = (this->Plus(x, h) - this->Plus(x, -h)) / 2e-6;
    }
    EXPECT_LT((this->PlusJacobian(x) - numeric).norm(), 1e-8);
  }
}

TYPED_TEST(ManifoldContract, MinusJacobianAgreesWithCentralDifferences) {
  using Point = typename TestFixture::Point;
  for (int trial = 0; trial < this->kTrials; ++trial) {
    const auto x = this->RandomPoint();
    typename TestFixture::MinusJ numeric;
    for (int i = 0; i < TypeParam::kAmbient; ++i) {
      const Point h = 1e-6 * Point::Unit(i);
      numeric.col(i) = (this->Minus(x + h, x) - this->Minus(x - h, x)) / 2e-6;
    }
    EXPECT_LT((this->MinusJacobian(x) - numeric).norm(), 1e-8);
  }
}

TYPED_TEST(ManifoldContract, OpsAreTheManifoldsOwn) {
  const ManifoldOps& ops = OpsOf<TypeParam>();
  EXPECT_EQ(&ops, &OpsOf<TypeParam>());
  EXPECT_EQ(ops.ambient, TypeParam::kAmbient);
  EXPECT_EQ(ops.tangent, TypeParam::kTangent);
  const auto x = this->RandomPoint();
  const auto d = this->RandomTangent(0.5);
  typename TestFixture::Point y;
  ops.plus(x.data(), d.data(), y.data());
  EXPECT_EQ(y, this->Plus(x, d));
  typename TestFixture::Tangent back;
  ops.minus(y.data(), x.data(), back.data());
  EXPECT_EQ(back, this->Minus(y, x));
  typename TestFixture::PlusJ plus;
  ops.plus_jacobian(x.data(), plus.data());
  EXPECT_EQ(plus, this->PlusJacobian(x));
  typename TestFixture::MinusJ minus;
  ops.minus_jacobian(x.data(), minus.data());
  EXPECT_EQ(minus, this->MinusJacobian(x));
}

TEST(TangentBasis, IsOrthonormalEverywhere) {
  Random random(3);
  std::vector<Eigen::Vector3d> directions = {{1, 0, 0},
                                             {0, 1, 0},
                                             {0, 0, 1},
                                             {-1, 0, 0},
                                             {0, -1, 0},
                                             {0, 0, -1},
                                             Eigen::Vector3d(1e-9, -1e-9, -1).normalized(),
                                             Eigen::Vector3d(1, 1, -1e-300).normalized(),
                                             {1, 0, -0.0}};
  for (int i = 0; i < 100; ++i) {
    Eigen::Vector3d v;
    Sample(UnitVector3(), &random, v.data());
    directions.push_back(v);
  }
  for (const Eigen::Vector3d& v : directions) {
    Eigen::Matrix3d frame;
    frame << TangentBasis(v), v;
    EXPECT_LT((frame.transpose() * frame - Eigen::Matrix3d::Identity()).norm(), 1e-14)
        << v.transpose();
    EXPECT_NEAR(frame.determinant(), 1.0, 1e-14) << v.transpose();
  }
}

TEST(UnitVector3, MovesByTheAngleOfTheStep) {
  const Eigen::Vector3d v = Eigen::Vector3d(1, -2, 0.5).normalized();
  const double d[2] = {0.3, 0.4};
  Eigen::Vector3d w;
  UnitVector3::Plus(v.data(), d, w.data());
  EXPECT_NEAR(std::acos(v.dot(w)), 0.5, 1e-14);
}

TEST(UnitQuaternion, PlusRotatesInTheRotatedFrame) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.2, -0.5, 0.7, 0.1).normalized();
  const Eigen::Vector3d w(0.3, -0.2, 0.9);
  Eigen::Vector4d moved;
  UnitQuaternion::Plus(q.coeffs().data(), w.data(), moved.data());
  const Eigen::Matrix3d expected =
      Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix() * q.toRotationMatrix();
  EXPECT_LT((Eigen::Quaterniond(moved).toRotationMatrix() - expected).norm(), 1e-14);
}

TEST(UnitQuaternion, OppositeQuaternionsAreOneRotation) {
  const Eigen::Vector4d q = Eigen::Vector4d(0.2, -0.5, 0.7, 0.1).normalized(), opposite = -q;
  Eigen::Vector3d d;
  UnitQuaternion::Minus(opposite.data(), q.data(), d.data());
  EXPECT_LT(d.norm(), 1e-14);
}

TEST(PoseManifold, TranslationMovesApartFromTheRotation) {
  const double x[7] = {0, 0, std::numbers::sqrt2 / 2, std::numbers::sqrt2 / 2, 1, 2, 3};
  const double d[6] = {0, 0, 0, 0.1, 0.2, 0.3};
  double y[7];
  PoseManifold::Plus(x, d, y);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(y[i], x[i], 1e-16);
  EXPECT_EQ(y[4], 1.1);
  EXPECT_EQ(y[5], 2.2);
  EXPECT_EQ(y[6], 3.3);
}

TEST(LineManifold, ThePointMovesAcrossTheLine) {
  const Eigen::Vector3d direction = Eigen::Vector3d(1, 2, -2).normalized();
  Vector6d x;
  x << direction, 4, 5, 6;
  const double d[4] = {0, 0, 0.3, -0.4};
  Vector6d y;
  LineManifold::Plus(x.data(), d, y.data());
  const Eigen::Vector3d moved = y.tail<3>() - x.tail<3>();
  EXPECT_NEAR(moved.dot(direction), 0.0, 1e-15);
  EXPECT_NEAR(moved.norm(), 0.5, 1e-15);
  EXPECT_LT((y.head<3>() - direction).norm(), 1e-15);
}

TEST(EuclideanOps, HaveTheirSizeFrom1To16) {
  for (int size = 1; size <= 16; ++size) {
    EXPECT_EQ(EuclideanOps(size).ambient, size);
    EXPECT_EQ(EuclideanOps(size).tangent, size);
  }
  EXPECT_EQ(&EuclideanOps(5), &OpsOf<Euclidean<5>>());
  EXPECT_THROW(EuclideanOps(0), CheckError);
  EXPECT_THROW(EuclideanOps(17), CheckError);
}

}  // namespace
}  // namespace holba
