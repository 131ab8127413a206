// SPDX-License-Identifier: BSD-3-Clause
// Where the person with the camera is: along the walk of a place, with steps, sway and an unsteady
// hand.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/geometry/rigid3d.h"
#include "holba/render/place.h"
#include "holba/scene/reconstruction.h"

namespace holba {

enum class RigKind { kNone, kStereo, kRing };

struct WalkOptions {
  int num_images = -1;  // instants at which the shutter opens; -1: as many as the place has
  RigKind rig = RigKind::kNone;
  double unsteadiness = 1.0;  // of step, sway and hand; 0: a dolly
  double readout_ms = 0.0;    // from the first row to the last; 0: all at once
  double speed = 1.0;         // of the person, metres per second

  void Describe(OptionTable* table) const;  // section "Walk"
};

class WalkPath {
 public:
  WalkPath(const Walk& walk, double unsteadiness, uint64_t seed);

  double length() const { return length_; }  // metres
  // Of the person's camera at a part in [0, 1] of the way: x right, y down, z forward.
  Rigid3d CamFromWorld(double part) const;

 private:
  Eigen::Vector3d Along(const std::vector<Eigen::Vector3d>& knots, double part) const;

  Walk walk_;
  double unsteadiness_;
  double length_ = 0.0;
  std::vector<double> phases_;
  std::vector<double> parameters_;  // of the curve, at equal lengths
};

// The sensors of a rig as their poses in it; the first is the reference.
std::vector<Rigid3d> SensorsOf(RigKind rig);

// Part of the way of each instant.
std::vector<double> Instants(const Walk& walk, int num_images);

}  // namespace holba
