// SPDX-License-Identifier: BSD-3-Clause
// Which pairs of a database's images are matched: all, neighbours in a sequence, neighbours in
// space, those that look alike, or a list. Every pair once, the image with the smaller id first, in
// an order that goes through the images block by block.
#pragma once

#include <string>
#include <vector>

#include "holba/base/options.h"
#include "holba/io/database.h"

namespace holba {

// Automatic: all pairs of up to kMaxNumExhaustive images, those that look alike of more.
enum class PairSelection { kAutomatic, kExhaustive, kSequential, kSpatial, kRetrieval, kList };

// All pairs of 300 images are 45 000, which take about half an hour of one core at 8000 points an
// image; by retrieval the time grows with the number of images, not with its square.
inline constexpr size_t kMaxNumExhaustive = 300;

// Pairs that are matched and then written at a time: what a run that is stopped loses.
inline constexpr size_t kPairsPerWrite = 64;

// Names and defaults are COLMAP's, where it has them.
struct PairListOptions {
  PairSelection selection = PairSelection::kExhaustive;
  int block_size = 50;
  int overlap = 10;
  bool quadratic_overlap = true;
  bool loop_detection = false;
  int loop_detection_period = 10;
  int loop_detection_num_images = 50;
  bool ignore_z = true;
  int max_num_neighbors = 50;
  double max_distance = 100.0;
  int num_images = 30;  // of retrieval
  std::string match_list_path;

  void Describe(OptionTable* table) const;
  // Throws InputError for a list that is missing or not used.
  void Check() const;
};

// Throws InputError for a list that names images that are not there (with file and line), and for
// spatial pairs without positions.
std::vector<ImagePair> ListPairs(const PairListOptions& options, const Database& database,
                                 int num_threads);

}  // namespace holba
