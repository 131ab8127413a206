// SPDX-License-Identifier: BSD-3-Clause
// Planes among triangulated points, without labels: sequential RANSAC with local optimisation
// (Chum et al. 2003) and spatial support. A plane is what its points fill: members are connected
// through their neighbours, and most neighbours of a member are members too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct PlaneOptions {
  uint64_t seed = 0;
  int num_threads = -1;

  // Points of fewer images, or of rays that meet at less, are too uncertain in depth to tell planes
  // apart.
  int min_images = 3;
  double min_angle_deg = 1.5;
  // Members lie within this many pixels (GSD; farther, up to 2.5 times, where rays meet at less
  // than 15 degrees). At 4 thin reliefs and window recesses are absorbed, at 1 a wall falls apart.
  double max_distance_px = 2.0;
  // Points are neighbours if one is among the 10 nearest of the other and nearer than this.
  double max_neighbour_px = 60.0;
  // Fewest connected points that make a plane, and fewest members of a plane that is kept.
  int min_component = 20;
  int min_points = 20;
  // Mean share, over the members, of the 12 nearest points that are members too: 0.6 to 0.94 on
  // facades, roofs and tables, 0.37 to 0.57 in bushes and clutter.
  double min_share = 0.6;
  // Hypotheses per point, each through the point and two of its neighbours. In a model with
  // vanishing points, each point has one more hypothesis, whose normal is theirs.
  int samples_per_point = 2;
  int max_planes = 100;
  // Two planes nearer than this in direction become one if one plane explains the points of both.
  double merge_angle_deg = 12.0;

  void Describe(OptionTable* table) const;
};

struct PlaneReport {
  size_t points_eligible = 0;
  size_t planes_found = 0;  // connected sets of coplanar points
  size_t planes_merged = 0;
  size_t planes_split = 0;  // planes of the model that were two, known ones included
  size_t planes = 0;        // added to the model
  size_t points_on_planes = 0;
  // Planes whose normal is that of two vanishing points' directions or one vanishing point, to 3
  // degrees.
  size_t planes_along_vps = 0;
  double median_residual_px = 0.0;  // of the members, in GSD
  double sigma_px = 0.0;            // measured noise of the points' observations
  std::map<std::string, size_t> dropped;
};

// Adds a group PLANE, with its points and without observations, for each plane found. Points that
// are members of a plane already take no part. The largest plane first; a point is on one plane at
// most (those where planes meet are for AddPointsToPlanes). Planes that are two, also of those
// known before, become two (plane_split.h), and lose their lines.
PlaneReport DetectPlanes(const PlaneOptions& options, Reconstruction* model);

}  // namespace holba
