// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/memory.h"

#include <sys/resource.h>

namespace holba {

double PeakMemoryMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

}  // namespace holba
