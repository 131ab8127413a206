// SPDX-License-Identifier: BSD-3-Clause
// weigh.h in packs.
#include "holba/problem/weigh_vectorised.h"
#include "holba/simd/log1p.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

// As many residuals at a time as keep their factors in the first cache beside a row of the panel.
constexpr size_t kChunk = 128;

// rho and rho' at s >= 0 (loss.cc); a2 = scale^2.
template <LossType kType>
HOLBA_SIMD_INLINE void EvaluateLoss(Pack s, double scale, Pack* rho, Pack* slope) {
  const double a2 = scale * scale;
  if constexpr (kType == LossType::kHuber) {
    const Mask outside = s > a2;
    const Pack r = Sqrt(s);
    *rho = Select(outside, 2.0 * scale * r - a2, s);
    *slope = Select(outside, scale / r, Broadcast(1.0));
  } else if constexpr (kType == LossType::kSoftL1) {
    const Pack root = Sqrt(1.0 + s / a2);
    *rho = 2.0 * s / (root + 1.0);
    *slope = 1.0 / root;
  } else if constexpr (kType == LossType::kCauchy) {
    const Pack ratio = s / a2;
    *rho = a2 * Log1p(ratio);
    *slope = 1.0 / (1.0 + ratio);
  } else {
    *rho = s;
    *slope = Broadcast(1.0);
  }
}

HOLBA_SIMD_INLINE void Multiply(const double* factors, size_t num, double* row) {
  for (size_t j = 0; j < num; j += kLanes) Store(Load(row + j) * Load(factors + j), row + j);
}

template <LossType kType>
void WeighWith(const WeighWork& work, bool multiply, double* cost, double* sum_squares) {
  multiply = multiply && (kType != LossType::kTrivial || work.weight != 1.0);
  Pack sum_rho{}, sum_s{};
  double lane_numbers[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) lane_numbers[lane] = lane;
  const Pack lanes = Load(lane_numbers);
  alignas(64) double factors[kChunk];
  for (size_t begin = 0; begin < work.count; begin += kChunk) {
    const size_t num = work.count - begin < kChunk ? work.count - begin : kChunk;
    for (size_t j = 0; j < num; j += kLanes) {
      Pack s{};
      for (int k = 0; k < work.dim; ++k) {
        const Pack r = Load(work.residuals + k * work.stride + begin + j);
        s += r * r;
      }
      // Beyond the end of the range there is anything.
      s = Select(lanes < static_cast<double>(num - j), s, Pack{});
      Pack rho, slope;
      EvaluateLoss<kType>(s, work.scale, &rho, &slope);
      sum_rho += rho;
      sum_s += s;
      if (multiply) Store(Sqrt(work.weight * slope), factors + j);
    }
    if (!multiply) continue;
    for (int k = 0; k < work.dim; ++k) {
      Multiply(factors, num, work.residuals + k * work.stride + begin);
    }
    for (int slot = 0; slot < kMaxWeighedSlots; ++slot) {
      if (work.jacobians[slot] == nullptr) continue;
      for (int k = 0; k < work.entries[slot]; ++k) {
        Multiply(factors, num, work.jacobians[slot] + k * work.stride + begin);
      }
    }
  }
  *cost = 0.5 * work.weight * Sum(sum_rho);
  *sum_squares = Sum(sum_s);
}

}  // namespace

void Weigh(const WeighWork& work, bool multiply, double* cost, double* sum_squares) {
  switch (work.loss) {
    case LossType::kTrivial:
      return WeighWith<LossType::kTrivial>(work, multiply, cost, sum_squares);
    case LossType::kHuber:
      return WeighWith<LossType::kHuber>(work, multiply, cost, sum_squares);
    case LossType::kSoftL1:
      return WeighWith<LossType::kSoftL1>(work, multiply, cost, sum_squares);
    case LossType::kCauchy:
      return WeighWith<LossType::kCauchy>(work, multiply, cost, sum_squares);
  }
}

}  // namespace holba::HOLBA_SIMD_TARGET
