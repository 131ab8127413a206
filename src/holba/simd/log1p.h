// SPDX-License-Identifier: BSD-3-Clause
// log(1 + x) of packs, relative error below 1e-15 for every x > -1. Only for X_simd.cc files.
//
// 1 + x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)); what rounding lost in 1 + x comes back as
// a correction of first order. log(1 + f) = 2 atanh(s), s = f / (2 + f), |s| < 0.172, by the
// series.
#pragma once

#include <cstdint>

#include "holba/simd/pack.h"

namespace holba::HOLBA_SIMD_TARGET {

HOLBA_SIMD_INLINE Pack Log1p(Pack x) {
  const Pack u = 1.0 + x;
  // The exponent counted from sqrt(1/2): the bits of u / sqrt(1/2) without rounding.
  constexpr int64_t kOne = 0x3ff0000000000000, kRootHalf = 0x3fe6a09e667f3bcd;
  constexpr int64_t kMantissa = 0x000fffffffffffff;
  const Int shifted = Bits(u) + (kOne - kRootHalf);
  const Int k = (shifted >> 52) - 1023;
  const Pack m = FromBits((shifted & kMantissa) + kRootHalf);
  // An integer below 2^51 added to the bits of 1.5 * 2^52 is added to the number.
  constexpr int64_t kMagicBits = 0x4338000000000000;
  const Pack exponent = FromBits(k + kMagicBits) - 6755399441055744.0;

  const Mask near_one = exponent == 0.0;
  const Pack lost = Select(x >= 1.0, 1.0 - (u - x), x - (u - 1.0)) / u;
  const Pack f = Select(near_one, x, m - 1.0);
  const Pack correction = Select(near_one, Pack{}, lost);

  const Pack s = f / (2.0 + f);
  const Pack z = s * s;
  Pack series = Broadcast(2.0 / 21.0);
  series = Fma(series, z, Broadcast(2.0 / 19.0));
  series = Fma(series, z, Broadcast(2.0 / 17.0));
  series = Fma(series, z, Broadcast(2.0 / 15.0));
  series = Fma(series, z, Broadcast(2.0 / 13.0));
  series = Fma(series, z, Broadcast(2.0 / 11.0));
  series = Fma(series, z, Broadcast(2.0 / 9.0));
  series = Fma(series, z, Broadcast(2.0 / 7.0));
  series = Fma(series, z, Broadcast(2.0 / 5.0));
  series = Fma(series, z, Broadcast(2.0 / 3.0));
  // log 2 in two parts, the first with trailing zeros, so that its product with k is exact.
  constexpr double kLog2High = 0x1.62e42feep-1, kLog2Low = 0x1.a39ef35793c76p-33;
  const Pack low = exponent * kLog2Low + correction;
  const Pack log = exponent * kLog2High + (f - (s * (f - z * series) - low));

  const Pack infinity = Broadcast(__builtin_inf());
  const Pack at_the_end = Select(x == -1.0, -infinity, Broadcast(__builtin_nan("")));
  return Select(x == infinity, infinity, Select(x > -1.0, log, at_the_end));
}

}  // namespace holba::HOLBA_SIMD_TARGET
