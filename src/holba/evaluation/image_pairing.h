// SPDX-License-Identifier: BSD-3-Clause
// What of a model and of the truth is the same: images by their names, and whether ids of features
// mean the same in both.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

#include "holba/scene/reconstruction.h"

namespace holba {

struct ImagePairing {
  std::map<image_t, image_t>
      model_id_of_truth;  // registered images of both, by the id in the truth
  size_t num_truth = 0, num_model = 0;
  size_t num_whole = 0;      // pairs of equal names
  size_t num_by_ending = 0;  // pairs by the end of their paths (scene/name_pairing.h)
  size_t num_ambiguous = 0;  // true images that several of the model fit equally well
  std::string examples;      // of the pairs by the end of their paths; empty: none
  std::string unpaired_truth, unpaired_model;  // a name of each without a pair; empty: none
  // Whether points, lines and groups of one id are the same. Ids say so where features of one id
  // are seen at the same 2D features, and where this cannot be seen, if images of one name have one
  // id.
  bool features_have_same_ids = false;

  size_t NumPairs() const { return num_whole + num_by_ending; }
};

ImagePairing PairImages(const Reconstruction& model, const Reconstruction& truth);

// Says on the log what was paired how, if not all by their whole names. Throws InputError with two
// names if less than half of what could be paired is: the names are of different sets, or are
// written in ways that are not understood.
void ReportPairing(const ImagePairing& pairing, const std::filesystem::path& truth_path);

}  // namespace holba
