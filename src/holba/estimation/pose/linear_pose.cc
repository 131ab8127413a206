// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/linear_pose.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "holba/base/check.h"
#include "holba/estimation/pose/quadrics.h"
#include "holba/geometry/angle.h"
#include "holba/geometry/manifold.h"

namespace holba {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Planes that meet in a line to this are no three planes (smallest singular value, unit normals).
constexpr double kMinSpread = 1e-6;
// Directions closer than this say too little of a rotation about them.
const double kMinSineOfDirections = std::sin(DegToRad(5.0));
constexpr int kMaxPlanes = 8;

// n . (R Y + t) = 0, of all features.
struct Planes {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMaxPlanes, 3> n;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMaxPlanes, 3> Y;
};

Planes PlanesOf(std::span<const SeenPoint> points, std::span<const SeenLine> lines,
                const Vector3d& origin) {
  Planes planes;
  const auto count = static_cast<Eigen::Index>(2 * points.size() + lines.size());
  HOLBA_CHECK(count <= kMaxPlanes);
  planes.n.resize(count, 3);
  planes.Y.resize(count, 3);
  Eigen::Index row = 0;
  for (const SeenPoint& point : points) {
    const Eigen::Matrix<double, 3, 2> across = TangentBasis(point.ray);
    for (int k = 0; k < 2; ++k) {
      planes.n.row(row) = across.col(k).transpose();
      planes.Y.row(row++) = (point.X - origin).transpose();
    }
  }
  for (const SeenLine& line : lines) {
    planes.n.row(row) = line.normal.transpose();
    planes.Y.row(row++) = (line.line.ClosestPoint(origin) - origin).transpose();
  }
  return planes;
}

// The features' middle: numbers are small about it.
Vector3d OriginOf(std::span<const SeenPoint> points, std::span<const SeenLine> lines) {
  Vector3d sum = Vector3d::Zero();
  for (const SeenPoint& point : points) sum += point.X;
  if (!points.empty()) return sum / static_cast<double>(points.size());
  for (const SeenLine& line : lines) sum += line.line.Foot();
  return sum / static_cast<double>(lines.size());
}

Eigen::VectorXd RightHandSide(const Planes& planes, const Matrix3d& R) {
  return -(planes.n.array() * (planes.Y * R.transpose()).array()).rowwise().sum();
}

// sum_ij A_ij R_ij (1 + s's) as a quadric in s.
Quadric InCayley(const Matrix3d& A) {
  const double trace = A.trace();
  return {2.0 * A(0, 0) - trace,     2.0 * A(1, 1) - trace,
          2.0 * A(2, 2) - trace,     2.0 * (A(0, 1) + A(1, 0)),
          2.0 * (A(0, 2) + A(2, 0)), 2.0 * (A(1, 2) + A(2, 1)),
          2.0 * (A(2, 1) - A(1, 2)), 2.0 * (A(0, 2) - A(2, 0)),
          2.0 * (A(1, 0) - A(0, 1)), trace};
}

}  // namespace

void SolvePointsAndLines(std::span<const SeenPoint> points, std::span<const SeenLine> lines,
                         const Eigen::Quaterniond& turn, std::vector<Rigid3d>* poses) {
  HOLBA_CHECK(points.size() + lines.size() == 3 && !lines.empty());
  const Vector3d origin = OriginOf(points, lines);
  const Planes planes = PlanesOf(points, lines, origin);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(planes.n, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[2] > kMinSpread)) return;

  // Equations sum_ij A_ij R_ij = 0: those of the lines' directions, and the combinations of planes
  // that t has no part in.
  std::array<Quadric, 3> quadrics;
  size_t count = 0;
  const Matrix3d turn_back = turn.normalized().toRotationMatrix().transpose();
  for (const SeenLine& line : lines)
    quadrics[count++] = InCayley(line.normal * line.line.direction.transpose() * turn_back);
  for (Eigen::Index k = 3; k < planes.n.rows(); ++k) {
    const Eigen::VectorXd weights = svd.matrixU().col(k);
    const Matrix3d A = planes.n.transpose() * weights.asDiagonal() * planes.Y;
    quadrics[count++] = InCayley(A * turn_back);
  }
  HOLBA_CHECK(count == 3);

  std::vector<Vector3d> cayleys;
  IntersectQuadrics(quadrics, &cayleys);
  for (const Vector3d& s : cayleys) {
    Rigid3d pose;
    pose.rotation = (Eigen::Quaterniond(1.0, s.x(), s.y(), s.z()).normalized() * turn.normalized())
                        .normalized();
    const Vector3d t = svd.solve(RightHandSide(planes, pose.RotationMatrix()));
    pose.translation = t - pose.rotation * origin;
    if (pose.translation.allFinite()) poses->push_back(pose);
  }
}

std::optional<Vector3d> SolveTranslation(const Eigen::Quaterniond& rotation,
                                         std::span<const SeenPoint> points,
                                         std::span<const SeenLine> lines) {
  const Vector3d origin = OriginOf(points, lines);
  const Planes planes = PlanesOf(points, lines, origin);
  if (planes.n.rows() < 3) return std::nullopt;
  const Matrix3d R = rotation.normalized().toRotationMatrix();
  const Matrix3d normal = planes.n.transpose() * planes.n;
  if (!(std::abs(normal.determinant()) > kMinSpread * kMinSpread)) return std::nullopt;
  const Vector3d t = normal.inverse() * (planes.n.transpose() * RightHandSide(planes, R));
  if (!t.allFinite()) return std::nullopt;
  return Vector3d(t - R * origin);
}

void SolveRotation(const Vector3d& a_in_cam, const Vector3d& b_in_cam, const Vector3d& a_in_world,
                   const Vector3d& b_in_world, double max_angle_error,
                   std::vector<Eigen::Quaterniond>* rotations) {
  if (a_in_cam.cross(b_in_cam).norm() < kMinSineOfDirections ||
      a_in_world.cross(b_in_world).norm() < kMinSineOfDirections)
    return;
  // Bisectors: both directions have the same part in the frame.
  const auto frame = [](const Vector3d& a, const Vector3d& b) {
    Matrix3d F;
    F.col(0) = (a + b).normalized();
    F.col(1) = (a - b).normalized();
    F.col(2) = F.col(0).cross(F.col(1));
    return F;
  };
  const auto angle = [](const Vector3d& a, const Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
  };
  const Matrix3d in_world = frame(a_in_world, b_in_world);
  const double angle_in_world = angle(a_in_world, b_in_world);
  for (double sign_a : {1.0, -1.0}) {
    for (double sign_b : {1.0, -1.0}) {
      const Vector3d a = sign_a * a_in_cam, b = sign_b * b_in_cam;
      if (std::abs(angle(a, b) - angle_in_world) > max_angle_error) continue;
      rotations->push_back(
          Eigen::Quaterniond(Matrix3d(frame(a, b) * in_world.transpose())).normalized());
    }
  }
}

}  // namespace holba
