// SPDX-License-Identifier: BSD-3-Clause
// Images with known poses and what they see, for tests of this room.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>

#include "holba/base/random.h"
#include "holba/estimation/pose/absolute_pose.h"
#include "holba/geometry/angle.h"

namespace holba {

struct TestViewOptions {
  std::string camera = "PINHOLE";
  size_t num_points = 0, num_wrong_points = 0;
  size_t num_lines = 0, num_wrong_lines = 0;
  size_t num_directions = 0, num_wrong_directions = 0;
  double noise_px = 0.0;  // of pixels and of ends of segments
  double direction_noise_rad = 0.0;
  uint64_t seed = 1;
};

struct TestView {
  Camera camera;
  Rigid3d cam_from_world;
  AbsolutePoseMatches matches;  // the right ones of each kind first
};

inline Camera MakePoseTestCamera(const std::string& model) {
  Camera camera;
  camera.model = FindCameraModel(model);
  camera.width = 800;
  camera.height = 600;
  if (model == "SIMPLE_PINHOLE") camera.params = {700, 405, 295};
  if (model == "PINHOLE") camera.params = {700, 710, 405, 295};
  if (model == "SIMPLE_RADIAL") camera.params = {700, 400, 300, -0.15};
  if (model == "OPENCV") camera.params = {700, 705, 402, 298, -0.1, 0.02, 0.001, -0.002};
  if (model == "OPENCV_FISHEYE") camera.params = {260, 262, 401, 297, 0.02, -0.01, 0.004, -0.001};
  if (model == "EQUIRECTANGULAR") camera.params = {800, 600};
  return camera;
}

inline Eigen::Vector3d RandomTestVector(Random* random) {
  return {random->Normal(), random->Normal(), random->Normal()};
}

// Points 3 to 9 units away, a world whose axes and origin are none of the camera's.
inline TestView MakeTestView(const TestViewOptions& options) {
  Random random(options.seed);
  TestView view;
  view.camera = MakePoseTestCamera(options.camera);
  view.cam_from_world.rotation =
      ExpRotation(random.Uniform(0.0, 3.1) * RandomTestVector(&random).normalized()).normalized();
  view.cam_from_world.translation = 3.0 * RandomTestVector(&random);
  const Rigid3d world_from_cam = view.cam_from_world.Inverse();
  const double* params = view.camera.params.data();
  const auto random_pixel = [&] {
    return Eigen::Vector2d(random.Uniform(0, 800), random.Uniform(0, 600));
  };
  const auto noise = [&] {
    return Eigen::Vector2d(random.Normal(options.noise_px), random.Normal(options.noise_px));
  };
  const auto random_point_in_cam = [&](Eigen::Vector2d* pixel) -> Eigen::Vector3d {
    while (true) {
      *pixel = random_pixel();
      const auto ray = view.camera.model->unproject(params, *pixel);
      if (ray) return random.Uniform(3.0, 9.0) * *ray;
    }
  };
  for (size_t i = 0; i < options.num_points + options.num_wrong_points; ++i) {
    PointSighting point;
    point.X = world_from_cam * random_point_in_cam(&point.pixel);
    point.pixel = i < options.num_points ? Eigen::Vector2d(point.pixel + noise()) : random_pixel();
    view.matches.points.push_back(point);
  }
  // The segment of a right line shows another part of it than the two points that it is made of.
  while (view.matches.lines.size() < options.num_lines + options.num_wrong_lines) {
    const bool is_right = view.matches.lines.size() < options.num_lines;
    Eigen::Vector2d pixels[2];
    const Eigen::Vector3d a = random_point_in_cam(&pixels[0]), b = random_point_in_cam(&pixels[1]);
    LineSighting line;
    line.line = PlueckerLine::FromPoints(world_from_cam * a, world_from_cam * b);
    Eigen::Vector2d start, end;
    if (!view.camera.model->project(params, a + 0.2 * (b - a), &start) ||
        !view.camera.model->project(params, a + 0.9 * (b - a), &end)) {
      continue;
    }
    line.segment = is_right ? LineSegment2d{start + noise(), end + noise()}
                            : LineSegment2d{random_pixel(), random_pixel()};
    if (line.segment.Length() < 60.0) continue;
    view.matches.lines.push_back(line);
  }
  for (size_t i = 0; i < options.num_directions + options.num_wrong_directions; ++i) {
    DirectionSighting direction;
    direction.direction_in_world = RandomTestVector(&random).normalized();
    const Eigen::Vector3d in_cam =
        i < options.num_directions
            ? Eigen::Vector3d(view.cam_from_world.rotation * direction.direction_in_world)
            : RandomTestVector(&random).normalized();
    const Eigen::Vector3d turn = options.direction_noise_rad * RandomTestVector(&random);
    direction.direction_in_cam =
        (random.Uniform() < 0.5 ? -1.0 : 1.0) * (ExpRotation(turn) * in_cam);
    view.matches.directions.push_back(direction);
  }
  return view;
}

inline double PoseRotationErrorDeg(const Rigid3d& a, const Rigid3d& b) {
  return RadToDeg(
      LogRotation(a.rotation.normalized() * b.rotation.normalized().conjugate()).norm());
}
inline double CentreError(const Rigid3d& a, const Rigid3d& b) {
  return (a.OriginInA() - b.OriginInA()).norm();
}

}  // namespace holba
