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

enum class PairSelection { kExhaustive, kSequential, kSpatial, kRetrieval, kList };

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
