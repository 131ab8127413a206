// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <new>
#include <utility>

#include "holba/linear/alignment.h"
#include "holba/linear/cholesky_factor.h"

namespace holba {

template <typename Real>
FactorMemory<Real>::FactorMemory(size_t size) : size_(size) {
  data_ = static_cast<Real*>(::operator new(size * sizeof(Real), kMatrixAlignment));
  std::fill_n(data_, size, Real(0));
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
  ::operator delete(data_, kMatrixAlignment);
}

template class FactorMemory<double>;
template class FactorMemory<float>;

}  // namespace holba
