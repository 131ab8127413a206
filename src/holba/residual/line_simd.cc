// SPDX-License-Identifier: BSD-3-Clause
// The residuals of lines, in packs, for observations that do not move with the intrinsics: line
// (line.h), group_line on planes (group_line.h), wireframe_line, wireframe_point and vp.
#include "holba/residual/formulas.h"
#include "holba/residual/pack_io.h"
#include "holba/residual/vectorised.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

HOLBA_SIMD_INLINE bool AnyJacobian(const VectorWork& work) {
  return work.jacobians[0] != nullptr || work.jacobians[1] != nullptr ||
         work.jacobians[2] != nullptr || work.jacobians[3] != nullptr;
}

// fx, fy, cx, cy of the camera in slot 2.
struct Calibrations {
  const CalibrationIdxs& idxs;
  bool common;
  CalibrationFormulas<Pack> k{};

  HOLBA_SIMD_INLINE Calibrations(const VectorWork& work, const CalibrationIdxs& calibration)
      : idxs(calibration), common(IsCommon(work, 2)) {
    if (!common) return;
    const double* params = work.state + OffsetOf(work, work.residual(0), 2);
    k = {Broadcast(params[idxs.fx]), Broadcast(params[idxs.fy]), Broadcast(params[idxs.cx]),
         Broadcast(params[idxs.cy])};
  }
  HOLBA_SIMD_INLINE void Load(const VectorWork& work, const PackOfResiduals& pack) {
    if (common) return;
    int64_t idx[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      idx[lane] = static_cast<int64_t>(OffsetOf(work, pack.residual[lane], 2));
    }
    k = {Gather(work.state + idxs.fx, idx), Gather(work.state + idxs.fy, idx),
         Gather(work.state + idxs.cx, idx), Gather(work.state + idxs.cy, idx)};
  }
  // Rows of the Jacobian by the parameters, from those by (fx, fy, cx, cy).
  HOLBA_SIMD_INLINE void StoreRows(const VectorWork& work, const PackOfResiduals& pack,
                                   Mask present, const Pack* by_calibration, int first_row,
                                   int rows) const {
    double* jacobian = work.jacobians[2];
    if (jacobian == nullptr) return;
    const int column_of[4] = {idxs.fx, idxs.fy, idxs.cx, idxs.cy};
    for (int row = 0; row < rows; ++row) {
      double* to = jacobian + (first_row + row) * idxs.num_params * work.stride + pack.j;
      for (int c = 0; c < idxs.num_params; ++c) Store(Pack{}, to + c * work.stride);
      for (int c = 0; c < 4; ++c) {
        double* entry = to + column_of[c] * work.stride;
        const Pack more = Select(present, by_calibration[4 * row + c], Pack{});
        Store(holba::HOLBA_SIMD_TARGET::Load(entry) + more, entry);
      }
    }
  }
};

template <bool kSensors, bool kJacobians>
void Lines(const CalibrationIdxs& calibration, const VectorWork& work) {
  using Layout = SegmentDatumLayout;
  Calibrations calibrations(work, calibration);
  for (size_t j = 0; j < work.count; j += kLanes) {
    const PackOfResiduals pack(work, j);
    Pack block[6], ends[2][2];
    GatherSlot<6>(work, pack, 0, block);
    GatherData<2>(work, pack, Layout::kStart, ends[0]);
    GatherData<2>(work, pack, Layout::kEnd, ends[1]);
    calibrations.Load(work, pack);
    const auto view = LoadView<kSensors>(work, pack, Layout::kSensor);
    LineFormulas<Pack> line;
    line.Set(block);
    LineInView<Pack, kSensors> image;
    image.Set(calibrations.k, view, line.d, line.m);
    const Mask present =
        WhereSet(work, pack, Layout::kStartValid, Layout::kEndValid) & HasDirectionInImage(image.l);
    StorePresent(work, pack, present);
    if constexpr (kJacobians) line.SetBasis();
    for (int e = 0; e < 2; ++e) {
      PerpendicularFormulas<Pack> rho;
      rho.Set(image.l, ends[e], kJacobians);
      StoreEntries(work, pack, present, rho.value, 2, work.residuals + 2 * e * work.stride);
      if constexpr (kJacobians) {
        Pack by_line[8], by_pose[12], by_calibration[8];
        for (int row = 0; row < 2; ++row) {
          Pack by_d[3], by_m[3];
          image.Pull(calibrations.k, view, rho.by_l + 3 * row, by_d, by_m, by_pose + 6 * row,
                     by_calibration + 4 * row);
          line.Pull(by_d, by_m, by_line + 4 * row);
        }
        StoreRows(work, pack, present, by_line, 2 * e, 2, 4, work.jacobians[0]);
        StoreRows(work, pack, present, by_pose, 2 * e, 2, 6, work.jacobians[1]);
        calibrations.StoreRows(work, pack, present, by_calibration, 2 * e, 2);
      }
    }
  }
}

