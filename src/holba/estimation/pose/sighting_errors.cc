// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/sighting_errors.h"

#include <algorithm>
#include <cmath>

#include "holba/geometry/manifold.h"

namespace holba {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool ErrorOf(const PosedCamera& view, const PointSighting& sighting, Vector2d* error,
             SightingJacobian* jacobian) {
  const Vector3d rotated = view.R * sighting.X;
  const Vector3d in_cam = rotated + view.t;
  const double weight = 1.0 / sighting.relative_sigma;
  Vector2d pixel;
  if (jacobian == nullptr) {
    if (!view.model->project(view.params, in_cam, &pixel)) return false;
    *error = weight * (pixel - sighting.pixel);
    return true;
  }
  RowMajor<2, 3> d_point;
  if (!view.model->project_with_jacobian(view.params, in_cam, &pixel, d_point.data(),
                                         jacobian->params)) {
    return false;
  }
  *error = weight * (pixel - sighting.pixel);
  jacobian->pose.leftCols<3>() = -weight * d_point * CrossMatrix<double>(rotated);
  jacobian->pose.rightCols<3>() = weight * d_point;
  for (int k = 0; k < 2 * view.model->num_params; ++k) jacobian->params[k] *= weight;
  return true;
}

bool ErrorOf(const PosedCamera& view, const LineSighting& sighting, Vector2d* error,
             SightingJacobian* jacobian) {
  const IdealCalibration& k = view.ideal;
  const int num_params = view.model->num_params;
  const Vector3d d = view.R * sighting.line.direction;
  const Vector3d rotated_moment = view.R * sighting.line.moment;
  const Vector3d m = rotated_moment + view.t.cross(d);
  // l = C m, the cofactors of K.
  const Vector3d l(k.fy * m.x(), k.fx * m.y(),
                   -k.fy * k.cx * m.x() - k.fx * k.cy * m.y() + k.fx * k.fy * m.z());
  const double norm = l.head<2>().norm();
  if (!(norm > 1e-12 * std::abs(l.z())) || !(norm > 0.0)) return false;
  const double weight = 1.0 / sighting.relative_sigma;
  if (jacobian != nullptr) std::fill_n(jacobian->params, 2 * num_params, 0.0);
  const Vector2d* const ends[2] = {&sighting.segment.start, &sighting.segment.end};
  for (int e = 0; e < 2; ++e) {
    double d_params[2 * kMaxCameraParams];
    const auto x = jacobian == nullptr
                       ? IdealPixel(*view.model, view.params, *ends[e])
                       : IdealPixelWithJacobian(*view.model, view.params, *ends[e], d_params);
    if (!x) return false;
    const Vector3d ray((x->x() - k.cx) / k.fx, (x->y() - k.cy) / k.fy, 1.0);
    if (!IsInFront({d, m}, ray)) return false;
    const double distance = (l.head<2>().dot(*x) + l.z()) / norm;
    (*error)[e] = weight * distance;
    if (jacobian == nullptr) continue;
    Vector3d by_l(x->x(), x->y(), 1.0);
    by_l.head<2>() -= distance / norm * l.head<2>();
    by_l *= weight / norm;
    const Vector3d by_m(k.fy * (by_l.x() - k.cx * by_l.z()), k.fx * (by_l.y() - k.cy * by_l.z()),
                        k.fx * k.fy * by_l.z());
    // m moves by w x (R m) + t x (w x d) + dt x d for the rotation w and the translation dt.
    jacobian->pose.row(e).head<3>() =
        (rotated_moment.cross(by_m) + d.cross(by_m.cross(view.t))).transpose();
    jacobian->pose.row(e).tail<3>() = d.cross(by_m).transpose();
    double* const J = jacobian->params + e * num_params;
    for (int p = 0; p < num_params; ++p) {
      J[p] = weight / norm * (l.x() * d_params[p] + l.y() * d_params[num_params + p]);
    }
    const auto add = [&](int idx, double derivative) {
      if (idx >= 0) J[idx] += derivative;
    };
    add(k.fx_idx, by_l.y() * m.y() + by_l.z() * (-k.cy * m.y() + k.fy * m.z()));
    add(k.fy_idx, by_l.x() * m.x() + by_l.z() * (-k.cx * m.x() + k.fx * m.z()));
    add(k.cx_idx, -by_l.z() * k.fy * m.x());
    add(k.cy_idx, -by_l.z() * k.fx * m.y());
  }
  return true;
}

Vector3d UnderCalibration(const Vector3d& in_cam, const IdealCalibration& given,
                          const IdealCalibration& now) {
  const Vector3d moved((given.fx * in_cam.x() + (given.cx - now.cx) * in_cam.z()) / now.fx,
                       (given.fy * in_cam.y() + (given.cy - now.cy) * in_cam.z()) / now.fy,
                       in_cam.z());
  return moved.normalized();
}

bool ErrorOf(const PosedCamera& view, const IdealCalibration& given,
             const DirectionSighting& sighting, Vector2d* error, SightingJacobian* jacobian) {
  const Vector3d seen = UnderCalibration(sighting.direction_in_cam, given, view.ideal);
  Vector3d predicted = view.R * sighting.direction_in_world;
  if (predicted.dot(seen) < 0.0) predicted = -predicted;
  const double weight = 1.0 / sighting.relative_sigma;
  // The basis belongs to the seen direction; how it turns with it does not change the length.
  const Eigen::Matrix<double, 2, 3> across = weight * TangentBasis(seen).transpose();
  *error = across * predicted;
  if (jacobian == nullptr) return true;
  jacobian->pose.leftCols<3>() = -across * CrossMatrix<double>(predicted);
  jacobian->pose.rightCols<3>().setZero();
  const int num_params = view.model->num_params;
  std::fill_n(jacobian->params, 2 * num_params, 0.0);
  const auto add = [&](int idx, const Vector3d& d_seen) {
    if (idx < 0) return;
    const Vector2d moved = -predicted.dot(seen) * (across * d_seen);
    for (int e = 0; e < 2; ++e) jacobian->params[e * num_params + idx] += moved[e];
  };
  add(view.ideal.fx_idx, Vector3d(-seen.x() / view.ideal.fx, 0.0, 0.0));
  add(view.ideal.fy_idx, Vector3d(0.0, -seen.y() / view.ideal.fy, 0.0));
  add(view.ideal.cx_idx, Vector3d(-seen.z() / view.ideal.fx, 0.0, 0.0));
  add(view.ideal.cy_idx, Vector3d(0.0, -seen.z() / view.ideal.fy, 0.0));
  return true;
}

}  // namespace holba
