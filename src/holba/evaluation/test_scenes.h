// SPDX-License-Identifier: BSD-3-Clause
// Small scenes for the tests of this room.
#pragma once

#include <array>
#include <string>

#include "holba/base/random.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

inline Eigen::Vector3d RandomVector(Random* random) {
  Eigen::Vector3d v;
  for (double& x : v) x = random->Normal();
  return v;
}

inline Sim3d RandomSimilarity(Random* random) {
  Sim3d sim;
  sim.scale = random->Uniform(0.2, 5.0);
  sim.rotation = ExpRotation(RandomVector(random));
  sim.translation = 3.0 * RandomVector(random);
  return sim;
}

inline void AddImage(const std::string& name, const Rigid3d& cam_from_world,
                     Reconstruction* model) {
  const image_t id = static_cast<image_t>(model->images.size() + 1);
  Image image;
  image.name = name;
  image.cam_from_world = cam_from_world;
  model->images.Add(id, image);
}

inline Rigid3d LookingFrom(const Eigen::Vector3d& centre, const Eigen::Quaterniond& rotation) {
  return {rotation, -(rotation * centre)};
}

// `num_images` images with random poses, no features.
inline Reconstruction RandomCameras(int num_images, Random* random) {
  Reconstruction model;
  for (int i = 0; i < num_images; ++i) {
    AddImage("image" + std::to_string(i) + ".jpg",
             LookingFrom(2.0 * RandomVector(random), ExpRotation(RandomVector(random))), &model);
  }
  return model;
}

// The poses moved by a similarity of the world.
inline Reconstruction Moved(const Reconstruction& model, const Sim3d& sim) {
  Reconstruction moved = model;
  for (auto& [id, image] : moved.images) {
    image.cam_from_world = sim.TransformPose(image.cam_from_world);
  }
  for (auto& [id, point] : moved.points3D) point.xyz = sim * point.xyz;
  for (auto& [id, line] : moved.lines3D) {
    line.line = Transform(sim, line.line);
    line.start = sim * line.start;
    line.end = sim * line.end;
  }
  for (auto& [id, group] : moved.groups3D) {
    std::array<double, kMaxGroupParams> g{}, transformed{};
    group.type->from_file(group.params.data(), g.data());
    group.type->transform(sim, g.data(), transformed.data());
    group.type->to_file(transformed.data(), group.params.data());
  }
  return moved;
}

}  // namespace holba
