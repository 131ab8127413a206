// SPDX-License-Identifier: BSD-3-Clause
// Inner loop of the product of a symmetric block matrix (block_matrix.h) with a vector.
#pragma once

#include <cstddef>

#include "holba/simd/targets.h"

namespace holba {

// One block row: num_blocks blocks of `width` rows in the columns of the nodes column[k] (the last
// one is the diagonal block), at values + block_offset[k]. y += row times x for this row's unknowns
// and, but for the diagonal block, y += transposed row times x for the columns'. x and y may be
// read up to the padding of a row; x must be finite there.
using BlockRowKernel = void (*)(int num_blocks, int width, const int* column, const int* widths,
                                const size_t* offset, const size_t* block_offset,
                                const double* values, const double* x, double* y);

HOLBA_SIMD_DECLARE(void MultiplyBlockRow(int num_blocks, int width, const int* column,
                                         const int* widths, const size_t* offset,
                                         const size_t* block_offset, const double* values,
                                         const double* x, double* y))

inline BlockRowKernel CurrentBlockRowKernel() { return HOLBA_SIMD_CHOOSE(MultiplyBlockRow); }

}  // namespace holba
