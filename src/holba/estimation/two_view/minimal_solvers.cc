// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/minimal_solvers.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <array>
#include <cmath>

#include "holba/base/check.h"
#include "holba/estimation/two_view/real_roots.h"

namespace holba {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Share of the largest pivot below which a matrix has no inverse that means anything.
constexpr double kSingular = 1e-10;

// Orthonormal matrices X (row by row, as columns) with r2' X r1 = 0 for all N matches; false: there
// are more of them.
template <int N>
bool EpipolarNullSpace(Rays rays1, Rays rays2, Eigen::Matrix<double, 9, 9 - N>* basis) {
  Eigen::Matrix<double, 9, N> transposed;
  for (int i = 0; i < N; ++i) {
    const Eigen::Vector3d r1 = rays1[i].normalized(), r2 = rays2[i].normalized();
    transposed.col(i) << r2.x() * r1, r2.y() * r1, r2.z() * r1;
  }
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 9, N>> qr(transposed);
  const double last = std::abs(qr.matrixR()(N - 1, N - 1));
  if (!(last > kSingular * std::abs(qr.matrixR()(0, 0)))) return false;
  Eigen::Matrix<double, 9, 9 - N> unit = Eigen::Matrix<double, 9, 9 - N>::Zero();
  unit.template bottomRows<9 - N>().setIdentity();
  *basis = qr.householderQ() * unit;
  return true;
}

// Polynomials in x, y, z. Of degree 1: x, y, z, 1; of degree 2 and 3 in the orders that follow.
using Linear = Eigen::Vector4d;
// xx xy xz x yy yz y zz z 1
using Quadratic = Eigen::Matrix<double, 10, 1>;
// xxx yyy xxy xyy xxz xx yyz yy xyz xy | xzz xz x yzz yz y zzz zz z 1
using Cubic = Eigen::Matrix<double, 20, 1>;

Quadratic Product(const Linear& a, const Linear& b) {
  Quadratic p;
  p << a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0], a[0] * b[3] + a[3] * b[0],
      a[1] * b[1], a[1] * b[2] + a[2] * b[1], a[1] * b[3] + a[3] * b[1], a[2] * b[2],
      a[2] * b[3] + a[3] * b[2], a[3] * b[3];
  return p;
}

// Index in Cubic of the product of Quadratic's monomial and Linear's.
constexpr int kCubicIdx[10][4] = {
    {0, 2, 4, 5},      // xx
    {2, 3, 8, 9},      // xy
    {4, 8, 10, 11},    // xz
    {5, 9, 11, 12},    // x
    {3, 1, 6, 7},      // yy
    {8, 6, 13, 14},    // yz
    {9, 7, 14, 15},    // y
    {10, 13, 16, 17},  // zz
    {11, 14, 17, 18},  // z
    {12, 15, 18, 19},  // 1
};

void AddProduct(const Quadratic& q, const Linear& l, double sign, Cubic* sum) {
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) (*sum)[kCubicIdx[i][j]] += sign * q[i] * l[j];
  }
}

using Constraints = Eigen::Matrix<double, 10, 20, Eigen::RowMajor>;

// det E = 0 and 2 E E'E - trace(E E') E = 0 for E = x X + y Y + z Z + W.
Constraints EssentialConstraints(const Eigen::Matrix<double, 9, 4>& basis) {
  const auto entry = [&](int i, int j) -> Linear { return basis.row(3 * i + j).transpose(); };
  std::array<Linear, 9> E;
  for (int k = 0; k < 9; ++k) E[k] = entry(k / 3, k % 3);
  Constraints rows;

  const auto minor = [&](int a, int b, int c, int d) -> Quadratic {
    return Product(E[a], E[b]) - Product(E[c], E[d]);
  };
  Cubic determinant = Cubic::Zero();
  AddProduct(minor(4, 8, 5, 7), E[0], 1.0, &determinant);
  AddProduct(minor(3, 8, 5, 6), E[1], -1.0, &determinant);
  AddProduct(minor(3, 7, 4, 6), E[2], 1.0, &determinant);
  rows.row(9) = determinant.transpose();

  // A = E E' - 0.5 trace(E E') I, symmetric: A E = 0.
  std::array<Quadratic, 9> A;
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      A[3 * i + j] = Product(E[3 * i], E[3 * j]) + Product(E[3 * i + 1], E[3 * j + 1]) +
                     Product(E[3 * i + 2], E[3 * j + 2]);
      A[3 * j + i] = A[3 * i + j];
    }
  }
  const Quadratic half_trace = 0.5 * (A[0] + A[4] + A[8]);
  for (int k : {0, 4, 8}) A[k] -= half_trace;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      Cubic sum = Cubic::Zero();
      for (int k = 0; k < 3; ++k) AddProduct(A[3 * i + k], E[3 * k + j], 1.0, &sum);
      rows.row(3 * i + j) = sum.transpose();
    }
  }
  return rows;
}

