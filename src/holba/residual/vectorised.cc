// SPDX-License-Identifier: BSD-3-Clause
// Which residuals are evaluated in packs: those with a function in vectorised.h. The others, and
// ranges of one, are evaluated one by one.
#include "holba/residual/vectorised.h"

#include <cstddef>

#include "holba/camera/snavely.h"
#include "holba/group/known_types.h"
#include "holba/group/plane.h"
#include "holba/residual/group_line.h"
#include "holba/residual/group_point.h"
#include "holba/residual/line.h"
#include "holba/residual/point.h"
#include "holba/residual/vanishing_point.h"
#include "holba/residual/wireframe_line.h"
#include "holba/residual/wireframe_point.h"

namespace holba {
namespace {

static_assert(sizeof(SensorPose) == 12 * sizeof(double) &&
              offsetof(SensorPose, translation) == 9 * sizeof(double));

using PointDatum = PointResidual::Datum;
static_assert(offsetof(PointDatum, observed) == PointDatumLayout::kObserved &&
              offsetof(PointDatum, sensor) == PointDatumLayout::kSensor &&
              sizeof(PointDatum) == PointDatumLayout::kBytes);

static_assert(sizeof(GroupPointResidual::Datum) == sizeof(void*));

static_assert(offsetof(SegmentDatum, start.ideal) == SegmentDatumLayout::kStart &&
              offsetof(SegmentDatum, start.valid) == SegmentDatumLayout::kStartValid &&
              offsetof(SegmentDatum, end.ideal) == SegmentDatumLayout::kEnd &&
              offsetof(SegmentDatum, end.valid) == SegmentDatumLayout::kEndValid &&
              offsetof(SegmentDatum, sensor) == SegmentDatumLayout::kSensor &&
              sizeof(SegmentDatum) == SegmentDatumLayout::kBytes);

using ObservationDatum = WireframeLineResidual::Datum;
static_assert(offsetof(ObservationDatum, observed.ideal) == ObservationDatumLayout::kObserved &&
              offsetof(ObservationDatum, observed.valid) == ObservationDatumLayout::kValid &&
              offsetof(ObservationDatum, sensor) == ObservationDatumLayout::kSensor &&
              sizeof(ObservationDatum) == ObservationDatumLayout::kBytes);

int VectorisedModel(const CameraModel& model) {
  return &model == &SnavelyCameraModel() ? kSnavelyModel : model.id;
}

// Calls evaluate(calibration) if the camera of these residuals can be vectorised: K consists of
// parameters, and the observations stand still.
template <typename Evaluate>
bool WithCalibration(const LineCamera& camera, Evaluate&& evaluate) {
  if (camera.observations_move) return false;
  const double no_params[kMaxCameraParams] = {};
  const IdealCalibration k = camera.model->ideal_calibration(no_params);
  if (k.fx_idx < 0 || k.fy_idx < 0 || k.cx_idx < 0 || k.cy_idx < 0) return false;
  evaluate(CalibrationIdxs{camera.model->num_params, k.fx_idx, k.fy_idx, k.cx_idx, k.cy_idx});
  return true;
}

}  // namespace

bool PointResidual::EvaluateVectorised(const VectorWork& work) const {
  return HOLBA_SIMD_CHOOSE(EvaluatePoints)(VectorisedModel(*model), work);
}

bool GroupPointResidual::EvaluateVectorised(const VectorWork& work) const {
  return IsPlane(*type) && HOLBA_SIMD_CHOOSE(EvaluatePointsOnPlanes)(VectorisedModel(*model), work);
}

bool LineResidual::EvaluateVectorised(const VectorWork& work) const {
  return WithCalibration(camera, [&](const CalibrationIdxs& calibration) {
    HOLBA_SIMD_CHOOSE(EvaluateLines)(calibration, work);
  });
}

bool GroupLineResidual::EvaluateVectorised(const VectorWork& work) const {
  return IsPlane(*type) && WithCalibration(camera, [&](const CalibrationIdxs& calibration) {
           HOLBA_SIMD_CHOOSE(EvaluateLinesOnPlanes)(calibration, Plane::kMinLineSine, work);
         });
}

bool WireframePointResidual::EvaluateVectorised(const VectorWork& work) const {
  return WithCalibration(camera, [&](const CalibrationIdxs& calibration) {
    HOLBA_SIMD_CHOOSE(EvaluateWireframePoints)(calibration, work);
  });
}

bool WireframeLineResidual::EvaluateVectorised(const VectorWork& work) const {
  return WithCalibration(camera, [&](const CalibrationIdxs& calibration) {
    HOLBA_SIMD_CHOOSE(EvaluateWireframeLines)(calibration, work);
  });
}

bool VanishingPointResidual::EvaluateVectorised(const VectorWork& work) const {
  if (!IsVanishingPoint(*type)) return false;
  HOLBA_SIMD_CHOOSE(EvaluateVanishingPoints)(work);
  return true;
}

}  // namespace holba
