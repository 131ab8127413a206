// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace holba {

// Largest resident set of this process so far, in MB (2^20 bytes).
double PeakMemoryMb();

}  // namespace holba
