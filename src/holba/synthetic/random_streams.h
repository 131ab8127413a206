// SPDX-License-Identifier: BSD-3-Clause
// Random numbers of the makers of synthetic scenes.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "holba/base/random.h"

namespace holba {

// Independent streams of one seed, so that an option of one does not change what the others draw.
// The numbers of streams: bundle problems from 1, graphs of points from 101, scenes on a sphere
// 201, in a street 301, of a collection 401, pairs of photographs 501, sets of photographs 601.
template <typename Stream>
uint64_t SeedOfStream(uint64_t seed, Stream stream) {
  return seed * 0xda942042e4dd58b5ULL + static_cast<uint64_t>(stream);
}
template <typename Stream>
Random StreamOf(uint64_t seed, Stream stream) {
  return Random(SeedOfStream(seed, stream));
}

inline Eigen::Vector3d NormalVector(double sigma, Random* random) {
  Eigen::Vector3d v;
  for (double& x : v) x = random->Normal(sigma);
  return v;
}

// Pareto distributed: P(x > t) = t^-exponent, 1 <= t < high.
inline double PowerLaw(double exponent, double high, Random* random) {
  return std::min(std::pow(1.0 - random->Uniform(), -1.0 / exponent), high);
}

}  // namespace holba
