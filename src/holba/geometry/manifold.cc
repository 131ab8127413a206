// SPDX-License-Identifier: BSD-3-Clause
#include "holba/geometry/manifold.h"

#include <array>
#include <utility>

#include "holba/base/check.h"

namespace holba {

const ManifoldOps& EuclideanOps(int size) {
  constexpr int kLargest = 16;
  static const auto table = []<int... I>(std::integer_sequence<int, I...>) {
    return std::array<const ManifoldOps*, sizeof...(I)>{&OpsOf<Euclidean<I + 1>>()...};
  }(std::make_integer_sequence<int, kLargest>());
  HOLBA_CHECK_MSG(size >= 1 && size <= kLargest, std::to_string(size));
  return *table[size - 1];
}

}  // namespace holba
