// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/panel_kernels.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace holba {

#if defined(__x86_64__)
FlushTinyNumbers::FlushTinyNumbers() : before_(_mm_getcsr()) {
  constexpr unsigned kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040;
  _mm_setcsr(static_cast<unsigned>(before_) | kFlushToZero | kDenormalsAreZero);
}
FlushTinyNumbers::~FlushTinyNumbers() { _mm_setcsr(static_cast<unsigned>(before_)); }
#elif defined(__aarch64__)
FlushTinyNumbers::FlushTinyNumbers() {
  asm volatile("mrs %0, fpcr" : "=r"(before_));
  asm volatile("msr fpcr, %0" : : "r"(before_ | (uint64_t{1} << 24)));
}
FlushTinyNumbers::~FlushTinyNumbers() { asm volatile("msr fpcr, %0" : : "r"(before_)); }
#else
FlushTinyNumbers::FlushTinyNumbers() : before_(0) {}
FlushTinyNumbers::~FlushTinyNumbers() = default;
#endif

}  // namespace holba
