// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <new>
#include <utility>

#include "holba/linear/cholesky_factor.h"

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace holba {
namespace {

constexpr size_t kLargePage = size_t{1} << 21;

std::align_val_t AlignmentFor(size_t bytes) {
  return std::align_val_t{bytes >= 2 * kLargePage ? kLargePage : 64};
}

}  // namespace

template <typename Real>
FactorMemory<Real>::FactorMemory(size_t size) : size_(size) {
  const size_t bytes = size * sizeof(Real);
  data_ = static_cast<Real*>(::operator new(bytes, AlignmentFor(bytes)));
#if defined(__linux__) && defined(MADV_HUGEPAGE)
  if (bytes >= 2 * kLargePage) madvise(data_, bytes / kLargePage * kLargePage, MADV_HUGEPAGE);
#endif
  std::memset(data_, 0, bytes);
}

template <typename Real>
FactorMemory<Real>::FactorMemory(FactorMemory&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}

template <typename Real>
FactorMemory<Real>& FactorMemory<Real>::operator=(FactorMemory&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

template <typename Real>
FactorMemory<Real>::~FactorMemory() {
  ::operator delete(data_, AlignmentFor(size_ * sizeof(Real)));
}

template class FactorMemory<double>;
template class FactorMemory<float>;

}  // namespace holba
