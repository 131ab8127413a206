// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>

namespace holba {

// `requested` threads, or one per hardware thread if it is -1; at least 1.
int NumThreads(int requested);

// Calls body(begin, end) on consecutive ranges that cover [0, size). The ranges depend on size and
// num_threads only, so that sums kept per range repeat from run to run. Exceptions are rethrown here.
void ParallelFor(int num_threads, size_t size, const std::function<void(size_t, size_t)>& body);

}  // namespace holba
