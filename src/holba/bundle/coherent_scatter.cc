// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/coherent_scatter.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace holba {
namespace {

constexpr size_t kMinInBlock = 4;
// Fewer blocks than this hardly have a variance.
constexpr size_t kMinBlocks = 8;

// 95 % quantile of the chi-square distribution (Wilson and Hilferty 1931).
double LargeChiSquare(double degrees_of_freedom) {
  const double a = 2.0 / (9.0 * degrees_of_freedom);
  return degrees_of_freedom * std::pow(1.0 - a + 1.645 * std::sqrt(a), 3);
}

// Splits each block at the median of its longest axis.
void Halve(std::vector<std::span<MemberOffset>>* blocks) {
  std::vector<std::span<MemberOffset>> halves;
  halves.reserve(2 * blocks->size());
  for (const std::span<MemberOffset> block : *blocks) {
    Eigen::AlignedBox3d box;
    for (const MemberOffset& member : block) box.extend(member.X);
    Eigen::Index axis;
    box.sizes().maxCoeff(&axis);
    const size_t middle = block.size() / 2;
    std::nth_element(
        block.begin(), block.begin() + static_cast<std::ptrdiff_t>(middle), block.end(),
        [axis](const MemberOffset& a, const MemberOffset& b) { return a.X[axis] < b.X[axis]; });
    halves.push_back(block.first(middle));
    halves.push_back(block.subspan(middle));
  }
  *blocks = std::move(halves);
}

}  // namespace

double CoherentVariance(int unknowns, std::vector<MemberOffset>* members) {
  double greatest = 0.0;
  std::vector<std::span<MemberOffset>> blocks = {*members};
  while (members->size() / (2 * blocks.size()) >= kMinInBlock) {
    Halve(&blocks);
    const double degrees_of_freedom = static_cast<double>(blocks.size()) - unknowns;
    if (blocks.size() < kMinBlocks || degrees_of_freedom < 1.0) continue;
    double sum = 0.0;
    for (const std::span<MemberOffset> block : blocks) {
      Eigen::Vector3d of_block = Eigen::Vector3d::Zero();
      for (const MemberOffset& member : block) of_block += member.offset;
      sum += of_block.squaredNorm() / static_cast<double>(block.size());
    }
    greatest = std::max(greatest, sum / LargeChiSquare(degrees_of_freedom));
  }
  return greatest;
}

}  // namespace holba
