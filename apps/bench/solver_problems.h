// SPDX-License-Identifier: BSD-3-Clause
// The problems of the benchmark `solver`, by name.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "holba/bundle/bundle_options.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct SolverProblem {
  std::string name;
  Reconstruction start;
  BundleOptions bundle;
  bool is_local = false;  // of the size of a local adjustment: many calls in a row are timed, too
};

struct SolverProblemOptions {
  // bal: every BAL problem as it stands, all 9 parameters of every camera free. local: a cut of
  // each, LocalCut. With a number N of images: ring_N (10 N points, each seen by any 4 to 8 of the
  // cameras around a cube: the paper's synthetic set-up), sequence_N, collection_N
  // (synthetic/point_graph.h), random_point_N, random_holistic_N, near_point_N, near_holistic_N
  // (holba synthesize, configuration and visibility).
  std::vector<std::string> names;
  std::vector<std::string> bal_paths;
  BundleOptions bundle;  // configuration apart; for BAL problems also intrinsics and gauge apart
  uint64_t seed = 0;
  // Of sequences and collections: a camera for each image, whose focal length and distortion are
  // adjusted, instead of one for all.
  bool camera_per_image = false;
};

// A problem is made when it is its turn: not all fit into memory together.
struct SolverProblemSource {
  std::string name;
  std::function<SolverProblem()> make;
};
// Throws InputError for an unknown name.
std::vector<SolverProblemSource> SolverProblemSources(const SolverProblemOptions& options);

// Some images and the points with at least two observations in them, at most `max_points`.
Reconstruction CutOut(const Reconstruction& model, std::span<const image_t> image_ids,
                      size_t max_points);
// The first `num_images` images and the points with at least two observations in them, at most
// `max_points`.
Reconstruction LocalCut(const Reconstruction& model, size_t num_images, size_t max_points);

// Points seen per image of sequence_N and collection_N: fewer the larger, as in real ones.
double ObservationsPerImage(bool is_collection, int num_images);

// Whether the model is what ReadBal gives: a Snavely camera for each image, principal point (0, 0).
bool IsBalModel(const Reconstruction& model);

}  // namespace holba
