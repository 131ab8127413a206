// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/p3p.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "holba/estimation/two_view/real_roots.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kMaxNewtonSteps = 6;
// Of the squared sides; what Newton's method leaves where it converges.
constexpr double kMaxResidualOfSides = 1e-6;
// A triangle whose height is smaller relative to its sides is a line.
constexpr double kMinSineOfTriangle = 1e-9;

// The side of the triangle between the points i and j.
struct Side {
  int i, j;
  double cosine;   // of the angle between the rays
  double squared;  // of the points' distance

  double Excess(const Vector3d& d) const {
    return d[i] * d[i] + d[j] * d[j] - 2.0 * cosine * d[i] * d[j];
  }
  Matrix3d Form() const {
    Matrix3d form = Matrix3d::Zero();
    form(i, i) = form(j, j) = 1.0;
    form(i, j) = form(j, i) = -cosine;
    return form;
  }
};
using Sides = std::array<Side, 3>;

Matrix3d Adjugate(const Matrix3d& m) {
  Matrix3d adjugate;
  adjugate.row(0) = m.col(1).cross(m.col(2));
  adjugate.row(1) = m.col(2).cross(m.col(0));
  adjugate.row(2) = m.col(0).cross(m.col(1));
  return adjugate;
}

// The two lines that a singular conic consists of (Richter-Gebert, Perspectives on Projective
// Geometry, 2011, section 11.1). False: they are not real.
bool Split(const Matrix3d& conic, std::array<Vector3d, 2>* lines) {
  const Matrix3d dual = Adjugate(conic);
  int k = 0;
  dual.diagonal().cwiseAbs().maxCoeff(&k);
  Matrix3d rank1 = conic;
  if (dual(k, k) < 0.0) {
    rank1 += CrossMatrix<double>(dual.col(k) / std::sqrt(-dual(k, k)));
  } else if (dual(k, k) > 1e-12 * conic.squaredNorm()) {
    return false;
  }
  int row = 0, col = 0;
  rank1.cwiseAbs().maxCoeff(&row, &col);
  (*lines)[0] = rank1.row(row).transpose();
  (*lines)[1] = rank1.col(col);
  return true;
}

// The singular conic of the pencil A + s B that is two real lines. `other`: a conic of the pencil
// that is another one.
bool FindSingular(const Matrix3d& A, const Matrix3d& B, Matrix3d* singular, Matrix3d* other) {
  const double cubic[4] = {A.determinant(), (Adjugate(A) * B).trace(), (Adjugate(B) * A).trace(),
                           B.determinant()};
  double roots[kMaxPolynomialDegree];
  const int num_roots = RealRoots(cubic, roots);
  double best = 1e-12;
  for (int k = 0; k < num_roots; ++k) {
    const Matrix3d conic = (A + roots[k] * B) / std::hypot(1.0, roots[k]);
    const double realness = -Adjugate(conic).trace() / conic.squaredNorm();
    if (!(realness > best)) continue;
    best = realness;
    *singular = conic;
    *other = std::abs(roots[k]) < 1.0 ? B : A;
  }
  return best > 1e-12;
}

// Improves distances. False: they do not fulfil the equations, or are not all positive.
bool Improve(const Sides& sides, Vector3d* d) {
  double scale = 0.0, excess = 0.0;
  for (const Side& side : sides) {
    scale += side.squared;
    excess += side.Excess(*d);
  }
  if (!(excess > 0.0)) return false;
  *d *= std::sqrt(scale / excess);
  double size = 0.0;
  for (int step = 0; step <= kMaxNewtonSteps; ++step) {
    Vector3d error;
    Matrix3d J = Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const Side& s = sides[k];
      error[k] = s.Excess(*d) - s.squared;
      J(k, s.i) = 2.0 * ((*d)[s.i] - s.cosine * (*d)[s.j]);
      J(k, s.j) = 2.0 * ((*d)[s.j] - s.cosine * (*d)[s.i]);
    }
    const double before = size;
    size = error.cwiseAbs().maxCoeff();
    if (!std::isfinite(size)) return false;
    if (size < 1e-15 * scale || step == kMaxNewtonSteps) break;
    if (step > 2 && size >= before) break;
    const Matrix3d adjugate = Adjugate(J);
    const double determinant = J.row(0).dot(adjugate.col(0));
    if (determinant == 0.0) break;
    *d -= adjugate * error / determinant;
  }
  return size <= kMaxResidualOfSides * scale && d->minCoeff() > 0.0;
}

}  // namespace

