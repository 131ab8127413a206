// SPDX-License-Identifier: BSD-3-Clause
// The residuals that are evaluated in packs (X_simd.cc), as plain functions: no type of another
// library appears, so that files compiled for wide registers can include this. Layouts are those of
// the kernels' data; the kernels assert them (vectorised.cc).
#pragma once

#include "holba/problem/vector_work.h"
#include "holba/simd/targets.h"

namespace holba {

// Which parameters of a camera are fx, fy, cx, cy of its ideal pixels.
struct CalibrationIdxs {
  int num_params, fx, fy, cx, cy;
};

// Bytes of the kernels' data. Sensors are pointers to a column-major rotation and a translation.
struct PointDatumLayout {
  static constexpr size_t kObserved = 0, kSensor = 16, kBytes = 32;
};
struct SegmentDatumLayout {
  static constexpr size_t kStart = 16, kStartValid = 32, kEnd = 64, kEndValid = 80, kSensor = 96,
                          kBytes = 112;
};
struct ObservationDatumLayout {
  static constexpr size_t kObserved = 16, kValid = 32, kSensor = 48, kBytes = 64;
};

// model_id of the camera of BAL files, which has none of COLMAP's.
inline constexpr int kSnavelyModel = -1;

// False: this camera is not vectorised; nothing was done.
HOLBA_SIMD_DECLARE(bool EvaluatePoints(int model_id, const VectorWork& work))
HOLBA_SIMD_DECLARE(bool EvaluatePointsOnPlanes(int model_id, const VectorWork& work))
HOLBA_SIMD_DECLARE(void EvaluateLines(const CalibrationIdxs& calibration, const VectorWork& work))
// min_sine: of the angle from a line to the normal below which it has no projection.
HOLBA_SIMD_DECLARE(void EvaluateLinesOnPlanes(const CalibrationIdxs& calibration, double min_sine,
                                              const VectorWork& work))
HOLBA_SIMD_DECLARE(void EvaluateWireframePoints(const CalibrationIdxs& calibration,
                                                const VectorWork& work))
HOLBA_SIMD_DECLARE(void EvaluateWireframeLines(const CalibrationIdxs& calibration,
                                               const VectorWork& work))
HOLBA_SIMD_DECLARE(void EvaluateVanishingPoints(const VectorWork& work))

}  // namespace holba
