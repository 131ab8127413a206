// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

Vector3d ToLocal(const Surface& surface, const Vector3d& point) {
  return surface.axes.transpose() * (point - surface.origin);
}

Vector3d ToWorld(const Surface& surface, const Vector3d& local) {
  return surface.origin + surface.axes * local;
}

// Roots of a t^2 + 2 b t + c in ascending order.
std::optional<std::array<double, 2>> Roots(double a, double b, double c) {
  if (std::abs(a) < 1e-14) {
    if (b == 0.0) return std::nullopt;
    const double t = -c / (2.0 * b);
    return std::array<double, 2>{t, t};
  }
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0.0)) return std::nullopt;
  // The form without cancellation.
  const double q = b > 0.0 ? -b - std::sqrt(discriminant) : -b + std::sqrt(discriminant);
  const double t1 = q / a, t2 = q != 0.0 ? c / q : t1;
  return std::array<double, 2>{std::min(t1, t2), std::max(t1, t2)};
}

double Angle(double x, double y) {
  const double angle = std::atan2(y, x);
  return angle < 0.0 ? angle + 2.0 * kPi : angle;
}

double MeanRadius(const Surface& surface) { return 0.5 * (surface.size[0] + surface.size[1]); }

// Along the side from the base to the top.
double SlantHeight(const Surface& surface) {
  return std::hypot(surface.size[2], surface.size[1] - surface.size[0]);
}

}  // namespace

std::optional<double> Intersect(const Surface& surface, const Vector3d& from, const Vector3d& ray,
                                double near, double far) {
  const Vector3d o = ToLocal(surface, from), d = surface.axes.transpose() * ray;
  const auto in_range = [&](double t) { return t > near && t < far; };
  const Vector3d& size = surface.size;
  switch (surface.shape) {
    case Shape::kRectangle:
    case Shape::kDisc: {
      if (d.z() == 0.0) return std::nullopt;
      const double t = -o.z() / d.z();
      if (!in_range(t)) return std::nullopt;
      const double x = o.x() + t * d.x(), y = o.y() + t * d.y();
      if (surface.shape == Shape::kRectangle) {
        if (x < 0.0 || y < 0.0 || x > size[0] || y > size[1]) return std::nullopt;
      } else {
        const double r2 = x * x + y * y;
        if (r2 > size[0] * size[0] || r2 < size[1] * size[1]) return std::nullopt;
      }
      return t;
    }
    case Shape::kEllipsoid: {
      const Vector3d p = o.cwiseQuotient(size), v = d.cwiseQuotient(size);
      const auto roots = Roots(v.squaredNorm(), p.dot(v), p.squaredNorm() - 1.0);
      if (!roots) return std::nullopt;
      for (const double t : *roots) {
        if (in_range(t)) return t;
      }
      return std::nullopt;
    }
    case Shape::kFrustum: {
      const double k = (size[1] - size[0]) / size[2];
      const double radius = size[0] + k * o.z();
      const auto roots = Roots(d.x() * d.x() + d.y() * d.y() - k * k * d.z() * d.z(),
                               o.x() * d.x() + o.y() * d.y() - k * radius * d.z(),
                               o.x() * o.x() + o.y() * o.y() - radius * radius);
      if (!roots) return std::nullopt;
      for (const double t : *roots) {
        const double z = o.z() + t * d.z();
        if (in_range(t) && z >= 0.0 && z <= size[2]) return t;
      }
      return std::nullopt;
    }
  }
  return std::nullopt;
}

Vector3d NormalAt(const Surface& surface, const Vector3d& point) {
  switch (surface.shape) {
    case Shape::kRectangle:
    case Shape::kDisc:
      return surface.axes.col(2);
    case Shape::kEllipsoid: {
      const Vector3d local = ToLocal(surface, point);
      return (surface.axes * local.cwiseQuotient(surface.size.cwiseAbs2())).normalized();
    }
    case Shape::kFrustum: {
      const Vector3d local = ToLocal(surface, point);
      const double k = (surface.size[1] - surface.size[0]) / surface.size[2];
      const double radius = std::hypot(local.x(), local.y());
      if (!(radius > 0.0)) return surface.axes.col(2);
      return (surface.axes * Vector3d(local.x() / radius, local.y() / radius, -k)).normalized();
    }
  }
  return surface.axes.col(2);
}

