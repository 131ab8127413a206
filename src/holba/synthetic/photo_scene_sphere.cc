// SPDX-License-Identifier: BSD-3-Clause
// The cameras and the cube of the paper's synthetic benchmark as a PhotoScene.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_cameras.h"

namespace holba {
namespace {

Eigen::Vector3d RandomDirection(Random* random) {
  const double z = random->Uniform(-1.0, 1.0);
  const double longitude = random->Uniform(0.0, 2.0 * std::numbers::pi);
  const double ring = std::sqrt(1.0 - z * z);
  return {ring * std::cos(longitude), ring * std::sin(longitude), z};
}

// The side that what lies in a plane is seen from: within 60 degrees of one of its normals.
Eigen::Vector3d SideOfPlane(const Eigen::Vector3d& normal, Random* random) {
  const double min_cosine = std::cos(DegToRad(60.0));
  while (true) {
    const Eigen::Vector3d side = RandomDirection(random);
    if (std::abs(side.dot(normal)) > min_cosine) return side;
  }
}

// One of the benchmark's planes and what floats beside it: 50 points, 5 lines.
ScenePart MakePiece(Random* random) {
  ScenePart part;
  SyntheticStructure& structure = part.structure;
  AddPlaneWithSurroundings(
      {Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kCubeHalfExtent), false}, random,
      &structure);
  const SyntheticGroup& plane = structure.groups[0];
  const Eigen::Vector3d normal(plane.params.data());
  part.point_sizes.assign(structure.points.size(), 0.0);
  for (size_t p = 0; p < structure.points.size(); ++p)
    part.point_normals.push_back(RandomDirection(random));
  for (const uint32_t p : plane.points) part.point_normals[p] = SideOfPlane(normal, random);
  // Lines of a plane are seen together, and with their junctions.
  const Eigen::Vector3d side = SideOfPlane(normal, random), floating_side = RandomDirection(random);
  for (const int plane_of_line : structure.plane_of_line)
    part.segment_normals.push_back(plane_of_line >= 0 ? side : floating_side);
  for (const SyntheticEdge& edge : structure.edges)
    part.point_normals[edge.point] = part.segment_normals[edge.line];
  return part;
}

}  // namespace

PhotoScene MakeSphereScene(int num_images, double density, uint64_t seed) {
  Random random = StreamOf(seed, 201);
  PhotoScene scene;
  const Camera camera = MakeSyntheticCamera("SIMPLE_PINHOLE");
  scene.cameras = {camera};
  scene.cam_from_world = MakeCamerasOnSphere(num_images, 1, camera, &random).cam_from_world;
  scene.camera_of_view.assign(num_images, 0);
  constexpr double kShareOfCopies = 0.35;
  const auto num_pieces = static_cast<size_t>(std::max(4.0, density * num_images));
  const Rigid3d half_turn(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d::Zero());
  // As one part, so that all of it agrees with one wrong pose.
  ScenePart repeated;
  for (size_t k = 0; k < num_pieces; ++k) {
    const ScenePart piece = MakePiece(&random);
    const bool is_repeated = k + 1 < num_pieces && random.Uniform() < kShareOfCopies;
    AddPart(piece, Rigid3d(), is_repeated ? &repeated : &scene.content);
    if (is_repeated) ++k;
  }
  const ScenePlace original = AddPart(repeated, Rigid3d(), &scene.content);
  const ScenePlace copy = AddPart(repeated, half_turn, &scene.content);
  scene.copies.push_back(CopyOf(repeated, original, copy));
  return scene;
}

}  // namespace holba
