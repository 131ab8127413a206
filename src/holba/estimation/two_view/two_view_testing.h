// SPDX-License-Identifier: BSD-3-Clause
// Pairs of views with known geometry, for tests of this room.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/camera/camera_model.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/two_view_geometry.h"

namespace holba {

struct TestPair {
  Camera camera1, camera2;
  Rigid3d cam2_from_cam1;  // translation of unit length, or zero
  std::vector<Eigen::Vector2d> pixels1, pixels2;
  size_t num_right = 0;  // the first ones
};

struct TestPairOptions {
  std::string camera = "PINHOLE";
  size_t num_right = 200, num_wrong = 0;
  double noise_px = 0.0;
  bool planar = false, forward = false, rotation = false;
  double baseline = 1.0;  // of the mean depth 6
  uint64_t seed = 1;
};

inline Camera MakeTestCamera(const std::string& model) {
  Camera camera;
  camera.model = FindCameraModel(model);
  camera.width = 800;
  camera.height = 600;
  if (model == "PINHOLE") camera.params = {700, 710, 405, 295};
  if (model == "SIMPLE_RADIAL") camera.params = {700, 400, 300, -0.15};
  if (model == "OPENCV_FISHEYE") camera.params = {260, 262, 401, 297, 0.02, -0.01, 0.004, -0.001};
  if (model == "EQUIRECTANGULAR") camera.params = {800, 600};
  return camera;
}

inline Rigid3d RandomTestPose(const TestPairOptions& options, Random* random) {
  const auto vector = [&] {
    return Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()).normalized();
  };
  Rigid3d pose;
  pose.rotation = ExpRotation(random->Uniform(0.05, 0.3) * vector());
  if (options.rotation) return pose;
  if (options.forward) {
    pose.rotation = ExpRotation(0.02 * vector());
    pose.translation = (Eigen::Vector3d(0, 0, -1) + 0.05 * vector()).normalized();
  } else {
    Eigen::Vector3d t = vector();
    t.z() *= 0.3;
    pose.translation = t.normalized();
  }
  return pose;
}

inline TestPair MakeTestPair(const TestPairOptions& options) {
  Random random(options.seed);
  TestPair pair;
  pair.camera1 = pair.camera2 = MakeTestCamera(options.camera);
  pair.cam2_from_cam1 = RandomTestPose(options, &random);
  const Rigid3d metric{pair.cam2_from_cam1.rotation,
                       options.baseline * pair.cam2_from_cam1.translation};
  const Eigen::Vector3d normal =
      Eigen::Vector3d(random.Uniform(-0.4, 0.4), random.Uniform(-0.4, 0.4), 1.0).normalized();
  const auto is_inside = [&](const Eigen::Vector2d& x) {
    return x.x() > 0 && x.y() > 0 && x.x() < 800 && x.y() < 600;
  };
  while (pair.pixels1.size() < options.num_right) {
    const Eigen::Vector2d pixel1(random.Uniform(0, 800), random.Uniform(0, 600));
    const auto ray = pair.camera1.model->unproject(pair.camera1.params.data(), pixel1);
    if (!ray) continue;
    const double distance =
        options.planar ? 6.0 * normal.z() / ray->dot(normal) : random.Uniform(3.0, 9.0);
    if (!(distance > 0.5 && distance < 40.0)) continue;
    Eigen::Vector2d pixel2;
    if (!pair.camera2.model->project(pair.camera2.params.data(), metric * (distance * *ray),
                                     &pixel2)) {
      continue;
    }
    if (!is_inside(pixel2)) continue;
    const auto noise = [&] {
      return Eigen::Vector2d(random.Normal(options.noise_px), random.Normal(options.noise_px));
    };
    pair.pixels1.push_back(pixel1 + noise());
    pair.pixels2.push_back(pixel2 + noise());
  }
  pair.num_right = options.num_right;
  for (size_t i = 0; i < options.num_wrong; ++i) {
    pair.pixels1.emplace_back(random.Uniform(0, 800), random.Uniform(0, 600));
    pair.pixels2.emplace_back(random.Uniform(0, 800), random.Uniform(0, 600));
  }
  return pair;
}

inline Keypoints ToKeypoints(const std::vector<Eigen::Vector2d>& pixels) {
  Keypoints keypoints;
  for (const Eigen::Vector2d& x : pixels)
    keypoints.data.insert(keypoints.data.end(), {float(x.x()), float(x.y())});
  return keypoints;
}

inline PointMatches EachWithItself(size_t size) {
  PointMatches matches(size);
  for (size_t i = 0; i < size; ++i) matches[i] = {point2D_t(i), point2D_t(i)};
  return matches;
}

inline double RotationErrorDeg(const Rigid3d& a, const Rigid3d& b) {
  return LogRotation(a.rotation * b.rotation.conjugate()).norm() * 180.0 / 3.14159265358979;
}
inline double DirectionErrorDeg(const Rigid3d& a, const Rigid3d& b) {
  const Eigen::Vector3d u = a.translation.normalized(), v = b.translation.normalized();
  return std::atan2(u.cross(v).norm(), u.dot(v)) * 180.0 / 3.14159265358979;
}

}  // namespace holba
