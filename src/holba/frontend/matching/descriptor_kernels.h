// SPDX-License-Identifier: BSD-3-Clause
// Inner loops of the product of all descriptors of two images, of which only the two largest
// entries of each row and column are kept: for each descriptor the two most similar ones of the
// other image. Of equal ones the first is the best. Exact for bytes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/simd/targets.h"

namespace holba {

// Descriptors of the second image are packed in blocks of so many; those of the first are in groups
// of a number that divides kRowPadding.
inline constexpr int kDescriptorBlock = 64;
inline constexpr int kRowPadding = 12;

// The two largest products of each descriptor, and where the largest is: -1 if no product is
// positive.
template <typename Value>
struct TwoLargest {
  Value* best;
  Value* second;
  int32_t* idx;
};

// All descriptors of the first image against one block of the second.
template <typename Row, typename Column, typename Value>
struct ProductOfBlock {
  // Row by row, `length` entries each (a multiple of 4), num_rows a multiple of kRowPadding. Bytes:
  // minus 128.
  const Row* rows;
  // Of the block: entries 0 to 3 of its 64 descriptors, then 4 to 7, ... Floats: one entry each.
  const Column* columns;
  const int32_t* column_sums;  // bytes: 128 times the sums of entries of the block's descriptors
  size_t num_rows;
  int length;
  int32_t first_column;  // a multiple of 64
  // Of the rows, kept lane by lane: kLanesOfState numbers each; idx in units of the lanes in use.
  TwoLargest<Value> of_rows;
  TwoLargest<Value> of_columns;  // of the block's descriptors
};
inline constexpr int kLanesOfState = 16;

using ByteProduct = ProductOfBlock<int8_t, uint8_t, int32_t>;
using FloatProduct = ProductOfBlock<float, float, float>;

HOLBA_SIMD_DECLARE(void MultiplyBytes(const ByteProduct& product);
                   void MultiplyFloats(const FloatProduct& product);
                   // Lanes in use of the rows' states.
                   int StateLanes())

}  // namespace holba