// Gauss-Jordan with pivots by rows: the first 10 columns become the identity; what is right of it
// is all that is meaningful after it, in the last 6 rows. False: they have no inverse.
bool Eliminate(Constraints* m) {
  for (int c = 0; c < 10; ++c) {
    int pivot = c;
    for (int r = c + 1; r < 10; ++r) {
      if (std::abs((*m)(r, c)) > std::abs((*m)(pivot, c))) pivot = r;
    }
    if (!(std::abs((*m)(pivot, c)) > 1e-14)) return false;
    if (pivot != c) m->row(pivot).swap(m->row(c));
    const double inverse = 1.0 / (*m)(c, c);
    for (int k = c; k < 20; ++k) (*m)(c, k) *= inverse;
    // Rows above are used only from the fifth on.
    for (int r = c < 4 ? c + 1 : 4; r < 10; ++r) {
      if (r == c) continue;
      const double factor = (*m)(r, c);
      if (factor == 0.0) continue;
      for (int k = c; k < 20; ++k) (*m)(r, k) -= factor * (*m)(c, k);
    }
  }
  return true;
}

template <int N>
using Polynomial = std::array<double, N + 1>;  // of degree N in z, the constant first

template <int A, int B>
Polynomial<A + B> Multiply(const Polynomial<A>& a, const Polynomial<B>& b) {
  Polynomial<A + B> product{};
  for (int i = 0; i <= A; ++i) {
    for (int j = 0; j <= B; ++j) product[i + j] += a[i] * b[j];
  }
  return product;
}
template <size_t Size>
std::array<double, Size> Minus(const std::array<double, Size>& a,
                               const std::array<double, Size>& b) {
  std::array<double, Size> difference;
  for (size_t i = 0; i < Size; ++i) difference[i] = a[i] - b[i];
  return difference;
}
template <size_t Size>
double At(const std::array<double, Size>& p, double z) {
  double value = 0.0;
  for (size_t i = Size; i > 0; --i) value = value * z + p[i - 1];
  return value;
}

// The row of x (a) y (b) 1 (c) = 0 with polynomials in z: row `upper` minus z times row `lower`,
// whose leading monomials cancel.
struct HiddenRow {
  Polynomial<3> x, y;
  Polynomial<4> one;
};
HiddenRow Hide(const Constraints& m, int upper) {
  const auto u = [&](int k) { return m(upper, k); };
  const auto l = [&](int k) { return m(upper + 1, k); };
  return {.x = {u(12), u(11) - l(12), u(10) - l(11), -l(10)},
          .y = {u(15), u(14) - l(15), u(13) - l(14), -l(13)},
          .one = {u(19), u(18) - l(19), u(17) - l(18), u(16) - l(17), -l(16)}};
}

bool AppendNormalised(const Eigen::Matrix3d& M, std::vector<Eigen::Matrix3d>* solutions) {
  const double norm = M.norm();
  if (!(norm > 0.0) || !std::isfinite(norm)) return false;
  solutions->push_back(M / norm);
  return true;
}

}  // namespace