void SolveP3P(const std::array<Vector3d, 3>& rays, const std::array<Vector3d, 3>& points,
              std::vector<Rigid3d>* poses) {
  const Vector3d u = points[1] - points[0], v = points[2] - points[0];
  const Vector3d normal = u.cross(v);
  if (!(normal.norm() > kMinSineOfTriangle * u.norm() * v.norm())) return;
  Sides sides;
  for (int k = 0; k < 3; ++k) {
    const int i = k, j = (k + 1) % 3;
    sides[k] = {i, j, rays[i].dot(rays[j]), (points[i] - points[j]).squaredNorm()};
  }
  const double unit = (sides[0].squared + sides[1].squared + sides[2].squared) / 3.0;
  const auto without_constant = [&](int a, int b) -> Matrix3d {
    return (sides[b].squared * sides[a].Form() - sides[a].squared * sides[b].Form()) / unit;
  };
  Matrix3d singular, other;
  if (!FindSingular(without_constant(0, 1), without_constant(2, 1), &singular, &other)) return;
  std::array<Vector3d, 2> lines;
  if (!Split(singular, &lines)) return;

  Matrix3d world_frame;
  world_frame << u, v, normal;
  bool invertible = false;
  Matrix3d inverse_frame;
  world_frame.computeInverseWithCheck(inverse_frame, invertible, 0.0);
  if (!invertible) return;

  const size_t first = poses->size();
  for (const Vector3d& line : lines) {
    // d = a p + b q with p and q on the line.
    int k = 0;
    line.cwiseAbs().maxCoeff(&k);
    const Vector3d p = line.cross(Vector3d::Unit((k + 1) % 3)).normalized();
    const Vector3d q = line.cross(p).normalized();
    const double pp = p.dot(other * p), pq = p.dot(other * q), qq = q.dot(other * q);
    const double discriminant = pq * pq - pp * qq;
    // Where the line touches the conic, rounding decides the sign.
    if (!(discriminant > -1e-9 * (pq * pq + std::abs(pp * qq)))) continue;
    const double h = pq + std::copysign(std::sqrt(std::max(discriminant, 0.0)), pq);
    const std::array<Vector3d, 2> on_both = {h * p - pp * q, qq * p - h * q};
    for (const Vector3d& candidate : on_both) {
      Vector3d d = candidate.sum() < 0.0 ? -candidate : candidate;
      if (!(d.minCoeff() > -1e-6 * d.maxCoeff()) || !Improve(sides, &d)) continue;
      const Vector3d origin = d[0] * rays[0];
      const Vector3d cam_u = d[1] * rays[1] - origin, cam_v = d[2] * rays[2] - origin;
      Matrix3d cam_frame;
      cam_frame << cam_u, cam_v, cam_u.cross(cam_v);
      const Matrix3d R = cam_frame * inverse_frame;
      Rigid3d pose;
      pose.rotation = Eigen::Quaterniond(R).normalized();
      pose.translation = origin - pose.rotation * points[0];
      bool is_new = true;
      for (size_t i = first; i < poses->size(); ++i) {
        const Rigid3d& known = (*poses)[i];
        if (std::abs(known.rotation.dot(pose.rotation)) > 1.0 - 1e-14 &&
            (known.translation - pose.translation).squaredNorm() < 1e-14 * unit) {
          is_new = false;
        }
      }
      if (is_new && pose.translation.allFinite() && pose.rotation.coeffs().allFinite()) {
        poses->push_back(pose);
      }
    }
  }
}

}  // namespace holba
