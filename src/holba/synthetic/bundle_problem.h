// SPDX-License-Identifier: BSD-3-Clause
// Synthetic bundle adjustment problems with ground truth: the paper's synthetic benchmark (appendix
// "Details on Setup of the Synthetic Benchmark") and variations of it (near visibility, corridor,
// vanishing points, primitives, rigs, distorted cameras, wrong associations).
//
// For N images: 10 N points, N lines, N/5 planes and 3 N wireframe edges, every line with 3 of the
// points. To each plane belong 4 lines (rows and columns of a 3 x 3 grid of points) and 28 points
// (the grid and 19 more); beside it float a line with its 3 points and 19 points. Images beyond a
// multiple of 5 bring a floating line with its 3 points and 7 points each. Each feature is seen by
// 4 to 8 images; the lines of one plane share about half of their views.
#pragma once

#include <cstdint>
#include <string>

#include "holba/base/options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// kSphere: a spiral from pole to pole on a sphere of radius 10 around a cube of half-extent 3,
// looking inward. Every camera sees the whole cube. kCorridor: a row of cameras 0.5 apart looking
// along a corridor 4 wide and 3 high.
enum class SceneLayout { kSphere, kCorridor };
// Which cameras see a feature: any that can (kRandom); ones next to each other along the cameras'
// walk (kNear), as in a video or an orbit, the weakest geometry; the nearest ones in space
// (kCluster).
enum class Visibility { kRandom, kNear, kCluster };
// What a wrong association points to: any feature, or the nearest one that does not belong.
enum class WrongAssociations { kRandom, kNearest };

struct BundleProblemOptions {
  uint64_t seed = 0;
  int num_images = 100;
  SceneLayout layout = SceneLayout::kSphere;
  Visibility visibility = Visibility::kRandom;
  // Standard deviations of Gaussian noise.
  double observation_noise_px = 1.0;  // per coordinate of points and of line ends
  double rotation_noise_deg = 1.0;    // per axis; of the frame's pose, at fixed t
  double translation_noise = 0.05;    // per coordinate of t
  double feature_noise = 0.1;         // per coordinate of points and of line ends
  // Part of the group members and of the wireframe edges of `perturbed` that are replaced by wrong
  // ones, rounded over all groups (points and lines apart) and over all edges.
  double fraction_wrong_associations = 0.0;
  WrongAssociations wrong_associations = WrongAssociations::kRandom;
  // Adds three vanishing points over the grid lines, their orthogonality, and the parallelism of
  // each plane's normal to one of them.
  bool vps = false;
  int primitives = 0;  // of each type other than planes and vanishing points, with 60 points each
  std::string camera_model = "SIMPLE_PINHOLE";  // by COLMAP's name; f 700, 1000 x 1000 px
  int rig_size =
      1;  // cameras of one rig, with known sensor poses and a COLMAP camera each; 1: no rig

  void Describe(OptionTable* table) const;
};

// Both hold the same ids, the same noisy observations and consistent associations.
struct SyntheticProblem {
  Reconstruction truth;
  // Noisy poses, points and line ends; groups fitted to these by RANSAC; associations in part wrong
  // if asked for. Cameras and sensor poses are the true ones.
  Reconstruction perturbed;
};

// Throws InputError for an unknown camera model or an impossible combination of options.
SyntheticProblem MakeBundleProblem(const BundleProblemOptions& options);

}  // namespace holba
