// SPDX-License-Identifier: BSD-3-Clause
#include "holba/group/fit.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "holba/geometry/manifold.h"

namespace holba {

std::optional<NormalizedPoints> NormalizePoints(std::span<const Eigen::Vector3d> points) {
  if (points.empty()) return std::nullopt;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) centroid += X;
  centroid /= static_cast<double>(points.size());
  double sum = 0.0;
  for (const Eigen::Vector3d& X : points) sum += (X - centroid).squaredNorm();
  const double scale = std::sqrt(sum / static_cast<double>(points.size()));
  if (!std::isfinite(scale) || scale <= 1e-14 * centroid.norm() || scale == 0.0) {
    return std::nullopt;
  }
  NormalizedPoints normalized;
  normalized.original_from_normalized.scale = scale;
  normalized.original_from_normalized.translation = centroid;
  normalized.points.reserve(points.size());
  for (const Eigen::Vector3d& X : points) normalized.points.push_back((X - centroid) / scale);
  return normalized;
}

std::vector<Eigen::Vector3d> EverySoMany(std::span<const Eigen::Vector3d> points, size_t max_num) {
  if (points.size() <= max_num) return {points.begin(), points.end()};
  std::vector<Eigen::Vector3d> chosen(max_num);
  for (size_t i = 0; i < max_num; ++i) chosen[i] = points[i * points.size() / max_num];
  return chosen;
}

PrincipalAxes PrincipalAxesOf(std::span<const Eigen::Vector3d> points) {
  PrincipalAxes result;
  result.centroid.setZero();
  for (const Eigen::Vector3d& X : points) result.centroid += X;
  result.centroid /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& X : points) {
    const Eigen::Vector3d u = X - result.centroid;
    scatter += u * u.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter /
                                                             static_cast<double>(points.size()));
  result.variances = eigen.eigenvalues();
  result.axes = eigen.eigenvectors();
  result.axes.col(2) = result.axes.col(0).cross(result.axes.col(1));
  return result;
}

Eigen::Vector3d CentreOf(std::span<const Eigen::Vector3d> points,
                         std::span<const PlueckerLine> lines) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) mean += X;
  for (const PlueckerLine& line : lines) mean += line.Foot();
  mean /= static_cast<double>(points.size() + lines.size());
  Eigen::Matrix3d A = static_cast<double>(points.size()) * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& X : points) b += X - mean;
  for (const PlueckerLine& line : lines) {
    const Eigen::Vector3d d = line.direction.normalized();
    A += Eigen::Matrix3d::Identity() - d * d.transpose();
    b += line.ClosestPoint(mean) - mean;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
  Eigen::Vector3d centre = mean;
  for (int i = 0; i < 3; ++i) {
    if (eigen.eigenvalues()[i] <= 1e-9 * eigen.eigenvalues()[2]) continue;
    const Eigen::Vector3d axis = eigen.eigenvectors().col(i);
    centre += axis * (axis.dot(b) / eigen.eigenvalues()[i]);
  }
  return centre;
}

std::optional<Eigen::Vector4d> FitPlane(std::span<const Eigen::Vector3d> points,
                                        std::span<const PlueckerLine> lines) {
  if (points.size() + 2 * lines.size() < 3) return std::nullopt;
  const Eigen::Vector3d centre = CentreOf(points, lines);
  std::vector<Eigen::Vector3d> samples(points.begin(), points.end());
  for (const PlueckerLine& line : lines) samples.push_back(line.ClosestPoint(centre));
  double sum = 0.0;
  for (const Eigen::Vector3d& X : samples) sum += (X - centre).squaredNorm();
  double extent = std::sqrt(sum / static_cast<double>(samples.size()));
  // Lines through one point: any extent gives the same plane.
  if (extent <= 1e-6 * (1.0 + centre.norm())) extent = 1.0 + centre.norm();
  for (size_t i = 0; i < lines.size(); ++i) {
    const Eigen::Vector3d X = samples[points.size() + i];
    const Eigen::Vector3d step = extent * lines[i].direction.normalized();
    samples[points.size() + i] = X - step;
    samples.push_back(X + step);
  }
  const PrincipalAxes principal = PrincipalAxesOf(samples);
  if (!(principal.variances[1] > 1e-12 * principal.variances[2])) return std::nullopt;
  Eigen::Vector4d plane;
  plane.head<3>() = principal.axes.col(0).normalized();
  plane[3] = -plane.head<3>().dot(principal.centroid);
  return plane;
}

