// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/quadrics.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "holba/estimation/two_view/real_roots.h"

namespace holba {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kMaxDegree = 8;
constexpr int kNewtonSteps = 5;
// Of quadrics of norm 1 where |(1, x, y, z)| is a unit.
constexpr double kMaxResidualOfQuadrics = 1e-9;

// sum_k c[k] z^k up to a fixed degree; terms that are always 0 are multiplied, too.
template <int N>
struct Polynomial {
  std::array<double, N + 1> c{};

  double At(double z) const {
    double value = 0.0;
    for (int k = N; k >= 0; --k) value = value * z + c[k];
    return value;
  }
};
template <int N, int M>
Polynomial<N + M> operator*(const Polynomial<N>& a, const Polynomial<M>& b) {
  Polynomial<N + M> product;
  for (int i = 0; i <= N; ++i) {
    for (int j = 0; j <= M; ++j) product.c[i + j] += a.c[i] * b.c[j];
  }
  return product;
}
template <int N, int M>
Polynomial<std::max(N, M)> operator+(const Polynomial<N>& a, const Polynomial<M>& b) {
  Polynomial<std::max(N, M)> sum;
  for (int i = 0; i <= N; ++i) sum.c[i] += a.c[i];
  for (int j = 0; j <= M; ++j) sum.c[j] += b.c[j];
  return sum;
}
template <int N>
Polynomial<N> operator*(double s, Polynomial<N> a) {
  for (double& c : a.c) c *= s;
  return a;
}
template <int N, int M>
Polynomial<std::max(N, M)> operator-(const Polynomial<N>& a, const Polynomial<M>& b) {
  return a + (-1.0) * b;
}

// Where the squares, the products with the hidden variable and the rest stand if the variables are
// x = variables[0], y = variables[1], z = variables[2] (0 x, 1 y, 2 z).
struct Order {
  int x2, y2, z2, xy, xz, yz, x, y, z;
};
Order OrderOf(const std::array<int, 3>& v) {
  const auto mixed = [](int a, int b) { return 2 + a + b; };  // xy 3, xz 4, yz 5
  return {v[0],     v[1],     v[2],    mixed(v[0], v[1]), mixed(v[0], v[2]), mixed(v[1], v[2]),
          6 + v[0], 6 + v[1], 6 + v[2]};
}

double ValueOf(const Quadric& q, const Vector3d& p) {
  return q[0] * p.x() * p.x() + q[1] * p.y() * p.y() + q[2] * p.z() * p.z() + q[3] * p.x() * p.y() +
         q[4] * p.x() * p.z() + q[5] * p.y() * p.z() + q[6] * p.x() + q[7] * p.y() + q[8] * p.z() +
         q[9];
}
Vector3d GradientOf(const Quadric& q, const Vector3d& p) {
  return {2.0 * q[0] * p.x() + q[3] * p.y() + q[4] * p.z() + q[6],
          2.0 * q[1] * p.y() + q[3] * p.x() + q[5] * p.z() + q[7],
          2.0 * q[2] * p.z() + q[4] * p.x() + q[5] * p.y() + q[8]};
}

bool Improve(const std::array<Quadric, 3>& quadrics, Vector3d* p) {
  for (int step = 0; step <= kNewtonSteps; ++step) {
    Vector3d value;
    Matrix3d J;
    for (int k = 0; k < 3; ++k) {
      value[k] = ValueOf(quadrics[k], *p);
      J.row(k) = GradientOf(quadrics[k], *p);
    }
    const double unit = 1.0 + p->squaredNorm();
    const double error = value.cwiseAbs().maxCoeff();
    if (error < 1e-15 * unit) return true;
    if (step == kNewtonSteps) return error < kMaxResidualOfQuadrics * unit;
    const Vector3d move = J.inverse() * value;
    if (!move.allFinite()) return error < kMaxResidualOfQuadrics * unit;
    *p -= move;
  }
  return false;
}

}  // namespace

