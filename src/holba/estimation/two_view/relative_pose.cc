// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/relative_pose.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "holba/geometry/angle.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

// Of 1 - cos^2 of the angle of two rays: about 1e-7 rad, where depths mean nothing any more.
constexpr double kParallel = 1e-14;

double MedianOf(std::vector<double>* values) {
  if (values->empty()) return 0.0;
  const auto middle = values->begin() + values->size() / 2;
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

}  // namespace

Eigen::Matrix3d CalibrationMatrix(const Camera& camera) {
  const IdealCalibration c = camera.model->ideal_calibration(camera.params.data());
  Eigen::Matrix3d K;
  K << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
  return K;
}

Eigen::Matrix3d EssentialMatrix(const Rigid3d& cam2_from_cam1) {
  const double length = cam2_from_cam1.translation.norm();
  if (length == 0.0) return Eigen::Matrix3d::Zero();
  // [t]x has norm sqrt(2) |t|.
  return CrossMatrix<double>(cam2_from_cam1.translation / (std::sqrt(2.0) * length)) *
         cam2_from_cam1.RotationMatrix();
}

std::vector<Rigid3d> PosesOfEssential(const Eigen::Matrix3d& E) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
  if (U.determinant() < 0) U.col(2) *= -1.0;
  if (V.determinant() < 0) V.col(2) *= -1.0;
  Eigen::Matrix3d W;
  W << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  const Eigen::Vector3d t = U.col(2);
  std::vector<Rigid3d> poses;
  for (const Eigen::Matrix3d& R : {Eigen::Matrix3d(U * W * V.transpose()),
                                   Eigen::Matrix3d(U * W.transpose() * V.transpose())}) {
    for (double sign : {1.0, -1.0})
      poses.emplace_back(Eigen::Quaterniond(R).normalized(), sign * t);
  }
  return poses;
}

std::vector<Rigid3d> PosesOfHomography(const Eigen::Matrix3d& H, double rotation_tolerance) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullV);
  const Eigen::Vector3d singular = svd.singularValues();
  if (!(singular[2] > 0.0) || !std::isfinite(singular[0])) return {};
  // The middle singular value of R + t n'/d is 1; its determinant is positive where the plane is on
  // one side of both cameras.
  Eigen::Matrix3d unit = H / singular[1];
  if (unit.determinant() < 0) unit = -unit;
  const double s1 = singular[0] / singular[1], s3 = singular[2] / singular[1];
  if (s1 - s3 < rotation_tolerance) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> nearest(unit,
                                                    Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d R = nearest.matrixU() * nearest.matrixV().transpose();
    return {Rigid3d(Eigen::Quaterniond(R).normalized(), Eigen::Vector3d::Zero())};
  }
  const Eigen::Vector3d v1 = svd.matrixV().col(0), v2 = svd.matrixV().col(1),
                        v3 = svd.matrixV().col(2);
  const double a = std::sqrt(std::max(0.0, 1.0 - s3 * s3));
  const double b = std::sqrt(std::max(0.0, s1 * s1 - 1.0));
  const double c = std::sqrt(s1 * s1 - s3 * s3);
  std::vector<Rigid3d> poses;
  for (double sign : {1.0, -1.0}) {
    // Vectors whose lengths H keeps: v2 and u span the plane that H maps rigidly.
    const Eigen::Vector3d u = (a * v1 + sign * b * v3) / c;
    Eigen::Matrix3d from, to;
    from << v2, u, v2.cross(u);
    const Eigen::Vector3d image_v2 = unit * v2, image_u = unit * u;
    to << image_v2, image_u, image_v2.cross(image_u);
    const Eigen::Matrix3d R = to * from.transpose();
    const Eigen::Vector3d t = (unit - R) * from.col(2);
    const double length = t.norm();
    if (!(length > 0.0)) continue;
    for (double side : {1.0, -1.0})
      poses.emplace_back(Eigen::Quaterniond(R).normalized(), side / length * t);
  }
  return poses;
}

std::optional<RayMeeting> MeetRays(const Rigid3d& cam2_from_cam1, const Eigen::Vector3d& ray1,
                                   const Eigen::Vector3d& ray2) {
  const Eigen::Quaterniond cam1_from_cam2 = cam2_from_cam1.rotation.normalized().conjugate();
  const Eigen::Vector3d d1 = ray1.normalized(), d2 = cam1_from_cam2 * ray2.normalized();
  const Eigen::Vector3d centre2 = -(cam1_from_cam2 * cam2_from_cam1.translation);
  const double cosine = d1.dot(d2);
  const double squared_sine = d1.cross(d2).squaredNorm();
  if (!(squared_sine > kParallel)) return std::nullopt;
  const double along1 = d1.dot(centre2), along2 = d2.dot(centre2);
  return RayMeeting{.depth1 = (along1 - cosine * along2) / squared_sine,
                    .depth2 = (cosine * along1 - along2) / squared_sine,
                    .angle_deg = RadToDeg(std::atan2(std::sqrt(squared_sine), cosine))};
}

std::vector<uint8_t> AreInFront(const Rigid3d& cam2_from_cam1, const MatchedRays& matches,
                                double max_error_px) {
  const Eigen::Matrix3d R = cam2_from_cam1.RotationMatrix();
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  const double max_angle = max_error_px * matches.AnglePerPixel();
  std::vector<uint8_t> in_front(matches.size());
  for (size_t i = 0; i < matches.size(); ++i) {
    // d1 R r1 + t = d2 r2; the depths d by the cross product with the other ray.
    const Eigen::Vector3d r1 = R * matches.Ray1(i), r2 = matches.Ray2(i);
    const Eigen::Vector3d normal = r1.cross(r2);
    const bool are_parallel = normal.squaredNorm() <= max_angle * max_angle && r1.dot(r2) > 0.0;
    in_front[i] = are_parallel || (r2.cross(t).dot(normal) > 0.0 && r1.cross(t).dot(normal) > 0.0);
  }
  return in_front;
}

std::optional<ChosenPose> ChoosePose(const std::vector<Rigid3d>& poses, const MatchedRays& matches,
                                     std::span<const uint32_t> subset) {
  std::optional<ChosenPose> best;
  std::vector<double> angles_deg;
  for (const Rigid3d& pose : poses) {
    angles_deg.clear();
    const bool is_rotation = pose.translation.isZero(0.0);
    size_t num_in_front = 0;
    for (uint32_t i : subset) {
      if (is_rotation) {
        if ((pose.rotation * matches.Ray1(i)).dot(matches.Ray2(i)) > 0.0) ++num_in_front;
        continue;
      }
      const auto meeting = MeetRays(pose, matches.Ray1(i), matches.Ray2(i));
      if (!meeting || !(meeting->depth1 > 0.0 && meeting->depth2 > 0.0)) continue;
      ++num_in_front;
      angles_deg.push_back(meeting->angle_deg);
    }
    if (num_in_front == 0 || (best && num_in_front <= best->num_in_front)) continue;
    best = {.cam2_from_cam1 = pose,
            .num_in_front = num_in_front,
            .median_angle_deg = MedianOf(&angles_deg)};
  }
  return best;
}

}  // namespace holba
