// SPDX-License-Identifier: BSD-3-Clause
#include "python_group.h"

#include "holba/geometry/manifold.h"

namespace holba::python {

PythonGroupBatch::PythonGroupBatch(std::string term, const CameraModel& camera,
                                   const ManifoldOps& group, PythonBatch::Functions projection)
    : ResidualBatch(term, 2, {3, 6, camera.num_params, group.tangent}),
      camera_(camera),
      projection_(std::move(term), 3, {&EuclideanOps(3), &group}, {3, group.tangent},
                  std::move(projection)) {}

void PythonGroupBatch::Add(BlockId point, BlockId pose, BlockId camera, BlockId group,
                           std::shared_ptr<const SensorPose> sensor) {
  AddBlocks(std::array{point, pose, camera, group});
  projection_.Add(std::array{point, group});
  sensors_.push_back(std::move(sensor));
}

void PythonGroupBatch::EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                                     const ResidualPanel& panel) const {
  const bool wants_jacobians = AnyWanted(panel.jacobians.data(), num_slots());
  const size_t n = range.count, tangent = static_cast<size_t>(this->tangent(3));
  std::vector<double> on_group(3 * n), by_point, by_group;
  const std::unique_ptr<bool[]> present(new bool[n]);
  ResidualPanel projected;
  projected.stride = n;
  projected.residuals = on_group.data();
  projected.present = present.get();
  if (wants_jacobians) {
    by_point.resize(9 * n);
    by_group.resize(3 * tangent * n);
    projected.jacobians[0] = by_point.data();
    projected.jacobians[1] = by_group.data();
  }
  if (parameters.state() != nullptr) {
    projection_.EvaluateRange(range, parameters, projected);
  } else {
    const double* slots[2] = {parameters.At(0, 0), parameters.At(3, 0)};
    projection_.EvaluateRange(range, ParameterReader(slots), projected);
  }
  const auto put = [&panel](double* to, size_t j, const auto& matrix) {
    for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
      for (Eigen::Index c = 0; c < matrix.cols(); ++c)
        to[static_cast<size_t>(r * matrix.cols() + c) * panel.stride + j] = matrix(r, c);
    }
  };
  RowMajor<3, 3> d_point;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> d_group(3, tangent);
  for (size_t j = 0; j < n; ++j) {
    const size_t i = range[j];
    const double* pose = parameters.At(1, block(i, 1));
    const double* params = parameters.At(2, block(i, 2));
    const Eigen::Map<const Eigen::Vector3d> X(parameters.At(0, block(i, 0)));
    const Eigen::Vector3d P(on_group[j], on_group[n + j], on_group[2 * n + j]);
    PointInImage a, b;
    panel.present[j] = present[j] &&
                       ProjectPoint(camera_, sensors_[i].get(), pose, params, X, &a) &&
                       ProjectPoint(camera_, sensors_[i].get(), pose, params, P, &b);
    if (!panel.present[j]) {
      for (int k = 0; k < 2; ++k) panel.residuals[k * panel.stride + j] = 0.0;
      for (int s = 0; s < num_slots(); ++s) {
        if (panel.jacobians[s] != nullptr)
          put(panel.jacobians[s], j, Eigen::MatrixXd::Zero(2, this->tangent(s)));
      }
      continue;
    }
    put(panel.residuals, j, Eigen::Vector2d(a.pixel - b.pixel));
    if (!wants_jacobians) continue;
    for (int k = 0; k < 9; ++k) d_point.data()[k] = by_point[static_cast<size_t>(k) * n + j];
    for (size_t k = 0; k < 3 * tangent; ++k) d_group.data()[k] = by_group[k * n + j];
    if (panel.jacobians[0] != nullptr)
      put(panel.jacobians[0], j, RowMajor<2, 3>(a.d_point - b.d_point * d_point));
    if (panel.jacobians[1] != nullptr)
      put(panel.jacobians[1], j, RowMajor<2, 6>(a.d_pose - b.d_pose));
    if (panel.jacobians[2] != nullptr) {
      for (int k = 0; k < 2 * camera_.num_params; ++k)
        panel.jacobians[2][static_cast<size_t>(k) * panel.stride + j] =
            a.d_params[k] - b.d_params[k];
    }
    if (panel.jacobians[3] != nullptr) put(panel.jacobians[3], j, (-b.d_point * d_group).eval());
  }
}

}  // namespace holba::python
