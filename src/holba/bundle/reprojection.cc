// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/reprojection.h"

#include "holba/residual/view.h"

namespace holba {

std::optional<Eigen::Vector2d> PixelOf(const Reconstruction& model, const Image& image,
                                       const Eigen::Vector3d& point_in_world) {
  const Camera& camera = model.cameras.at(image.camera_id);
  Eigen::Vector2d pixel;
  if (!camera.model->project(camera.params.data(), image.cam_from_world * point_in_world, &pixel))
    return std::nullopt;
  return pixel;
}

std::optional<Eigen::Vector4d> EndOffsets(const Reconstruction& model, const Image& image,
                                          const PlueckerLine& line,
                                          const LineObservation& observation) {
  const Camera& camera = model.cameras.at(image.camera_id);
  const Rigid3d& pose = image.cam_from_world;
  const Eigen::Quaterniond q = pose.rotation.normalized();
  const Eigen::Vector3d& t = pose.translation;
  const double values[7] = {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
  const double* params = camera.params.data();
  const LineSegment2d& segment = image.lines2D[observation.line2D_idx].segment;
  const auto start = IdealPixel(*camera.model, params, segment.start);
  const auto end = IdealPixel(*camera.model, params, segment.end);
  if (!start || !end) return std::nullopt;
  Vector6d pluecker;
  pluecker << line.direction, line.moment;
  const Eigen::Vector3d l =
      ProjectLine(nullptr, values, camera.model->ideal_calibration(params), pluecker);
  Eigen::Vector4d rho;
  if (!PerpendicularValues(l, *start, *end, &rho)) return std::nullopt;
  return rho;
}

}  // namespace holba
