// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_proposals.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <complex>
#include <limits>

namespace holba {
namespace {

// A line seen under a smaller sine is seen end on: its rays do not cross it.
constexpr double kMinRaySine = 1e-3;

std::optional<RayLengths> InFront(double start, double end) {
  if (!(start > 0.0) || !(end > 0.0) || !std::isfinite(start) || !std::isfinite(end))
    return std::nullopt;
  return RayLengths{start, end};
}

}  // namespace

std::optional<RayLengths> ProposeOnPlane(const SegmentPlane& segment, const Eigen::Vector4d& plane,
                                         double min_sine) {
  const Eigen::Vector3d n = plane.head<3>();
  const double s = n.dot(segment.ray_start), e = n.dot(segment.ray_end);
  if (!(std::abs(s) >= min_sine) || !(std::abs(e) >= min_sine)) return std::nullopt;
  const double height = -(n.dot(segment.centre) + plane[3]);
  return InFront(height / s, height / e);
}

std::optional<RayLengths> ProposeOnLine(const SegmentPlane& segment, const Eigen::Vector3d& point,
                                        const Eigen::Vector3d& direction) {
  // In the segment's plane, perpendicular to the line.
  const Eigen::Vector3d q = segment.normal.cross(direction);
  const double size = q.norm();
  if (!(size > kMinRaySine * direction.norm())) return std::nullopt;
  const double s = q.dot(segment.ray_start), e = q.dot(segment.ray_end);
  if (!(std::abs(s) > kMinRaySine * size) || !(std::abs(e) > kMinRaySine * size))
    return std::nullopt;
  const double distance = q.dot(point - segment.centre);
  return InFront(distance / s, distance / e);
}

std::optional<RayLengths> ProposeThroughPoints(const SegmentPlane& segment,
                                               std::span<const Eigen::Vector3d> points) {
  if (points.size() < 2) return std::nullopt;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) mean += X;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& X : points) scatter += (X - mean) * (X - mean).transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(scatter);
  if (!(eigen.eigenvalues()[2] > 0.0)) return std::nullopt;
  return ProposeOnLine(segment, mean, eigen.eigenvectors().col(2));
}

std::optional<RayLengths> ProposeThroughPoint(const SegmentPlane& segment,
                                              const Eigen::Vector3d& point,
                                              const SegmentPlane& other) {
  const Eigen::Vector3d offset = point - segment.centre;
  const Eigen::Vector3d p = offset - segment.normal.dot(offset) * segment.normal;
  const double distance = p.norm();
  if (!(distance > 0.0)) return std::nullopt;
  // Lengths in units of the point's distance; 2D cross products in the segment's plane.
  const Eigen::Vector3d unit = p / distance;
  const auto cross = [&](const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    return segment.normal.dot(u.cross(v));
  };
  const double a = cross(segment.ray_start, segment.ray_end);
  const double b = cross(segment.ray_start, unit);
  const double c = cross(segment.ray_end, unit);
  const double g1 = other.normal.dot(segment.ray_start), g2 = other.normal.dot(segment.ray_end);
  const double alpha = other.normal.dot(segment.centre - other.centre) / distance;
  // The ends are collinear with the point where length2 = b length1 / (a length1 + c). Of
  // (g1 length1 + alpha)^2 + (g2 length2 + alpha)^2 the stationary points are the roots of
  //   g1 (g1 x + alpha)(a x + c)^3 + g2 b c ((g2 b + alpha a) x + alpha c), x = length1.
  // Coefficients by power.
  const double cube[4] = {c * c * c, 3 * a * c * c, 3 * a * a * c, a * a * a};
  std::array<double, 5> k{};
  for (int i = 0; i < 4; ++i) {
    k[i] += g1 * alpha * cube[i];
    k[i + 1] += g1 * g1 * cube[i];
  }
  k[0] += g2 * b * c * alpha * c;
  k[1] += g2 * b * c * (g2 * b + alpha * a);
  int degree = 4;
  double largest = 0.0;
  for (double value : k) largest = std::max(largest, std::abs(value));
  while (degree > 0 && !(std::abs(k[degree]) > 1e-13 * largest)) --degree;
  if (degree == 0) return std::nullopt;
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  for (int i = 0; i < degree; ++i) companion(0, i) = -k[degree - 1 - i] / k[degree];
  for (int i = 1; i < degree; ++i) companion(i, i - 1) = 1.0;
  const Eigen::VectorXcd roots =
      Eigen::EigenSolver<Eigen::MatrixXd>(companion, false).eigenvalues();
  double best = std::numeric_limits<double>::infinity();
  std::optional<RayLengths> result;
  for (int i = 0; i < degree; ++i) {
    if (std::abs(roots[i].imag()) > 1e-6 * std::abs(roots[i])) continue;
    const double x = roots[i].real(), y = b * x / (a * x + c);
    const double start = g1 * x + alpha, end = g2 * y + alpha;
    const double cost = start * start + end * end;
    const std::optional<RayLengths> lengths = InFront(x * distance, y * distance);
    if (!lengths || !(cost < best)) continue;
    best = cost;
    result = lengths;
  }
  return result;
}

std::optional<RayLengths> ProposeAlong(const SegmentPlane& segment,
                                       const Eigen::Vector3d& direction,
                                       const SegmentPlane& other) {
  const Eigen::Vector3d q = segment.normal.cross(direction);
  const double size = q.norm();
  if (!(size > kMinRaySine * direction.norm())) return std::nullopt;
  const double s = q.dot(segment.ray_start) / size, e = q.dot(segment.ray_end) / size;
  if (!(std::abs(s) > kMinRaySine) || !(std::abs(e) > kMinRaySine)) return std::nullopt;
  // Both ends on the line: length_end = length_start s / e.
  const double ratio = s / e;
  const double height = other.normal.dot(other.centre - segment.centre);
  const double c1 = other.normal.dot(segment.ray_start);
  const double c2 = other.normal.dot(segment.ray_end) * ratio;
  const double square = c1 * c1 + c2 * c2;
  if (!(square > 0.0)) return std::nullopt;
  const double start = (c1 + c2) * height / square;
  return InFront(start, start * ratio);
}

}  // namespace holba
