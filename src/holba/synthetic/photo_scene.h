// SPDX-License-Identifier: BSD-3-Clause
// Scenes for synthetic sets of photographs (photo_set.h): surfaces with points and lines, each seen
// from one side and at distances at which it is neither a speck nor a blur, opaque boxes, and
// views. Lengths in metres, z up; groups, members, edges and relations as in synthetic_structure.h.
//
// kSphere: the cameras and the cube of the paper's benchmark (bundle_problem.h). The cube stays
// transparent, but a feature has a side: cameras in one direction see it.
// kStreet: a walk around a block of houses, a step of 1.2 m from image to image and shorter ones
// around corners, looking ahead and at the houses on the outer side; the last images see the start
// again. House fronts have windows in rows and columns, ledges, and roofs; what is in the street
// floats before them.
// kCollection: photographs of a church in a square with houses around it, from popular spots, with
// cameras of their own: focal lengths from 0.7 to 2.5 of the longer side, six formats.
//
// Some parts of a scene are exact copies of others (the four sides of the tower, houses of one
// design, a part of the cube turned by 180 degrees): photographs of a part and of its copy can be
// matched, wrongly and consistently.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"
#include "holba/synthetic/synthetic_structure.h"

namespace holba {

enum class PhotoSceneKind { kSphere, kStreet, kCollection };

// A parallelogram that hides what is behind it: corner + a u + b v, 0 <= a, b <= 1.
struct ScenePanel {
  Eigen::Vector3d corner, u, v;
  uint32_t group = 0;  // the plane it is a piece of
};

struct ScenePart {
  SyntheticStructure structure;
  // Unit: features are seen from this side.
  std::vector<Eigen::Vector3d> point_normals, segment_normals;
  // Unit: from where each is seen best, within 70 degrees of its normal. AddPart draws them, the
  // same ones for a part and its copy, whose tracks so have views that correspond.
  std::vector<Eigen::Vector3d> point_favourites, segment_favourites;
  // Of what is detected there, metres; 0: seen at any distance.
  std::vector<double> point_sizes;
  std::vector<ScenePanel> panels;
};

// Point first_point_of_copy + k is copy_from_original times point first_point + k; lines alike.
struct SceneCopy {
  Rigid3d copy_from_original;
  uint32_t first_point = 0, first_point_of_copy = 0, num_points = 0;
  uint32_t first_line = 0, first_line_of_copy = 0, num_lines = 0;
};

struct PhotoScene {
  ScenePart content;
  std::vector<Eigen::AlignedBox3d> boxes;  // opaque; no feature is inside of one
  std::vector<SceneCopy> copies;
  std::vector<Camera> cameras;
  std::vector<uint32_t> camera_of_view;
  std::vector<Rigid3d> cam_from_world;
  bool is_sequence = false;  // views are in the order in which they were taken
};

// Where the first feature of a part went.
struct ScenePlace {
  Rigid3d world_from_part;
  uint32_t first_point = 0, first_line = 0;
};
// Adds a part with its groups, edges and relations. Directions within 1e-9 of an axis become it.
ScenePlace AddPart(const ScenePart& part, const Rigid3d& world_from_part, ScenePart* content);

// The same part at two places.
SceneCopy CopyOf(const ScenePart& part, const ScenePlace& original, const ScenePlace& copy);

// A house front in the plane y = 0, seen from y < 0: x from 0 to the width, z from 0 to the height.
struct Facade {
  double width = 10.0, height = 10.0;
  uint64_t design = 0;  // equal ones look the same
  // Of points off the plane, a share of those that are no corners, and how far off they are.
  double share_off_plane = 0.2, max_relief = 0.6;
};
// points_per_m2: besides the corners of windows.
ScenePart MakeFacade(const Facade& facade, double points_per_m2);

// density: points as a multiple of what the scene has by default; lines of the sphere go with them.
// Throws InputError where num_images is too small for the kind of scene.
PhotoScene MakePhotoScene(PhotoSceneKind kind, int num_images, double density, uint64_t seed);

// The three kinds, by their own files.
PhotoScene MakeSphereScene(int num_images, double density, uint64_t seed);
PhotoScene MakeStreetScene(int num_images, double density, uint64_t seed);
PhotoScene MakeCollectionScene(int num_images, double density, uint64_t seed);

}  // namespace holba