template <bool kSensors, bool kJacobians>
void LinesOnPlanes(const CalibrationIdxs& calibration, double min_sine, const VectorWork& work) {
  using Layout = SegmentDatumLayout;
  Calibrations calibrations(work, calibration);
  for (size_t j = 0; j < work.count; j += kLanes) {
    const PackOfResiduals pack(work, j);
    Pack block[6], g[4], ends[2][2];
    GatherSlot<6>(work, pack, 0, block);
    GatherSlot<4>(work, pack, 3, g);
    GatherData<2>(work, pack, Layout::kStart, ends[0]);
    GatherData<2>(work, pack, Layout::kEnd, ends[1]);
    calibrations.Load(work, pack);
    const auto view = LoadView<kSensors>(work, pack, Layout::kSensor);
    LineFormulas<Pack> line;
    line.Set(block);
    PlaneFormulas<Pack> plane;
    plane.Set(g);
    Pack on_d[3], on_m[3];
    typename PlaneFormulas<Pack>::LineOnTheWay way;
    Mask present = plane.ProjectLine(line.d, line.m, min_sine, on_d, on_m, &way);
    LineInView<Pack, kSensors> a, b;
    a.Set(calibrations.k, view, line.d, line.m);
    b.Set(calibrations.k, view, on_d, on_m);
    present = present & WhereSet(work, pack, Layout::kStartValid, Layout::kEndValid) &
              HasDirectionInImage(a.l) & HasDirectionInImage(b.l);
    StorePresent(work, pack, present);
    if constexpr (kJacobians) {
      line.SetBasis();
      plane.SetBasis();
    }
    for (int e = 0; e < 2; ++e) {
      PerpendicularFormulas<Pack> rho_a, rho_b;
      rho_a.Set(a.l, ends[e], kJacobians);
      rho_b.Set(b.l, ends[e], kJacobians);
      const Pack r[2] = {rho_a.value[0] - rho_b.value[0], rho_a.value[1] - rho_b.value[1]};
      StoreEntries(work, pack, present, r, 2, work.residuals + 2 * e * work.stride);
      if constexpr (kJacobians) {
        Pack by_line[8], by_pose[12], by_calibration[8], by_group[6];
        for (int row = 0; row < 2; ++row) {
          Pack by_d[3], by_m[3], by_on_d[3], by_on_m[3], back_d[3], back_m[3], pose_b[6],
              calibration_b[4];
          Pack *pose_row = by_pose + 6 * row, *calibration_row = by_calibration + 4 * row,
               *group_row = by_group + 3 * row;
          a.Pull(calibrations.k, view, rho_a.by_l + 3 * row, by_d, by_m, pose_row, calibration_row);
          b.Pull(calibrations.k, view, rho_b.by_l + 3 * row, by_on_d, by_on_m, pose_b,
                 calibration_b);
          plane.PullLine(by_on_d, by_on_m, way, back_d, back_m, group_row);
          for (int i = 0; i < 3; ++i) {
            by_d[i] -= back_d[i];
            by_m[i] -= back_m[i];
            group_row[i] = -group_row[i];
          }
          for (int i = 0; i < 6; ++i) pose_row[i] -= pose_b[i];
          for (int i = 0; i < 4; ++i) calibration_row[i] -= calibration_b[i];
          line.Pull(by_d, by_m, by_line + 4 * row);
        }
        StoreRows(work, pack, present, by_line, 2 * e, 2, 4, work.jacobians[0]);
        StoreRows(work, pack, present, by_pose, 2 * e, 2, 6, work.jacobians[1]);
        calibrations.StoreRows(work, pack, present, by_calibration, 2 * e, 2);
        StoreRows(work, pack, present, by_group, 2 * e, 2, 3, work.jacobians[3]);
      }
    }
  }
}

template <bool kSensors, bool kJacobians>
void WireframePoints(const CalibrationIdxs& calibration, const VectorWork& work) {
  using Layout = SegmentDatumLayout;
  Calibrations calibrations(work, calibration);
  for (size_t j = 0; j < work.count; j += kLanes) {
    const PackOfResiduals pack(work, j);
    Pack X[3], start[2], end[2];
    GatherSlot<3>(work, pack, 0, X);
    GatherData<2>(work, pack, Layout::kStart, start);
    GatherData<2>(work, pack, Layout::kEnd, end);
    calibrations.Load(work, pack);
    const auto view = LoadView<kSensors>(work, pack, Layout::kSensor);
    DistanceFromSegment<Pack, kSensors> distance{};
    const Mask present = WhereSet(work, pack, Layout::kStartValid, Layout::kEndValid) &
                         distance.Set(calibrations.k, view, X, start, end, kJacobians);
    StorePresent(work, pack, present);
    StoreEntries(work, pack, present, &distance.value, 1, work.residuals);
    if constexpr (kJacobians) {
      StoreRows(work, pack, present, distance.by_point, 0, 1, 3, work.jacobians[0]);
      StoreRows(work, pack, present, distance.by_pose, 0, 1, 6, work.jacobians[1]);
      calibrations.StoreRows(work, pack, present, distance.by_calibration, 0, 1);
    }
  }
}

