// SPDX-License-Identifier: BSD-3-Clause
// A hash of all that the Structure of a problem depends on: its blocks with their roles and held
// coordinates, and the blocks of its residuals, but no values, measurements, losses or weights.
// Problems with the same fingerprint share a Structure.
#pragma once

#include <array>
#include <cstdint>

#include "holba/problem/problem.h"

namespace holba::native {

using Fingerprint = std::array<uint64_t, 2>;

Fingerprint FingerprintOf(const Problem& problem);

}  // namespace holba::native
