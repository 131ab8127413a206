// SPDX-License-Identifier: BSD-3-Clause
// The residuals of points through the cameras of vectorised_models.h, in packs: point (point.h),
// group_point on planes (group_point.h).
#include "holba/camera/snavely.h"
#include "holba/camera/vectorised_models.h"
#include "holba/residual/formulas.h"
#include "holba/residual/pack_io.h"
#include "holba/residual/vectorised.h"

namespace holba::HOLBA_SIMD_TARGET {
namespace {

template <typename Model>
struct PackCamera {
  const Pack* params;
  HOLBA_SIMD_INLINE Mask Project(const Pack* in_cam, Pack* pixel, Pack* d_point,
                                 Pack* d_params) const {
    return Model::ProjectNormalised(params, in_cam, pixel, d_point, d_params);
  }
};

template <typename Model, bool kSensors, bool kJacobians>
struct Points {
  static void Evaluate(const VectorWork& work) {
    constexpr int kNumParams = Model::kNumParams;
    CommonSlot<kNumParams> params(work, 2);
    const bool by_params = kJacobians && work.jacobians[2] != nullptr;
    for (size_t j = 0; j < work.count; j += kLanes) {
      const PackOfResiduals pack(work, j);
      Pack X[3], observed[2], pixel[2] = {}, by_point[6], by_pose[12], d_params[2 * kNumParams];
      GatherSlot<3>(work, pack, 0, X);
      params.Load(work, pack);
      GatherData<2>(work, pack, PointDatumLayout::kObserved, observed);
      const auto view = LoadView<kSensors>(work, pack, PointDatumLayout::kSensor);
      const Mask present =
          SeePixel(PackCamera<Model>{params.values}, view, X, pixel,
                   kJacobians ? by_point : nullptr, by_pose, by_params ? d_params : nullptr);
      for (int i = 0; i < 2; ++i) pixel[i] -= observed[i];
      StorePresent(work, pack, present);
      StoreEntries(work, pack, present, pixel, 2, work.residuals);
      if constexpr (kJacobians) {
        StoreEntries(work, pack, present, by_point, 6, work.jacobians[0]);
        StoreEntries(work, pack, present, by_pose, 12, work.jacobians[1]);
        if (by_params) {
          StoreEntries(work, pack, present, d_params, 2 * kNumParams, work.jacobians[2]);
        }
      }
    }
  }
};

template <typename Model, bool kSensors, bool kJacobians>
struct PointsOnPlanes {
  static void Evaluate(const VectorWork& work) {
    constexpr int kNumParams = Model::kNumParams;
    CommonSlot<kNumParams> params(work, 2);
    const bool by_params = kJacobians && work.jacobians[2] != nullptr;
    for (size_t j = 0; j < work.count; j += kLanes) {
      const PackOfResiduals pack(work, j);
      Pack X[3], g[4], on_plane[3];
      GatherSlot<3>(work, pack, 0, X);
      GatherSlot<4>(work, pack, 3, g);
      params.Load(work, pack);
      const auto view = LoadView<kSensors>(work, pack, 0);
      const PackCamera<Model> camera{params.values};
      PlaneFormulas<Pack> plane;
      plane.Set(g);
      typename PlaneFormulas<Pack>::PointOnTheWay way;
      Mask present = plane.ProjectPoint(X, on_plane, &way);
      Pack r[2] = {}, r_on[2] = {}, by_point[6], by_on[6], by_pose[12], by_pose_on[12];
      Pack d_params[2 * kNumParams], d_params_on[2 * kNumParams], by_group[6];
      present = present & SeePixel(camera, view, X, r, kJacobians ? by_point : nullptr, by_pose,
                                   by_params ? d_params : nullptr);
      present = present & SeePixel(camera, view, on_plane, r_on, kJacobians ? by_on : nullptr,
                                   by_pose_on, by_params ? d_params_on : nullptr);
      for (int i = 0; i < 2; ++i) r[i] -= r_on[i];
      StorePresent(work, pack, present);
      StoreEntries(work, pack, present, r, 2, work.residuals);
      if constexpr (kJacobians) {
        plane.SetBasis();
        for (int row = 0; row < 2; ++row) {
          Pack by_original[3];
          plane.PullPoint(by_on + 3 * row, way, by_original, by_group + 3 * row);
          for (int i = 0; i < 3; ++i) {
            by_point[3 * row + i] -= by_original[i];
            by_group[3 * row + i] = -by_group[3 * row + i];
          }
        }
        for (int i = 0; i < 12; ++i) by_pose[i] -= by_pose_on[i];
        StoreEntries(work, pack, present, by_point, 6, work.jacobians[0]);
        StoreEntries(work, pack, present, by_pose, 12, work.jacobians[1]);
        if (by_params) {
          for (int i = 0; i < 2 * kNumParams; ++i) d_params[i] -= d_params_on[i];
          StoreEntries(work, pack, present, d_params, 2 * kNumParams, work.jacobians[2]);
        }
        StoreEntries(work, pack, present, by_group, 6, work.jacobians[3]);
      }
    }
  }
};

template <template <typename, bool, bool> typename Kernel, typename Model>
void EvaluateModel(size_t sensor_at, const VectorWork& work) {
  const bool jacobians = work.jacobians[0] != nullptr || work.jacobians[1] != nullptr ||
                         work.jacobians[2] != nullptr || work.jacobians[3] != nullptr;
  if (AnyPointer(work, sensor_at)) {
    jacobians ? Kernel<Model, true, true>::Evaluate(work)
              : Kernel<Model, true, false>::Evaluate(work);
  } else {
    jacobians ? Kernel<Model, false, true>::Evaluate(work)
              : Kernel<Model, false, false>::Evaluate(work);
  }
}

template <template <typename, bool, bool> typename Kernel, typename... Models>
bool EvaluateAmong(CameraModelList<Models...>, int model_id, size_t sensor_at,
                   const VectorWork& work) {
  if (model_id == kSnavelyModel) {
    EvaluateModel<Kernel, Snavely>(sensor_at, work);
    return true;
  }
  return ((model_id == Models::kModelId ? (EvaluateModel<Kernel, Models>(sensor_at, work), true)
                                        : false) ||
          ...);
}

}  // namespace

bool EvaluatePoints(int model_id, const VectorWork& work) {
  return EvaluateAmong<Points>(VectorisedCameraModels(), model_id, PointDatumLayout::kSensor, work);
}

bool EvaluatePointsOnPlanes(int model_id, const VectorWork& work) {
  return EvaluateAmong<PointsOnPlanes>(VectorisedCameraModels(), model_id, 0, work);
}

}  // namespace holba::HOLBA_SIMD_TARGET