void SolveEssential(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions) {
  HOLBA_CHECK(rays1.size() == 5 && rays2.size() == 5);
  Eigen::Matrix<double, 9, 4> basis;
  if (!EpipolarNullSpace<5>(rays1, rays2, &basis)) return;
  Constraints m = EssentialConstraints(basis);
  if (!Eliminate(&m)) return;

  // Rows 4 and 5 begin with xxz and xx, 6 and 7 with yyz and yy, 8 and 9 with xyz and xy.
  const HiddenRow a = Hide(m, 4), b = Hide(m, 6), c = Hide(m, 8);
  const auto of_x = Minus(Multiply<3, 4>(b.y, c.one), Multiply<3, 4>(c.y, b.one));
  const auto of_y = Minus(Multiply<3, 4>(b.x, c.one), Multiply<3, 4>(c.x, b.one));
  const auto of_one = Minus(Multiply<3, 3>(b.x, c.y), Multiply<3, 3>(c.x, b.y));
  Polynomial<10> determinant = Minus(Multiply<3, 7>(a.x, of_x), Multiply<3, 7>(a.y, of_y));
  const auto last = Multiply<4, 6>(a.one, of_one);
  for (int k = 0; k <= 10; ++k) determinant[k] += last[k];

  std::array<double, kMaxPolynomialDegree> roots;
  const int num_roots = RealRoots(determinant, roots.data());
  for (int i = 0; i < num_roots; ++i) {
    const double z = roots[i];
    // (x, y, 1) is the null vector of the three rows: the largest of their cross products.
    const Eigen::Vector3d r0(At(a.x, z), At(a.y, z), At(a.one, z));
    const Eigen::Vector3d r1(At(b.x, z), At(b.y, z), At(b.one, z));
    const Eigen::Vector3d r2(At(c.x, z), At(c.y, z), At(c.one, z));
    Eigen::Vector3d null = r0.cross(r1);
    for (const Eigen::Vector3d& other : {r0.cross(r2), r1.cross(r2)}) {
      if (other.squaredNorm() > null.squaredNorm()) null = other;
    }
    if (null.z() == 0.0) continue;
    const Eigen::Matrix<double, 9, 1> E = basis.col(0) * (null.x() / null.z()) +
                                          basis.col(1) * (null.y() / null.z()) + basis.col(2) * z +
                                          basis.col(3);
    AppendNormalised(Eigen::Map<const RowMajor3>(E.data()), solutions);
  }
}

void SolveFundamental(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions) {
  HOLBA_CHECK(rays1.size() == 7 && rays2.size() == 7);
  Eigen::Matrix<double, 9, 2> basis;
  if (!EpipolarNullSpace<7>(rays1, rays2, &basis)) return;
  const Eigen::Matrix3d A = Eigen::Map<const RowMajor3>(basis.col(0).data());
  const Eigen::Matrix3d B = Eigen::Map<const RowMajor3>(basis.col(1).data());
  // det(x A + B), a cubic in x: the mixed terms are sums of determinants with columns exchanged.
  const auto mixed = [](const Eigen::Matrix3d& M, const Eigen::Matrix3d& N) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
      Eigen::Matrix3d exchanged = M;
      exchanged.col(k) = N.col(k);
      sum += exchanged.determinant();
    }
    return sum;
  };
  const std::array<double, 4> cubic = {B.determinant(), mixed(B, A), mixed(A, B), A.determinant()};
  std::array<double, kMaxPolynomialDegree> roots;
  const int num_roots = RealRoots(cubic, roots.data());
  for (int i = 0; i < num_roots; ++i) AppendNormalised(roots[i] * A + B, solutions);
}

void SolveHomography(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* solutions) {
  HOLBA_CHECK(rays1.size() == 4 && rays2.size() == 4);
  // The rays of each side as images of the frame (1,0,0), (0,1,0), (0,0,1), (1,1,1).
  std::array<Eigen::Matrix3d, 2> from_frame;
  std::array<Eigen::Vector3d, 2> factors;
  for (int side = 0; side < 2; ++side) {
    const Rays rays = side == 0 ? rays1 : rays2;
    Eigen::Matrix3d M;
    for (int k = 0; k < 3; ++k) M.col(k) = rays[k].normalized();
    const double determinant = M.determinant();
    if (!(std::abs(determinant) > kSingular)) return;
    factors[side] = M.inverse() * rays[3].normalized();
    // Three with the fourth in a plane.
    if (!(factors[side].cwiseAbs().minCoeff() > kSingular)) return;
    from_frame[side] = M * factors[side].asDiagonal();
  }
  if (!((factors[0].array() * factors[1].array()).minCoeff() > 0.0)) return;
  AppendNormalised(from_frame[1] * from_frame[0].inverse(), solutions);
}

}  // namespace holba
