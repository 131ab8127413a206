// SPDX-License-Identifier: BSD-3-Clause
// From a VectorWork into packs and back: parameters and measurements of kLanes residuals side by
// side, results into the panel. Only for X_simd.cc files (simd/targets.h).
#pragma once

#include <cstdint>

#include "holba/problem/vector_work.h"
#include "holba/residual/formulas.h"
#include "holba/simd/pack.h"
#include "holba/simd/rows.h"

namespace holba::HOLBA_SIMD_TARGET {

// Residuals j, j + 1, ... of the range; beyond its end the last one is repeated.
struct PackOfResiduals {
  size_t j;
  int64_t residual[kLanes];

  HOLBA_SIMD_INLINE PackOfResiduals(const VectorWork& work, size_t first) : j(first) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const size_t at = first + lane < work.count ? first + lane : work.count - 1;
      residual[lane] = static_cast<int64_t>(work.residual(at));
    }
  }
};

HOLBA_SIMD_INLINE size_t OffsetOf(const VectorWork& work, int64_t residual, int slot) {
  return work.offsets[work.blocks[residual * work.num_slots + slot]];
}

// N parameters of a slot of each residual.
template <int N>
HOLBA_SIMD_INLINE void GatherSlot(const VectorWork& work, const PackOfResiduals& pack, int slot,
                                  Pack* out) {
  int64_t idx[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    idx[lane] = static_cast<int64_t>(OffsetOf(work, pack.residual[lane], slot));
  }
  LoadRows<N>(work.state, idx, out);
}

// Whether all residuals of the range have the same block in a slot.
HOLBA_SIMD_INLINE bool IsCommon(const VectorWork& work, int slot) {
  const uint32_t first = work.blocks[work.residual(0) * work.num_slots + slot];
  for (size_t j = 1; j < work.count; ++j) {
    if (work.blocks[work.residual(j) * work.num_slots + slot] != first) return false;
  }
  return true;
}

// A slot whose residuals often have the same block: its values are spread over the lanes once.
template <int N>
struct CommonSlot {
  int slot;
  bool common;
  Pack values[N];

  HOLBA_SIMD_INLINE CommonSlot(const VectorWork& work, int slot_idx)
      : slot(slot_idx), common(IsCommon(work, slot_idx)) {
    if (!common) return;
    const double* block = work.state + OffsetOf(work, work.residual(0), slot);
    for (int k = 0; k < N; ++k) values[k] = Broadcast(block[k]);
  }
  HOLBA_SIMD_INLINE void Load(const VectorWork& work, const PackOfResiduals& pack) {
    if (!common) GatherSlot<N>(work, pack, slot, values);
  }
};

// N doubles at byte `at` of each datum.
template <int N>
HOLBA_SIMD_INLINE void GatherData(const VectorWork& work, const PackOfResiduals& pack, size_t at,
                                  Pack* out) {
  const int64_t stride = static_cast<int64_t>(work.datum_bytes / sizeof(double));
  int64_t idx[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) idx[lane] = pack.residual[lane] * stride;
  LoadRows<N>(static_cast<const double*>(work.data) + at / sizeof(double), idx, out);
}

HOLBA_SIMD_INLINE const char* DatumByte(const VectorWork& work, int64_t residual, size_t at) {
  return static_cast<const char*>(work.data) + residual * work.datum_bytes + at;
}

// Lanes whose datum has a nonzero byte (a bool) at both places.
HOLBA_SIMD_INLINE Mask WhereSet(const VectorWork& work, const PackOfResiduals& pack, size_t at,
                                size_t and_at) {
  double set[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    set[lane] = *DatumByte(work, pack.residual[lane], at) != 0 &&
                *DatumByte(work, pack.residual[lane], and_at) != 0;
  }
  return Load(set) != 0.0;
}

// The pointer (to doubles) at byte `at` of a datum.
HOLBA_SIMD_INLINE const double* DatumPointer(const VectorWork& work, int64_t residual, size_t at) {
  const double* pointer;
  __builtin_memcpy(&pointer, DatumByte(work, residual, at), sizeof(pointer));
  return pointer;
}

