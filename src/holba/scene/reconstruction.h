// SPDX-License-Identifier: BSD-3-Clause
// The scene model: what FORMAT.md's files hold, nothing more. A value type; conventions are COLMAP's
// (x_cam = R x + t, centre of the top-left pixel at (0.5, 0.5)).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "holba/camera/camera_model.h"
#include "holba/geometry/line.h"
#include "holba/geometry/rigid3d.h"
#include "holba/group/group_type.h"
#include "holba/scene/id_map.h"
#include "holba/scene/types.h"

namespace holba {

struct Camera {
  const CameraModel* model = nullptr;
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<double> params;  // model->num_params
};

struct Rig {
  struct Sensor {
    SensorId id;
    std::optional<Rigid3d> sensor_from_rig;  // empty: unknown
  };
  // Sensor at the origin of the rig; may be missing in a rig without sensors.
  std::optional<SensorId> ref_sensor;
  std::vector<Sensor> sensors;  // all but the reference
};

struct Frame {
  struct Data {
    SensorId sensor;
    uint64_t data_id = kNoId;  // of a camera: the image id
  };
  rig_t rig_id = kInvalidId32;
  Rigid3d rig_from_world;
  std::vector<Data> data;
};

struct Point2D {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  point3D_t point3D_id = kNoId;
};

struct Line2D {
  LineSegment2d segment;
  line3D_t line3D_id = kNoId;
};

struct Group2D {
  const GroupType* type = nullptr;
  group3D_t group3D_id = kNoId;
  std::vector<point2D_t> point2D_idxs;
  std::vector<line2D_t> line2D_idxs;
};

struct Image {
  std::string name;
  camera_t camera_id = kInvalidId32;
  frame_t frame_id = kInvalidId32;
  // sensor_from_rig * rig_from_world of its frame, kept in step by Reconstruction::SetFramePose.
  Rigid3d cam_from_world;
  std::vector<Point2D> points2D;
  std::vector<Line2D> lines2D;
  std::vector<Group2D> groups2D;
};

struct PointObservation {
  image_t image_id = kInvalidId32;
  point2D_t point2D_idx = kInvalidId32;
};

struct Point3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb{0, 0, 0};
  double error = -1.0;  // mean reprojection error, px; -1: unset
  std::vector<PointObservation> track;
};

struct LineObservation {
  image_t image_id = kInvalidId32;
  line2D_t line2D_idx = kInvalidId32;
};

struct Line3D {
  PlueckerLine line;  // unit direction
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  // extent, for display
  Eigen::Vector3d end = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb{0, 0, 0};
  double error = -1.0;  // px; -1: unset
  std::vector<LineObservation> track;  // may hold several segments of one image
};

struct GroupObservation {
  image_t image_id = kInvalidId32;
  group2D_t group2D_idx = kInvalidId32;
};

struct Group3D {
  const GroupType* type = nullptr;
  std::vector<double> params;  // plain values of the file: type->num_file_params
  std::vector<point3D_t> point3D_ids;
  std::vector<line3D_t> line3D_ids;
  std::vector<GroupObservation> observations;
};

// The point lies on the line.
struct WireframeEdge {
  point3D_t point3D_id = kNoId;
  line3D_t line3D_id = kNoId;
  uint64_t num_images = 0;  // in how many images the pair was seen to meet
};

enum class RelationType : uint8_t { kOrthogonal = 0, kParallel = 1 };

struct Relation {
  group3D_t group3D_id1 = kNoId;
  group3D_t group3D_id2 = kNoId;
  RelationType type = RelationType::kOrthogonal;
};

class Reconstruction {
 public:
  IdMap<camera_t, Camera> cameras;
  IdMap<rig_t, Rig> rigs;        // always complete in memory: models without rigs get trivial ones
  IdMap<frame_t, Frame> frames;
  IdMap<image_t, Image> images;
  IdMap<point3D_t, Point3D> points3D;
  IdMap<line3D_t, Line3D> lines3D;
  IdMap<group3D_t, Group3D> groups3D;
  std::vector<WireframeEdge> wireframe;
  std::vector<Relation> relations;
  // Whether rigs and frames came from files (then they are written again).
  bool has_rig_files = false;

  // One rig per camera and one frame per image, with their ids (as COLMAP does for models without rigs).
  // For images without a frame; the frame's pose is the image's.
  void AddTrivialRigsAndFrames();

  // Pose of an image's sensor in its rig: identity for the reference sensor.
  const Rigid3d& SensorFromRig(const Image& image) const;
  // The only way to move cameras: sets the frame's pose and those of its images.
  void SetFramePose(frame_t frame_id, const Rigid3d& rig_from_world);
  // Camera centre in the world.
  Eigen::Vector3d CameraCentre(image_t image_id) const;

  // Similarity of everything: poses (and sensor poses by the scale), points, lines, groups.
  void Transform(const Sim3d& new_from_old);

  // Empty if consistent; otherwise the first inconsistency in words (unknown ids, tracks that do not match the
  // images' back references, members of a kind that the group does not take, non-finite numbers, ...).
  std::optional<std::string> FindInconsistency() const;
};

}  // namespace holba
