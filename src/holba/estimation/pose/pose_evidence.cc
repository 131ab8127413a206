// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/pose_evidence.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <limits>

#include "holba/base/check.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Points whose errors are multiplied for one logarithm. Squared errors in units of their noise are
// below 1e18 as long as thresholds are below 1e9, so that the product of 16 is a number.
constexpr size_t kBlock = 16;
constexpr int kNumColumns = 12;

double Squared(double x) { return x * x; }

}  // namespace

PoseEvidence::PoseEvidence(const Camera& camera, const AbsolutePoseMatches& matches)
    : camera_{camera},
      matches_{matches},
      given_{camera.model->ideal_calibration(camera.params.data())} {
  stride_ = (matches.points.size() + kBlock - 1) / kBlock * kBlock;
  columns_.resize(kNumColumns * stride_, 0.0);
  for (const PointSighting& point : matches.points) {
    HOLBA_CHECK(point.relative_sigma > 0.0);
    const auto ray = camera.model->unproject(camera.params.data(), point.pixel);
    if (!ray) continue;
    Vector2d back;
    RowMajor<2, 3> d_pixel;
    if (!camera.model->project_with_jacobian(camera.params.data(), *ray, &back, d_pixel.data(),
                                             nullptr)) {
      continue;
    }
    d_pixel /= point.relative_sigma;
    double* const column = columns_.data() + num_rays_++;
    for (int k = 0; k < 3; ++k) {
      column[k * stride_] = point.X[k];
      column[(3 + k) * stride_] = (*ray)[k];
    }
    for (int k = 0; k < 6; ++k) column[(6 + k) * stride_] = d_pixel(k / 3, k % 3);
  }
  for (const LineSighting& line : matches.lines) {
    HOLBA_CHECK(line.relative_sigma > 0.0);
    const auto start = IdealPixel(*camera.model, camera.params.data(), line.segment.start);
    const auto end = IdealPixel(*camera.model, camera.params.data(), line.segment.end);
    if (!start || !end) continue;
    const auto normalised = [&](const Vector2d& x) {
      return Vector3d((x.x() - given_.cx) / given_.fx, (x.y() - given_.cy) / given_.fy, 1.0);
    };
    lines_.push_back(
        {line.line, normalised(*start), normalised(*end), 1.0 / Squared(line.relative_sigma)});
  }
}

double PoseEvidence::GainOf(const Rigid3d& cam_from_world, const ForEachKind<double>& noise,
                            const Gain& gain, double to_beat) const {
  const Eigen::Matrix3d R = cam_from_world.RotationMatrix();
  const Vector3d t = cam_from_world.translation;
  double sum = 0.0;
  double num_left = static_cast<double>(NumSightings());
  const double line_weight = 1.0 / Squared(noise.lines);
  for (const PreparedLine& line : lines_) {
    const Vector3d d = R * line.line.direction;
    const Vector3d m = R * line.line.moment + t.cross(d);
    num_left -= 1.0;
    if (!IsInFront({d, m}, line.start) || !IsInFront({d, m}, line.end)) continue;
    const double norm2 = Squared(given_.fy * m.x()) + Squared(given_.fx * m.y());
    const double distances2 = Squared(m.dot(line.start)) + Squared(m.dot(line.end));
    if (!(norm2 > 0.0)) continue;
    sum += gain.Of(line_weight * line.weight * Squared(given_.fx * given_.fy) * distances2 / norm2);
  }
  const double direction_weight = 1.0 / Squared(noise.directions);
  for (const DirectionSighting& direction : matches_.directions) {
    const Vector3d predicted = R * direction.direction_in_world;
    num_left -= 1.0;
    sum += gain.Of(direction_weight * predicted.cross(direction.direction_in_cam).squaredNorm() /
                   Squared(direction.relative_sigma));
  }

  const double* const c = columns_.data();
  const size_t n = stride_;
  const double point_weight = 1.0 / Squared(noise.points);
  const double low = gain.low(), high = gain.high();
  for (size_t first = 0; first < n; first += kBlock) {
    double e2[kBlock];
    for (size_t k = 0; k < kBlock; ++k) {
      const size_t i = first + k;
      const double X = c[i], Y = c[n + i], Z = c[2 * n + i];
      const double x = R(0, 0) * X + R(0, 1) * Y + R(0, 2) * Z + t.x();
      const double y = R(1, 0) * X + R(1, 1) * Y + R(1, 2) * Z + t.y();
      const double z = R(2, 0) * X + R(2, 1) * Y + R(2, 2) * Z + t.z();
      const double along = c[3 * n + i] * x + c[4 * n + i] * y + c[5 * n + i] * z;
      const double u = c[6 * n + i] * x + c[7 * n + i] * y + c[8 * n + i] * z;
      const double v = c[9 * n + i] * x + c[10 * n + i] * y + c[11 * n + i] * z;
      const double e = point_weight * (u * u + v * v) / (along * along);
      e2[k] = along > 0.0 && e < high ? e : high;
    }
    double product = 1.0, rests = 0.0, count = 0.0;
    for (size_t k = 0; k < kBlock; ++k) {
      const bool counts = e2[k] < high;
      product *= counts ? std::max(e2[k], low) : 1.0;
      rests += counts ? gain.Rest(e2[k]) : 0.0;
      count += counts ? 1.0 : 0.0;
    }
    if (count > 0.0) sum += gain.OfMany(count, std::log(product), rests);
    num_left -= static_cast<double>(kBlock);
    if (sum + std::max(num_left, 0.0) <= to_beat) return -1.0;
  }
  return sum > to_beat ? sum : -1.0;
}

double PoseEvidence::GainOf(const Rigid3d& cam_from_world, std::span<const double> params,
                            const ForEachKind<double>& noise, const Gain& gain,
                            double to_beat) const {
  const PosedCamera view(camera_.model, params.data(), cam_from_world);
  double num_left = static_cast<double>(NumSightings());
  double sum = 0.0;
  Vector2d error;
  const auto add = [&](bool exists, double weight) {
    if (exists) sum += gain.Of(weight * error.squaredNorm());
    num_left -= 1.0;
    return sum + num_left > to_beat;
  };
  for (const DirectionSighting& direction : matches_.directions) {
    if (!add(ErrorOf(view, given_, direction, &error, nullptr), 1.0 / Squared(noise.directions)))
      return -1.0;
  }
  for (const PointSighting& point : matches_.points) {
    if (!add(ErrorOf(view, point, &error, nullptr), 1.0 / Squared(noise.points))) return -1.0;
  }
  for (const LineSighting& line : matches_.lines) {
    if (!add(ErrorOf(view, line, &error, nullptr), 1.0 / Squared(noise.lines))) return -1.0;
  }
  return sum;
}

void PoseEvidence::SquaredErrors(const Rigid3d& cam_from_world, std::span<const double> params,
                                 ForEachKind<std::vector<double>>* squared) const {
  const PosedCamera view(camera_.model, params.data(), cam_from_world);
  Vector2d error;
  const auto value = [&](bool exists) {
    return exists ? error.squaredNorm() : std::numeric_limits<double>::infinity();
  };
  *squared = {};
  for (const PointSighting& point : matches_.points)
    squared->points.push_back(value(ErrorOf(view, point, &error, nullptr)));
  for (const LineSighting& line : matches_.lines)
    squared->lines.push_back(value(ErrorOf(view, line, &error, nullptr)));
  for (const DirectionSighting& direction : matches_.directions)
    squared->directions.push_back(value(ErrorOf(view, given_, direction, &error, nullptr)));
}

}  // namespace holba
