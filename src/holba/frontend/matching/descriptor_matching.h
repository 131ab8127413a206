// SPDX-License-Identifier: BSD-3-Clause
// Matches of the point descriptors of two images: mutual nearest neighbours that are near enough
// and clearly nearer than the second nearest, among all descriptors (exact, no approximation).
//
// Distances are angles between descriptors in radians, as in COLMAP: of bytes (SIFT) the products
// over 512^2 are the cosines, floats (ALIKED) are normalised.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/two_view_geometry.h"

namespace holba {

// Names and defaults are COLMAP's.
struct DescriptorMatchOptions {
  double max_ratio = 0.8;
  double max_distance = 0.7;
  bool cross_check = true;
  double min_cossim = 0.85;  // of floats, in place of max_distance

  void Describe(OptionTable* table) const;
};

// Floats of 32 bits: ALIKED's (types 1 and 2) and those of models of the user (-1); else bytes.
inline bool AreFloats(const Descriptors& descriptors) {
  return descriptors.type == 1 || descriptors.type == 2 ||
         (descriptors.type == -1 && descriptors.num_bytes % 4 == 0);
}

// The descriptors of an image as the product wants them.
class PackedDescriptors {
 public:
  PackedDescriptors() = default;
  // The first max_num of them.
  PackedDescriptors(const Descriptors& descriptors, size_t max_num);

  size_t size() const { return size_; }
  bool are_floats() const { return are_floats_; }
  int length() const { return length_; }
  size_t NumBytes() const;
  // Cosine of the angle of two descriptors of the same kind and length.
  double Cosine(size_t i, const PackedDescriptors& other, size_t j) const;

 private:
  friend class DescriptorProduct;
  void PackBytes(const Descriptors& descriptors);
  void PackFloats(const Descriptors& descriptors);

  bool are_floats_ = false;
  size_t size_ = 0;
  int length_ = 0;                    // entries, with zeros up to a multiple of 4
  std::vector<int8_t> rows_;          // minus 128
  std::vector<uint8_t> columns_;      // block by block
  std::vector<int32_t> column_sums_;  // times 128
  std::vector<float> float_rows_, float_columns_;
};

struct DescriptorMatches {
  PointMatches matches;       // best first: ascending by distance over that of the second nearest
  size_t num_candidates = 0;  // nearest neighbours of the first image's, before any limit
};

// Of a descriptor: the cosines of its two most similar ones, and which the first is; -1: none is
// similar at all.
struct FoundNeighbour {
  double cosine = 0.0, second_cosine = 0.0;
  int32_t idx = -1;
};
// What passes the limits, of the nearest ones of all descriptors of both images.
DescriptorMatches SelectMatches(const DescriptorMatchOptions& options, bool are_floats,
                                const std::vector<FoundNeighbour>& of_first,
                                const std::vector<FoundNeighbour>& of_second);

// Of all descriptors of two images.
struct Neighbours {
  std::vector<FoundNeighbour> of_first, of_second;
};
// Images whose descriptors are of different kinds or lengths have none.
Neighbours FindNeighbours(const PackedDescriptors& descriptors1,
                          const PackedDescriptors& descriptors2);

// Images whose descriptors are of different kinds or lengths have no matches.
DescriptorMatches MatchDescriptors(const DescriptorMatchOptions& options,
                                   const PackedDescriptors& descriptors1,
                                   const PackedDescriptors& descriptors2);

}  // namespace holba
