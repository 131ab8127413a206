// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/walk.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/base/check.h"
#include "holba/base/random.h"

namespace holba {

using Eigen::Vector3d;

void WalkOptions::Describe(OptionTable* table) const {
  table->Section("Walk");
  table
      ->Field("num_images", &num_images, AtLeast(-1),
              "Photographs of each camera; -1: as many as suit the place.")
      .Basic();
  table
      ->Choice("rig", &rig,
               {{"none", RigKind::kNone}, {"stereo", RigKind::kStereo}, {"ring", RigKind::kRing}},
               "Rig that is carried: none, two cameras side by side, or a ring of four.")
      .Basic();
  table->Field("unsteadiness", &unsteadiness, AtLeast(0),
               "Step, sway and hand: 1 of a person, 0 of a dolly.");
  table->Field(
      "readout_ms", &readout_ms, AtLeast(0),
      "Rolling exposure: milliseconds from the first row to the last; the true pose is that of the "
      "middle.");
  table->Field("speed", &speed, GreaterThan(0),
               "Of the person, metres per second; it matters to rolling exposure.");
  table->Section("");
}

WalkPath::WalkPath(const Walk& walk, double unsteadiness, uint64_t seed)
    : walk_(walk), unsteadiness_(unsteadiness) {
  HOLBA_CHECK(walk.places.size() == walk.targets.size() && walk.places.size() >= 2);
  Random random(seed);
  for (int i = 0; i < 8; ++i) phases_.push_back(random.Uniform(0, 2 * std::numbers::pi));
  // Equal steps of the way, not of the curve's parameter.
  constexpr int kNumPieces = 2000;
  std::vector<double> lengths = {0.0};
  Vector3d last = Along(walk_.places, 0.0);
  for (int i = 1; i <= kNumPieces; ++i) {
    const Vector3d next = Along(walk_.places, static_cast<double>(i) / kNumPieces);
    lengths.push_back(lengths.back() + (next - last).norm());
    last = next;
  }
  length_ = lengths.back();
  size_t piece = 0;
  for (int i = 0; i <= kNumPieces; ++i) {
    const double wanted = length_ * i / kNumPieces;
    while (piece + 2 < lengths.size() && lengths[piece + 1] < wanted) ++piece;
    const double step = lengths[piece + 1] - lengths[piece];
    const double share = step > 0.0 ? std::clamp((wanted - lengths[piece]) / step, 0.0, 1.0) : 0.0;
    parameters_.push_back((static_cast<double>(piece) + share) / kNumPieces);
  }
}

// Catmull and Rom's spline.
Vector3d WalkPath::Along(const std::vector<Vector3d>& knots, double part) const {
  const int num = static_cast<int>(knots.size());
  const int num_pieces = walk_.closed ? num : num - 1;
  const double at = std::clamp(part, 0.0, 1.0) * num_pieces;
  const int i = std::min(static_cast<int>(at), num_pieces - 1);
  const double t = at - i;
  const auto knot = [&](int k) -> Vector3d {
    if (walk_.closed) return knots[static_cast<size_t>((k + num) % num)];
    if (k < 0) return 2.0 * knots[0] - knots[1];
    if (k >= num)
      return 2.0 * knots[static_cast<size_t>(num - 1)] - knots[static_cast<size_t>(num - 2)];
    return knots[static_cast<size_t>(k)];
  };
  const Vector3d a = knot(i - 1), b = knot(i), c = knot(i + 1), d = knot(i + 2);
  return 0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t +
                (3.0 * b - 3.0 * c + d - a) * t * t * t);
}

Rigid3d WalkPath::CamFromWorld(double part) const {
  if (walk_.closed) part -= std::floor(part);
  const double at = std::clamp(part, 0.0, 1.0) * static_cast<double>(parameters_.size() - 1);
  const auto i = std::min(static_cast<size_t>(at), parameters_.size() - 2);
  const double share = at - static_cast<double>(i);
  const double parameter = (1.0 - share) * parameters_[i] + share * parameters_[i + 1];
  Vector3d place = Along(walk_.places, parameter);
  const Vector3d target = Along(walk_.targets, parameter);
  const double way = part * length_;
  const auto swing = [&](int phase, double metres) {
    return unsteadiness_ *
           std::sin(2.0 * std::numbers::pi * way / metres + phases_[static_cast<size_t>(phase)]);
  };
  Eigen::Matrix3d R;
  R.row(2) = (target - place).normalized();
  R.row(0) = Vector3d(R.row(2)).cross(Vector3d::UnitZ()).normalized();
  R.row(1) = R.row(2).cross(R.row(0));
  // A step is 0.7 m: up and down with each, from side to side with two. The hand turns slower.
  place.z() += 0.02 * swing(0, 0.7) + 0.06 * swing(1, 3.1);
  place += 0.015 * swing(2, 1.4) * Vector3d(R.row(0));
  const double degree = std::numbers::pi / 180.0;
  const Vector3d turn(degree * (2.0 * swing(3, 1.9) + 0.5 * swing(4, 0.7)),
                      degree * (2.5 * swing(5, 2.3)),
                      degree * (1.5 * swing(6, 1.7) + 0.5 * swing(7, 0.7)));
  const Eigen::Quaterniond q = (ExpRotation(turn) * Eigen::Quaterniond(R)).normalized();
  return {q, -(q * place)};
}

std::vector<Rigid3d> SensorsOf(RigKind rig) {
  std::vector<Rigid3d> sensors = {Rigid3d()};
  if (rig == RigKind::kStereo) {
    // The right one, 12 cm to the right and not quite parallel, as rigs are.
    const Eigen::Quaterniond q = ExpRotation({0.004, -0.01, 0.003});
    sensors.emplace_back(q, -(q * Vector3d(0.12, 0.001, -0.002)));
  }
  if (rig == RigKind::kRing) {
    for (int i = 1; i < 4; ++i) {
      const double angle = 0.5 * std::numbers::pi * i;
      const Eigen::Quaterniond q = ExpRotation({0.0, -angle, 0.0});
      const Vector3d centre(0.06 * std::sin(angle), 0.0, 0.06 * (std::cos(angle) - 1.0));
      sensors.emplace_back(q, -(q * centre));
    }
  }
  return sensors;
}

std::vector<double> Instants(const Walk& walk, int num_images) {
  std::vector<double> parts;
  for (int i = 0; i < num_images; ++i) {
    const int num_steps = walk.closed ? num_images : std::max(1, num_images - 1);
    parts.push_back(static_cast<double>(i) / num_steps);
  }
  return parts;
}

}  // namespace holba