template <bool kSensors, bool kJacobians>
void WireframeLines(const CalibrationIdxs& calibration, const VectorWork& work) {
  using Layout = ObservationDatumLayout;
  Calibrations calibrations(work, calibration);
  for (size_t j = 0; j < work.count; j += kLanes) {
    const PackOfResiduals pack(work, j);
    Pack block[6], x[2], r, by_l[3];
    GatherSlot<6>(work, pack, 0, block);
    GatherData<2>(work, pack, Layout::kObserved, x);
    calibrations.Load(work, pack);
    const auto view = LoadView<kSensors>(work, pack, Layout::kSensor);
    LineFormulas<Pack> line;
    line.Set(block);
    LineInView<Pack, kSensors> image;
    image.Set(calibrations.k, view, line.d, line.m);
    const Mask present =
        WhereSet(work, pack, Layout::kValid, Layout::kValid) & HasDirectionInImage(image.l);
    DistanceFromLine(image.l, x, &r, by_l);
    StorePresent(work, pack, present);
    StoreEntries(work, pack, present, &r, 1, work.residuals);
    if constexpr (kJacobians) {
      line.SetBasis();
      Pack by_d[3], by_m[3], by_line[4], by_pose[6], by_calibration[4];
      image.Pull(calibrations.k, view, by_l, by_d, by_m, by_pose, by_calibration);
      line.Pull(by_d, by_m, by_line);
      StoreRows(work, pack, present, by_line, 0, 1, 4, work.jacobians[0]);
      StoreRows(work, pack, present, by_pose, 0, 1, 6, work.jacobians[1]);
      calibrations.StoreRows(work, pack, present, by_calibration, 0, 1);
    }
  }
}

}  // namespace

// Calls the variant of a kernel that the range needs.
#define HOLBA_EVALUATE(Kernel, sensor_at, ...)                                               \
  const bool sensors = AnyPointer(work, sensor_at), jacobians = AnyJacobian(work);           \
  sensors ? (jacobians ? Kernel<true, true>(__VA_ARGS__) : Kernel<true, false>(__VA_ARGS__)) \
          : (jacobians ? Kernel<false, true>(__VA_ARGS__) : Kernel<false, false>(__VA_ARGS__))

void EvaluateLines(const CalibrationIdxs& calibration, const VectorWork& work) {
  HOLBA_EVALUATE(Lines, SegmentDatumLayout::kSensor, calibration, work);
}

void EvaluateLinesOnPlanes(const CalibrationIdxs& calibration, double min_sine,
                           const VectorWork& work) {
  HOLBA_EVALUATE(LinesOnPlanes, SegmentDatumLayout::kSensor, calibration, min_sine, work);
}

void EvaluateWireframePoints(const CalibrationIdxs& calibration, const VectorWork& work) {
  HOLBA_EVALUATE(WireframePoints, SegmentDatumLayout::kSensor, calibration, work);
}

void EvaluateWireframeLines(const CalibrationIdxs& calibration, const VectorWork& work) {
  HOLBA_EVALUATE(WireframeLines, ObservationDatumLayout::kSensor, calibration, work);
}

#undef HOLBA_EVALUATE

void EvaluateVanishingPoints(const VectorWork& work) {
  for (size_t j = 0; j < work.count; j += kLanes) {
    const PackOfResiduals pack(work, j);
    Pack d[3], v[3], r[3];
    GatherSlot<3>(work, pack, 0, d);
    GatherSlot<3>(work, pack, 1, v);
    const Mask present = AllTrue<Pack>();
    Cross(d, v, r);
    StorePresent(work, pack, present);
    StoreEntries(work, pack, present, r, 3, work.residuals);
    Pack first[3], second[3], a[3], b[3];
    if (work.jacobians[0] != nullptr) {
      TangentBasisColumns(d, first, second);
      Cross(first, v, a);
      Cross(second, v, b);
      const Pack by_line[12] = {a[0],   b[0],   Pack{}, Pack{}, a[1],   b[1],
                                Pack{}, Pack{}, a[2],   b[2],   Pack{}, Pack{}};
      StoreEntries(work, pack, present, by_line, 12, work.jacobians[0]);
    }
    if (work.jacobians[1] != nullptr) {
      TangentBasisColumns(v, first, second);
      Cross(d, first, a);
      Cross(d, second, b);
      const Pack by_group[6] = {a[0], b[0], a[1], b[1], a[2], b[2]};
      StoreEntries(work, pack, present, by_group, 6, work.jacobians[1]);
    }
  }
}

}  // namespace holba::HOLBA_SIMD_TARGET
