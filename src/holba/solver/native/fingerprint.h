// SPDX-License-Identifier: BSD-3-Clause
// 128 bits of what the structure of a problem depends on: its blocks, their roles and what of them
// is held, and which blocks its residuals hold; not values, measurements, losses or weights. Two
// problems with the same one share a Structure.
#pragma once

#include <array>
#include <cstdint>

#include "holba/problem/problem.h"

namespace holba::native {

using Fingerprint = std::array<uint64_t, 2>;

Fingerprint FingerprintOf(const Problem& problem);

}  // namespace holba::native