Vector2d ChartSize(const Surface& surface) {
  const Vector3d& size = surface.size;
  switch (surface.shape) {
    case Shape::kRectangle:
      return size.head<2>();
    case Shape::kDisc:
      return Vector2d::Constant(2.0 * size[0]);
    case Shape::kEllipsoid:
      return {kPi * (size[0] + size[1]), kPi * std::max({size[0], size[1], size[2]})};
    case Shape::kFrustum:
      return {2.0 * kPi * MeanRadius(surface), SlantHeight(surface)};
  }
  return Vector2d::Ones();
}

Vector2d ChartOf(const Surface& surface, const Vector3d& point) {
  const Vector3d local = ToLocal(surface, point);
  const Vector2d chart = ChartSize(surface);
  switch (surface.shape) {
    case Shape::kRectangle:
      return local.head<2>();
    case Shape::kDisc:
      return local.head<2>() + Vector2d::Constant(surface.size[0]);
    case Shape::kEllipsoid: {
      const Vector3d z = local.cwiseQuotient(surface.size);
      return {chart.x() * Angle(z.x(), z.y()) / (2.0 * kPi),
              chart.y() * std::acos(std::clamp(z.z(), -1.0, 1.0)) / kPi};
    }
    case Shape::kFrustum:
      return {chart.x() * Angle(local.x(), local.y()) / (2.0 * kPi),
              chart.y() * local.z() / surface.size[2]};
  }
  return Vector2d::Zero();
}

Vector3d PointOfChart(const Surface& surface, const Vector2d& at) {
  const Vector2d chart = ChartSize(surface);
  switch (surface.shape) {
    case Shape::kRectangle:
      return ToWorld(surface, {at.x(), at.y(), 0.0});
    case Shape::kDisc:
      return ToWorld(surface, {at.x() - surface.size[0], at.y() - surface.size[0], 0.0});
    case Shape::kEllipsoid: {
      const double a = 2.0 * kPi * at.x() / chart.x(), b = kPi * at.y() / chart.y();
      const Vector3d unit(std::sin(b) * std::cos(a), std::sin(b) * std::sin(a), std::cos(b));
      return ToWorld(surface, surface.size.cwiseProduct(unit));
    }
    case Shape::kFrustum: {
      const double a = 2.0 * kPi * at.x() / chart.x(), s = at.y() / chart.y();
      const double radius = surface.size[0] + s * (surface.size[1] - surface.size[0]);
      return ToWorld(surface, {radius * std::cos(a), radius * std::sin(a), s * surface.size[2]});
    }
  }
  return surface.origin;
}

void Bounds(const Surface& surface, Vector3d* low, Vector3d* high) {
  const Vector3d& size = surface.size;
  if (surface.shape == Shape::kRectangle) {
    const Vector3d far = ToWorld(surface, {size[0], size[1], 0.0});
    *low = surface.origin.cwiseMin(far);
    *high = surface.origin.cwiseMax(far);
    for (const Vector3d& corner :
         {ToWorld(surface, {size[0], 0, 0}), ToWorld(surface, {0, size[1], 0})}) {
      *low = low->cwiseMin(corner);
      *high = high->cwiseMax(corner);
    }
    return;
  }
  Vector3d local_low, local_high;
  switch (surface.shape) {
    case Shape::kDisc:
      local_high = Vector3d(size[0], size[0], 0.0);
      local_low = -local_high;
      break;
    case Shape::kEllipsoid:
      local_high = size;
      local_low = -local_high;
      break;
    default: {
      const double radius = std::max(size[0], size[1]);
      local_low = Vector3d(-radius, -radius, 0.0);
      local_high = Vector3d(radius, radius, size[2]);
    }
  }
  low->setConstant(std::numeric_limits<double>::infinity());
  high->setConstant(-std::numeric_limits<double>::infinity());
  for (int corner = 0; corner < 8; ++corner) {
    Vector3d local;
    for (int i = 0; i < 3; ++i) local[i] = ((corner >> i) & 1) != 0 ? local_high[i] : local_low[i];
    const Vector3d world = ToWorld(surface, local);
    *low = low->cwiseMin(world);
    *high = high->cwiseMax(world);
  }
}

