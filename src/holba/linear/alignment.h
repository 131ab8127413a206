// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <new>

namespace holba {

// Of the memory of matrices: a line of the cache, which is the widest register, too.
inline constexpr std::align_val_t kMatrixAlignment{64};

}  // namespace holba
