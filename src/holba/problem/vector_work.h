// SPDX-License-Identifier: BSD-3-Clause
// A range of residuals as plain pointers, for the files X_simd.cc that evaluate it in packs
// (simd/targets.h: they include nothing that could reach a symbol table).
#pragma once

#include <cstddef>
#include <cstdint>

namespace holba {

// Residuals, parameters and panel as ParameterReader, ResidualRange and ResidualPanel have them.
struct VectorWork {
  const double* state;
  const size_t* offsets;   // into state, by block
  const uint32_t* blocks;  // of residual i and slot s: [i * num_slots + s]
  int num_slots;
  const void* data;  // of residual i: datum_bytes at i * datum_bytes
  size_t datum_bytes;

  size_t begin, count;
  const uint32_t* list;  // null: begin, begin + 1, ...

  size_t stride;  // a multiple of kPanelLanes
  double* residuals;
  double* jacobians[5];  // null: not wanted
  bool* present;

  // Null, or the pose of each residual of the range (7 doubles, as in PoseManifold) that stands in
  // for the block of slot 1.
  const double* poses = nullptr;

  size_t residual(size_t j) const { return list != nullptr ? list[j] : begin + j; }
};

}  // namespace holba
