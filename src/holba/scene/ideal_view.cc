// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/ideal_view.h"

#include <cmath>

#include "holba/geometry/types.h"

namespace holba {

IdealView::IdealView(const Reconstruction& model, image_t image_id) {
  const Image& image = model.images.at(image_id);
  camera_ = &model.cameras.at(image.camera_id);
  const IdealCalibration k = camera_->model->ideal_calibration(camera_->params.data());
  K_ << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1;
  inverse_K_ << 1 / k.fx, 0, -k.cx / k.fx, 0, 1 / k.fy, -k.cy / k.fy, 0, 0, 1;
  line_K_ << k.fy, 0, 0, 0, k.fx, 0, -k.fy * k.cx, -k.fx * k.cy, k.fx * k.fy;
  R_ = image.cam_from_world.RotationMatrix();
  t_ = image.cam_from_world.translation;
  centre_ = -R_.transpose() * t_;
  focal_ = std::sqrt(k.fx * k.fy);
}

std::optional<Eigen::Vector2d> IdealView::ToIdeal(const Eigen::Vector2d& pixel) const {
  return IdealPixel(*camera_->model, camera_->params.data(), pixel);
}

std::optional<Eigen::Vector2d> IdealView::ToPixel(const Eigen::Vector2d& ideal) const {
  if (camera_->model->is_pinhole) return ideal;
  Eigen::Vector2d pixel;
  if (!camera_->model->project(camera_->params.data(), inverse_K_ * ideal.homogeneous(), &pixel) ||
      !pixel.allFinite())
    return std::nullopt;
  return pixel;
}

std::optional<LineSegment2d> IdealView::ToIdeal(const LineSegment2d& segment) const {
  const auto start = ToIdeal(segment.start), end = ToIdeal(segment.end);
  if (!start || !end) return std::nullopt;
  return LineSegment2d{*start, *end};
}

std::optional<Eigen::Vector2d> IdealView::Project(const Eigen::Vector3d& X) const {
  const Eigen::Vector3d x = R_ * X + t_;
  if (!(x.z() > 0.0)) return std::nullopt;
  return Eigen::Vector2d((K_ * x).hnormalized());
}

std::optional<Eigen::Vector3d> IdealView::Project(const PlueckerLine& line) const {
  const Eigen::Vector3d d = R_ * line.direction;
  const Eigen::Vector3d m = R_ * line.moment + t_.cross(d);
  const Eigen::Vector3d l = line_K_ * m;
  const double scale = l.head<2>().norm();
  // Relative to the moment at one unit of distance: below it the image is a point.
  if (!(scale > 1e-12 * (m.norm() + d.norm()))) return std::nullopt;
  return Eigen::Vector3d(l / scale);
}

Eigen::Vector3d IdealView::NormalOfSegment(const LineSegment2d& ideal) const {
  return R_.transpose() * RayInCam(ideal.start).cross(RayInCam(ideal.end)).normalized();
}

Eigen::Matrix3d FundamentalMatrix(const IdealView& view1, const IdealView& view2) {
  // x2 = R x1 + t in camera coordinates.
  const Eigen::Matrix3d R = view2.R() * view1.R().transpose();
  const Eigen::Vector3d t = view2.t() - R * view1.t();
  return view2.InverseK().transpose() * CrossMatrix<double>(t) * R * view1.InverseK();
}

}  // namespace holba