void IntersectQuadrics(const std::array<Quadric, 3>& given, std::vector<Vector3d>* points) {
  std::array<Quadric, 3> quadrics = given;
  for (Quadric& q : quadrics) {
    const double norm = Eigen::Map<const Eigen::Matrix<double, 10, 1>>(q.data()).norm();
    if (!(norm > 0.0)) return;
    for (double& c : q) c /= norm;
  }
  // The variable is hidden without which the quadrics are best told apart.
  std::array<int, 3> variables{};
  double best = 0.0;
  for (const std::array<int, 3>& candidate :
       {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 1}, std::array<int, 3>{1, 2, 0}}) {
    const Order o = OrderOf(candidate);
    Matrix3d A;
    for (int k = 0; k < 3; ++k) A.row(k) << quadrics[k][o.x2], quadrics[k][o.xy], quadrics[k][o.y2];
    if (!(std::abs(A.determinant()) > best)) continue;
    best = std::abs(A.determinant());
    variables = candidate;
  }
  if (!(best > 1e-14)) return;

  const Order o = OrderOf(variables);
  Matrix3d A, by_z, constant;  // columns: x, y, 1
  Vector3d by_z2;
  for (int k = 0; k < 3; ++k) {
    const Quadric& q = quadrics[k];
    A.row(k) << q[o.x2], q[o.xy], q[o.y2];
    by_z.row(k) << q[o.xz], q[o.yz], q[o.z];
    constant.row(k) << q[o.x], q[o.y], q[9];
    by_z2[k] = q[o.z2];
  }
  const Matrix3d inverse = -A.inverse();
  by_z = inverse * by_z;
  constant = inverse * constant;
  by_z2 = inverse * by_z2;
  // x^2 = p[0] . (x, y, 1), xy = p[1] . (x, y, 1), y^2 = p[2] . (x, y, 1).
  Polynomial<1> px[3], py[3];
  Polynomial<2> p1[3];
  for (int k = 0; k < 3; ++k) {
    px[k].c = {constant(k, 0), by_z(k, 0)};
    py[k].c = {constant(k, 1), by_z(k, 1)};
    p1[k].c = {constant(k, 2), by_z(k, 2), by_z2[k]};
  }
  // y (x^2) - x (xy), x (y^2) - y (xy) and (xy)^2 - x^2 y^2, each over (x, y, 1).
  const auto a1 = px[0] - py[1], b1 = py[0], c1 = px[1];
  const Polynomial<2> m00 = a1 * px[1] + b1 * px[2] - c1 * px[0] - p1[1];
  const Polynomial<2> m01 = a1 * py[1] + b1 * py[2] - c1 * py[0] + p1[0];
  const Polynomial<3> m02 = a1 * p1[1] + b1 * p1[2] - c1 * p1[0];
  const auto a2 = py[2] - px[1], b2 = px[2], c2 = py[1];
  const Polynomial<2> m10 = a2 * px[1] + b2 * px[0] - c2 * px[2] + p1[2];
  const Polynomial<2> m11 = a2 * py[1] + b2 * py[0] - c2 * py[2] - p1[1];
  const Polynomial<3> m12 = a2 * p1[1] + b2 * p1[0] - c2 * p1[2];
  const auto x2 = px[1] * px[1] - px[0] * px[2], y2 = py[1] * py[1] - py[0] * py[2];
  const auto xy = 2.0 * (px[1] * py[1]) - px[0] * py[2] - py[0] * px[2];
  const Polynomial<3> m20 =
      x2 * px[0] + xy * px[1] + y2 * px[2] + 2.0 * (px[1] * p1[1]) - px[0] * p1[2] - p1[0] * px[2];
  const Polynomial<3> m21 =
      x2 * py[0] + xy * py[1] + y2 * py[2] + 2.0 * (py[1] * p1[1]) - py[0] * p1[2] - p1[0] * py[2];
  const Polynomial<4> m22 = x2 * p1[0] + xy * p1[1] + y2 * p1[2] + p1[1] * p1[1] - p1[0] * p1[2];
  const Polynomial<8> determinant =
      m20 * (m01 * m12 - m02 * m11) + m21 * (m02 * m10 - m00 * m12) + m22 * (m00 * m11 - m01 * m10);

  double roots[kMaxPolynomialDegree];
  const int num_roots = RealRoots(determinant.c, roots);
  for (int k = 0; k < num_roots && k < kMaxDegree; ++k) {
    const double z = roots[k];
    Matrix3d M;
    M << m00.At(z), m01.At(z), m02.At(z), m10.At(z), m11.At(z), m12.At(z), m20.At(z), m21.At(z),
        m22.At(z);
    // (x, y, 1) is orthogonal to all rows: the product of the two that tell most.
    Vector3d null = Vector3d::Zero();
    for (int row = 0; row < 3; ++row) {
      M.row(row).normalize();
      for (int other = 0; other < row; ++other) {
        const Vector3d product = M.row(row).transpose().cross(M.row(other).transpose());
        if (product.squaredNorm() > null.squaredNorm()) null = product;
      }
    }
    if (!(std::abs(null.z()) > 0.0)) continue;
    Vector3d point;
    point[variables[0]] = null.x() / null.z();
    point[variables[1]] = null.y() / null.z();
    point[variables[2]] = z;
    if (point.allFinite() && Improve(quadrics, &point)) points->push_back(point);
  }
}

}  // namespace holba
