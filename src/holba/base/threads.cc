// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/threads.h"

#include <algorithm>
#include <exception>
#include <thread>
#include <vector>

namespace holba {

int NumThreads(int requested) {
  if (requested > 0) return requested;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelFor(int num_threads, size_t size, const std::function<void(size_t, size_t)>& body) {
  if (size == 0) return;
  const size_t num_ranges = std::min<size_t>(NumThreads(num_threads), size);
  if (num_ranges == 1) return body(0, size);
  std::vector<std::exception_ptr> errors(num_ranges);
  const auto run = [&](size_t range) {
    try {
      body(size * range / num_ranges, size * (range + 1) / num_ranges);
    } catch (...) {
      errors[range] = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  for (size_t range = 1; range < num_ranges; ++range) threads.emplace_back(run, range);
  run(0);
  for (std::thread& thread : threads) thread.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace holba
