// SPDX-License-Identifier: BSD-3-Clause
// How blocks of unknowns are padded in memory. Includes nothing: for vectorised files, too.
#pragma once

namespace holba {

// Unknowns of the widest block.
inline constexpr int kMaxBlockWidth = 24;

// Doubles that a column or row of `width` occupies.
constexpr int PaddedWidth(int width) { return (width + 7) / 8 * 8; }

}  // namespace holba