std::optional<Quadric> FitQuadric(std::span<const Eigen::Vector3d> points) {
  if (points.size() < 9) return std::nullopt;
  using Coefficients = Eigen::Matrix<double, 10, 1>;
  Eigen::Matrix<double, 10, 10> scatter = Eigen::Matrix<double, 10, 10>::Zero();
  for (const Eigen::Vector3d& X : points) {
    Coefficients row;
    row << X.x() * X.x(), X.y() * X.y(), X.z() * X.z(), 2 * X.x() * X.y(), 2 * X.x() * X.z(),
        2 * X.y() * X.z(), 2 * X.x(), 2 * X.y(), 2 * X.z(), 1.0;
    scatter += row * row.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 10, 10>> eigen(scatter);
  // A second zero eigenvalue: the points lie on a family of quadrics (in a plane, on a curve).
  if (!(eigen.eigenvalues()[1] > 1e-14 * eigen.eigenvalues()[9])) return std::nullopt;
  const Coefficients q = eigen.eigenvectors().col(0);
  Quadric quadric;
  quadric.A << q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2];
  quadric.b = q.segment<3>(6);
  quadric.c = q[9];
  return quadric;
}

std::vector<Eigen::Vector3d> BestDirections(
    const std::function<double(const Eigen::Vector3d&)>& cost,
    std::span<const Eigen::Vector3d> candidates, size_t max_num) {
  constexpr int kGridSize = 150;           // about 12 degrees apart
  constexpr double kMinSeparation = 0.98;  // cosine, 11 degrees
  struct Direction {
    double cost;
    Eigen::Vector3d d;
  };
  std::vector<Direction> all;
  for (const Eigen::Vector3d& d : candidates) all.push_back({cost(d), d});
  // Fibonacci spiral on the hemisphere.
  for (int i = 0; i < kGridSize; ++i) {
    const double z = (i + 0.5) / kGridSize;
    const double radius = std::sqrt(1.0 - z * z);
    const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * i;
    const Eigen::Vector3d d(radius * std::cos(angle), radius * std::sin(angle), z);
    all.push_back({cost(d), d});
  }
  const auto better = [](const Direction& a, const Direction& b) { return a.cost < b.cost; };
  std::stable_sort(all.begin(), all.end(), better);
  std::vector<Direction> best;
  for (const Direction& direction : all) {
    if (best.size() == max_num || !std::isfinite(direction.cost)) break;
    const bool is_new = std::all_of(best.begin(), best.end(), [&](const Direction& other) {
      return std::abs(other.d.dot(direction.d)) < kMinSeparation;
    });
    if (is_new) best.push_back(direction);
  }
  for (Direction& direction : best) {
    for (double step = 0.1; step > 1e-4;) {
      const Eigen::Matrix<double, 3, 2> basis = TangentBasis(direction.d);
      Direction next = direction;
      for (const Eigen::Vector2d& move : {Eigen::Vector2d(1, 0), Eigen::Vector2d(-1, 0),
                                          Eigen::Vector2d(0, 1), Eigen::Vector2d(0, -1)}) {
        const Eigen::Vector3d d = (direction.d + step * (basis * move)).normalized();
        const double moved_cost = cost(d);
        if (moved_cost < next.cost) next = {moved_cost, d};
      }
      if (next.cost < direction.cost) {
        direction = next;
      } else {
        step *= 0.5;
      }
    }
  }
  std::stable_sort(best.begin(), best.end(), better);
  std::vector<Eigen::Vector3d> directions;
  for (const Direction& direction : best) directions.push_back(direction.d);
  return directions;
}

std::vector<Eigen::Vector3d> AxisCandidates(std::span<const Eigen::Vector3d> points) {
  const PrincipalAxes principal = PrincipalAxesOf(points);
  std::vector<Eigen::Vector3d> axes;
  for (int i = 0; i < 3; ++i) axes.push_back(principal.axes.col(i));
  if (const std::optional<Quadric> quadric = FitQuadric(points)) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(quadric->A);
    for (int i = 0; i < 3; ++i) axes.push_back(eigen.eigenvectors().col(i));
  }
  return axes;
}

}  // namespace holba