namespace {

// Parts of a circle of this radius whose chords are at most max_deviation from it; at least 12.
int NumArcs(double radius, double max_deviation) {
  const double cosine = std::clamp(1.0 - max_deviation / std::max(radius, 1e-9), -1.0, 1.0);
  return std::max(12, static_cast<int>(std::ceil(kPi / std::max(std::acos(cosine), 1e-3))));
}

// A grid of the chart; the first coordinate closes.
SurfaceMesh ClosedGrid(const Surface& surface, int columns, int rows) {
  SurfaceMesh mesh;
  const Vector2d chart = ChartSize(surface);
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      mesh.vertices.push_back(
          PointOfChart(surface, {chart.x() * column / columns, chart.y() * row / rows}));
    }
  }
  const auto at = [columns](int column, int row) {
    return static_cast<uint32_t>(row * columns + column % columns);
  };
  // The chart's second coordinate goes down on an ellipsoid and up on a frustum.
  const bool goes_down = surface.shape == Shape::kEllipsoid;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const uint32_t a = at(column, row), b = at(column + 1, row), c = at(column + 1, row + 1),
                     d = at(column, row + 1);
      const bool first_is_tip = goes_down && row == 0;
      const bool last_is_tip = goes_down && row == rows - 1;
      if (goes_down) {
        if (!first_is_tip) mesh.triangles.push_back({a, c, b});
        if (!last_is_tip) mesh.triangles.push_back({a, d, c});
      } else {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      }
    }
  }
  return mesh;
}

}  // namespace

SurfaceMesh Tessellate(const Surface& surface, double max_deviation) {
  const Vector3d& size = surface.size;
  switch (surface.shape) {
    case Shape::kRectangle: {
      SurfaceMesh mesh;
      for (const Vector2d& at : {Vector2d(0, 0), Vector2d(size[0], 0), Vector2d(size[0], size[1]),
                                 Vector2d(0, size[1])}) {
        mesh.vertices.push_back(ToWorld(surface, {at.x(), at.y(), 0.0}));
      }
      mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
      return mesh;
    }
    case Shape::kDisc: {
      SurfaceMesh mesh;
      const int num = NumArcs(size[0], max_deviation);
      for (int i = 0; i < num; ++i) {
        const double angle = 2.0 * kPi * i / num;
        for (const double radius : {size[0], size[1]}) {
          mesh.vertices.push_back(
              ToWorld(surface, {radius * std::cos(angle), radius * std::sin(angle), 0.0}));
        }
      }
      for (int i = 0; i < num; ++i) {
        const auto a = static_cast<uint32_t>(2 * i), b = static_cast<uint32_t>(2 * ((i + 1) % num));
        mesh.triangles.push_back({a, b, a + 1});
        if (size[1] > 0.0) mesh.triangles.push_back({b, b + 1, a + 1});
      }
      return mesh;
    }
    case Shape::kEllipsoid: {
      const int num = NumArcs(size.maxCoeff(), max_deviation);
      return ClosedGrid(surface, num, std::max(6, num / 2));
    }
    case Shape::kFrustum:
      return ClosedGrid(surface, NumArcs(std::max(size[0], size[1]), max_deviation), 1);
  }
  return {};
}

Eigen::Matrix3d FrameAround(const Vector3d& normal) {
  const Vector3d n = normal.normalized();
  const Vector3d helper = std::abs(n.z()) < 0.9 ? Vector3d::UnitZ() : Vector3d::UnitX();
  Eigen::Matrix3d frame;
  frame.col(0) = helper.cross(n).normalized();
  frame.col(1) = n.cross(frame.col(0));
  frame.col(2) = n;
  return frame;
}

}  // namespace holba