HOLBA_SIMD_INLINE bool AnyPointer(const VectorWork& work, size_t at) {
  for (size_t j = 0; j < work.count; ++j) {
    if (DatumPointer(work, static_cast<int64_t>(work.residual(j)), at) != nullptr) return true;
  }
  return false;
}

constexpr double kIdentity[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};

// 12 doubles of each sensor pose (column-major rotation, translation); null: the identity.
HOLBA_SIMD_INLINE void GatherSensors(const VectorWork& work, const PackOfResiduals& pack, size_t at,
                                     Pack* out) {
  int64_t idx[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    const double* sensor = DatumPointer(work, pack.residual[lane], at);
    if (sensor == nullptr) sensor = kIdentity;
    idx[lane] = (reinterpret_cast<intptr_t>(sensor) - reinterpret_cast<intptr_t>(kIdentity)) /
                static_cast<int64_t>(sizeof(double));
  }
  LoadRows<12>(kIdentity, idx, out);
}

// The poses of slot 1, or those that stand in for them. One load for both: a branch around the load
// would change how the compiler fuses what follows, and with it the last bits.
HOLBA_SIMD_INLINE void GatherPoses(const VectorWork& work, const PackOfResiduals& pack, Pack* out) {
  const bool own = work.poses != nullptr;
  int64_t idx[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) {
    const size_t at = pack.j + lane < work.count ? pack.j + lane : work.count - 1;
    idx[lane] = static_cast<int64_t>(own ? 7 * at : OffsetOf(work, pack.residual[lane], 1));
  }
  LoadRows<7>(own ? work.poses : work.state, idx, out);
}

// The views of slot 1, with the sensor at that byte of the datum.
template <bool kSensors>
HOLBA_SIMD_INLINE ViewFormulas<Pack, kSensors> LoadView(const VectorWork& work,
                                                        const PackOfResiduals& pack,
                                                        size_t sensor_at) {
  ViewFormulas<Pack, kSensors> view;
  Pack pose[7];
  GatherPoses(work, pack, pose);
  view.SetPose(pose);
  if constexpr (kSensors) {
    Pack sensor[12];
    GatherSensors(work, pack, sensor_at, sensor);
    view.SetSensor(sensor, sensor + 9);
  }
  return view;
}

// Entries 0 .. num - 1 of the panel; where the residual is absent, 0.
HOLBA_SIMD_INLINE void StoreEntries(const VectorWork& work, const PackOfResiduals& pack,
                                    Mask present, const Pack* values, int num, double* panel) {
  if (panel == nullptr) return;
  for (int k = 0; k < num; ++k) {
    Store(Select(present, values[k], Pack{}), panel + k * work.stride + pack.j);
  }
}

// Rows first_row, ... of a Jacobian with that many columns.
HOLBA_SIMD_INLINE void StoreRows(const VectorWork& work, const PackOfResiduals& pack, Mask present,
                                 const Pack* values, int first_row, int rows, int columns,
                                 double* jacobian) {
  if (jacobian == nullptr) return;
  StoreEntries(work, pack, present, values, rows * columns,
               jacobian + first_row * columns * work.stride);
}

HOLBA_SIMD_INLINE void StorePresent(const VectorWork& work, const PackOfResiduals& pack,
                                    Mask present) {
#if defined(__AVX512F__)
  if (pack.j + kLanes <= work.count) {
    const __m128i bytes = _mm512_maskz_cvtepi64_epi8(0xff, reinterpret_cast<__m512i>(present & 1));
    __builtin_memcpy(work.present + pack.j, &bytes, kLanes);
    return;
  }
#endif
  for (int lane = 0; lane < kLanes && pack.j + lane < work.count; ++lane) {
    work.present[pack.j + lane] = MaskLane(present, lane);
  }
}

}  // namespace holba::HOLBA_SIMD_TARGET
