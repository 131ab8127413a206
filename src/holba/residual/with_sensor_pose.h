// SPDX-License-Identifier: BSD-3-Clause
// A residual of an image whose sensor has a pose of its own in its rig that is adjusted, too. The
// residual itself sees the camera at cam_from_world = sensor_from_rig * rig_from_world; what it
// says about that pose becomes, by the chain rule and here only, what it says about the two.
// Blocks: those of the kernel, whose slot 1 is the pose of the frame, then the pose of the sensor.
//
// With R' = exp(w) R, t' = t + v (PoseManifold) on each of them, sensor (R_s, t_s), rig (R_r, t_r):
//   w_cam = R_s w_r + w_s,   v_cam = R_s v_r + v_s + w_s x (R_s t_r).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "holba/problem/vector_work.h"
#include "holba/residual/view.h"

namespace holba {

// The poses of up to kCount images, and the chain rule for their Jacobians.
template <size_t kCount>
class ChainedPoses {
 public:
  void Set(size_t j, const double* sensor_from_rig, const double* rig_from_world) {
    const double *s = sensor_from_rig, *r = rig_from_world;
    double* cam = cam_from_world_ + 7 * j;
    cam[0] = s[3] * r[0] + s[0] * r[3] + s[1] * r[2] - s[2] * r[1];
    cam[1] = s[3] * r[1] + s[1] * r[3] + s[2] * r[0] - s[0] * r[2];
    cam[2] = s[3] * r[2] + s[2] * r[3] + s[0] * r[1] - s[1] * r[0];
    cam[3] = s[3] * r[3] - s[0] * r[0] - s[1] * r[1] - s[2] * r[2];
    const Eigen::Matrix3d R = PoseRotation(s);
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) rotation_[3 * i + k][j] = R(i, k);
      lever_[i][j] = R(i, 0) * r[4] + R(i, 1) * r[5] + R(i, 2) * r[6];
      cam[4 + i] = lever_[i][j] + s[4 + i];
    }
  }
  const double* cam_from_world() const { return cam_from_world_; }

  // Jacobians of `dim` rows with respect to the pose of the frame and that of the sensor (null: not
  // wanted) from those with respect to cam_from_world, which may stand in the place of either.
  // Entry (row, column) of the j-th residual is at [(6 * row + column) * stride + j].
  void Chain(size_t count, int dim, size_t stride, const double* by_cam, double* by_frame,
             double* by_sensor) const {
    for (int row = 0; row < dim; ++row) {
      const size_t at = 6 * static_cast<size_t>(row) * stride;
      double w[3][kCount], v[3][kCount];
      for (int i = 0; i < 3; ++i) {
        std::copy_n(by_cam + at + i * stride, count, w[i]);
        std::copy_n(by_cam + at + (3 + i) * stride, count, v[i]);
      }
      for (int i = 0; by_frame != nullptr && i < 3; ++i) {
        double *by_w = by_frame + at + i * stride, *by_v = by_w + 3 * stride;
        const double *r0 = rotation_[i], *r1 = rotation_[3 + i], *r2 = rotation_[6 + i];
        for (size_t j = 0; j < count; ++j) {
          by_w[j] = w[0][j] * r0[j] + w[1][j] * r1[j] + w[2][j] * r2[j];
          by_v[j] = v[0][j] * r0[j] + v[1][j] * r1[j] + v[2][j] * r2[j];
        }
      }
      for (int i = 0; by_sensor != nullptr && i < 3; ++i) {
        const int k = (i + 1) % 3, l = (i + 2) % 3;
        double *by_w = by_sensor + at + i * stride, *by_v = by_w + 3 * stride;
        for (size_t j = 0; j < count; ++j) {
          by_w[j] = w[i][j] + lever_[k][j] * v[l][j] - lever_[l][j] * v[k][j];
          by_v[j] = v[i][j];
        }
      }
    }
  }

 private:
  // Vectors of eight may be read where the last pose begins.
  double cam_from_world_[7 * kCount + 8];
  double rotation_[9][kCount];  // of sensor_from_rig, row by row
  double lever_[3][kCount];     // R_s t_r
};

template <typename Kernel>
struct WithSensorPose {
  static constexpr int kDim = Kernel::kDim, kNumSlots = Kernel::kNumSlots + 1;
  static constexpr int kPoseSlot = 1, kSensorSlot = Kernel::kNumSlots;
  using Datum = typename Kernel::Datum;  // its sensor is null
  Kernel kernel;

  bool Evaluate(const Datum& datum, const double* const* values, double* residual,
                double* const* jacobians) const {
    ChainedPoses<1> poses;
    poses.Set(0, values[kSensorSlot], values[kPoseSlot]);
    const double* seen[Kernel::kNumSlots];
    double* wanted[Kernel::kNumSlots];
    double by_cam[6 * kDim];
    for (int s = 0; s < Kernel::kNumSlots; ++s) {
      seen[s] = values[s];
      wanted[s] = jacobians[s];
    }
    seen[kPoseSlot] = poses.cam_from_world();
    const bool by_pose = jacobians[kPoseSlot] != nullptr || jacobians[kSensorSlot] != nullptr;
    wanted[kPoseSlot] = by_pose ? by_cam : nullptr;
    if (!kernel.Evaluate(datum, seen, residual, wanted)) return false;
    if (by_pose) poses.Chain(1, kDim, 1, by_cam, jacobians[kPoseSlot], jacobians[kSensorSlot]);
    return true;
  }

  // In packs (vectorised.h), where the kernel does it; false: not this one, nothing was done.
  bool EvaluateVectorised(const VectorWork& work) const
    requires requires(const Kernel& k, const VectorWork& w) { k.EvaluateVectorised(w); }
  {
    constexpr size_t kCount = 64;  // a multiple of kPanelLanes; its poses stay in the first cache
    ChainedPoses<kCount> poses;
    for (size_t first = 0; first < work.count; first += kCount) {
      VectorWork part = work;
      part.count = std::min(kCount, work.count - first);
      if (work.list != nullptr) {
        part.list = work.list + first;
      } else {
        part.begin = work.begin + first;
      }
      for (size_t j = 0; j < part.count; ++j) {
        const uint32_t* blocks = work.blocks + part.residual(j) * work.num_slots;
        poses.Set(j, work.state + work.offsets[blocks[kSensorSlot]],
                  work.state + work.offsets[blocks[kPoseSlot]]);
      }
      part.poses = poses.cam_from_world();
      part.residuals += first;
      part.present += first;
      for (double*& jacobian : part.jacobians) {
        if (jacobian != nullptr) jacobian += first;
      }
      double *const by_frame = part.jacobians[kPoseSlot], *const by_sensor = std::exchange(
                                                              part.jacobians[kSensorSlot], nullptr);
      if (by_frame == nullptr) part.jacobians[kPoseSlot] = by_sensor;
      if (!kernel.EvaluateVectorised(part)) return false;
      if (part.jacobians[kPoseSlot] != nullptr) {
        poses.Chain(part.count, kDim, work.stride, part.jacobians[kPoseSlot], by_frame, by_sensor);
      }
    }
    return true;
  }
};

}  // namespace holba
