// SPDX-License-Identifier: BSD-3-Clause
// Members of a group whose projection is a function in Python: the residual group_point of the
// library with another Proj_G. The cameras' half of the chain rule stays native.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "holba/camera/camera_model.h"
#include "holba/residual/view.h"
#include "python_residual.h"

namespace holba::python {

// r = pi(C, X) - pi(C, Proj_G(X)), pixels. Blocks: point, pose, intrinsics, group. Absent: the
// projection is NaN, or X or Proj_G(X) has no image.
class PythonGroupBatch final : public ResidualBatch {
 public:
  PythonGroupBatch(std::string term, const CameraModel& camera, const ManifoldOps& group,
                   PythonBatch::Functions projection);

  // sensor: pose of the image's sensor in its rig, null for the reference.
  void Add(BlockId point, BlockId pose, BlockId camera, BlockId group,
           std::shared_ptr<const SensorPose> sensor);

  // To be called without the interpreter's lock.
  void EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                     const ResidualPanel& panel) const override;

 private:
  const CameraModel& camera_;
  // Of point and group: the projected point, dimension 3.
  PythonBatch projection_;
  std::vector<std::shared_ptr<const SensorPose>> sensors_;
};

}  // namespace holba::python
