// SPDX-License-Identifier: BSD-3-Clause
// A small scene made in code: one camera, one image, one point. Prints where the point is seen,
// moves the scene by a similarity, and shows that it is seen at the same place.
#include <Eigen/Core>
#include <cstdio>
#include <optional>
#include <string>

#include "holba/camera/camera_model.h"
#include "holba/scene/reconstruction.h"

namespace {

holba::Reconstruction SmallScene() {
  holba::Reconstruction model;
  holba::Camera camera;
  camera.model = holba::FindCameraModel("SIMPLE_RADIAL");
  camera.width = 640;
  camera.height = 480;
  camera.params = {500.0, 320.0, 240.0, 0.05};  // f cx cy k
  model.cameras.Add(1, camera);

  holba::Image image;
  image.name = "image.jpg";
  image.camera_id = 1;
  image.cam_from_world.translation = {0.0, 0.0, 4.0};
  image.points2D.push_back({.xy = {0.0, 0.0}, .point3D_id = 1});
  model.images.Add(1, image);
  model.AddTrivialRigsAndFrames();

  holba::Point3D point;
  point.xyz = {0.8, -0.4, 0.0};
  point.track.push_back({.image_id = 1, .point2D_idx = 0});
  model.points3D.Add(1, point);
  return model;
}

std::optional<Eigen::Vector2d> SeenAt(const holba::Reconstruction& model) {
  const holba::Image& image = model.images.at(1);
  const holba::Camera& camera = model.cameras.at(image.camera_id);
  Eigen::Vector2d pixel;
  if (!camera.model->project(camera.params.data(), image.cam_from_world * model.points3D.at(1).xyz,
                             &pixel)) {
    return std::nullopt;
  }
  return pixel;
}

}  // namespace

int main() {
  holba::Reconstruction model = SmallScene();
  if (const std::optional<std::string> fault = model.FindInconsistency()) {
    std::fprintf(stderr, "the scene is inconsistent: %s\n", fault->c_str());
    return 1;
  }
  const std::optional<Eigen::Vector2d> before = SeenAt(model);
  holba::Sim3d new_from_old;
  new_from_old.scale = 3.0;
  new_from_old.translation = {1.0, 2.0, 3.0};
  model.Transform(new_from_old);
  const std::optional<Eigen::Vector2d> after = SeenAt(model);
  if (!before || !after || (*before - *after).norm() > 1e-9) {
    std::fprintf(stderr, "a similarity changed where the point is seen\n");
    return 1;
  }
  std::printf("%.4f %.4f\n", before->x(), before->y());
  return 0;
}
