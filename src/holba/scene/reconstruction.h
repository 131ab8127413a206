// SPDX-License-Identifier: BSD-3-Clause
// The scene model: what FORMAT.md's files hold, nothing more. A value type; conventions are COLMAP's
// (x_cam = R x + t, centre of the top-left pixel at (0.5, 0.5)).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
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
  Rigid3d rig_from_world;  // means nothing while the frame is not registered
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
  // sensor_from_rig * rig_from_world of its frame, kept in step by Reconstruction::SetFramePose;
  // means nothing while the image is not registered.
  Rigid3d cam_from_world;
  std::vector<Point2D> points2D;
  std::vector<Line2D> lines2D;
  std::vector<Group2D> groups2D;
};

struct PointObservation {
  image_t image_id = kInvalidId32;
  point2D_t point2D_idx = kInvalidId32;
  friend bool operator==(const PointObservation&, const PointObservation&) = default;
};

// Where a point comes from. Files hold the numbers.
enum class PointOrigin : uint8_t {
  kDetected = 0,  // keypoints of the photographs
  kImported = 1,  // another program's points, whose observations are not keypoints
  kJunction = 2,  // lines that meet
  kCorner = 3,    // a corner, placed with the help of planes and lines
};
// Points made from structure or with it have a noise of their own, are a term of their own in an
// adjustment, and go when structure is built anew.
inline bool IsOfStructure(PointOrigin origin) {
  return origin == PointOrigin::kJunction || origin == PointOrigin::kCorner;
}

struct Point3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> rgb{0, 0, 0};
  double error = -1.0;  // mean reprojection error, px; -1: unset
  std::vector<PointObservation> track;
  PointOrigin origin = PointOrigin::kDetected;
};

struct LineObservation {
  image_t image_id = kInvalidId32;
  line2D_t line2D_idx = kInvalidId32;
  friend bool operator==(const LineObservation&, const LineObservation&) = default;
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
  friend bool operator==(const GroupObservation&, const GroupObservation&) = default;
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

class AssociationIndex;

// Records may be read and their values (coordinates, parameters, colours, errors) changed through the maps.
// What ties records to each other (tracks and back references, members, edges, relations, who is registered)
// is changed by the verbs below, which keep it consistent: after any sequence of them FindInconsistency() is
// empty. A verb fails (CheckError) where its ids or indices do not exist; the model is then as it was.
// The cost of a verb is that of the record's own track, groups and edges, whatever the size of the model.
//
// Readers and generators may fill a new model record by record; the first verb that needs to know what a
// feature belongs to makes an index of all associations, which the verbs maintain (AssociationIndex).
class Reconstruction {
 public:
  Reconstruction();
  ~Reconstruction();
  Reconstruction(const Reconstruction& other);
  Reconstruction(Reconstruction&& other) noexcept;
  Reconstruction& operator=(const Reconstruction& other);
  Reconstruction& operator=(Reconstruction&& other) noexcept;

  IdMap<camera_t, Camera> cameras;
  IdMap<rig_t, Rig> rigs;        // always complete in memory: models without rigs get trivial ones
  // Registered: with a pose. Every stage that goes over images and frames goes over these.
  IdMap<frame_t, Frame> frames;
  IdMap<image_t, Image> images;
  // Known, without a pose: nothing of them is triangulated. A frame is registered with all of its images.
  IdMap<frame_t, Frame> unregistered_frames;
  IdMap<image_t, Image> unregistered_images;
  IdMap<point3D_t, Point3D> points3D;
  IdMap<line3D_t, Line3D> lines3D;
  IdMap<group3D_t, Group3D> groups3D;
  std::vector<WireframeEdge> wireframe;
  std::vector<Relation> relations;
  // Whether rigs and frames came from files (then they are written again).
  bool has_rig_files = false;

  // One rig per camera and one frame per image, with their ids (as COLMAP does for models without rigs).
  // For images without a frame, registered or not; the frame's pose is the image's.
  void AddTrivialRigsAndFrames();

  // Pose of an image's sensor in its rig: identity for the reference sensor.
  const Rigid3d& SensorFromRig(const Image& image) const;
  // The only way to move cameras: sets the frame's pose and those of its images.
  void SetFramePose(frame_t frame_id, const Rigid3d& rig_from_world);
  // Camera centre in the world.
  Eigen::Vector3d CameraCentre(image_t image_id) const;

  // --- Images and frames.
  // Gives an unregistered frame a pose: it and its images go to the end of `frames` and `images`.
  void RegisterFrame(frame_t frame_id, const Rigid3d& rig_from_world);
  // Takes it away again: all observations in its images are deleted first, and with them the points and
  // lines that fewer than two observations are left of, as in COLMAP. 2D features stay.
  void DeregisterFrame(frame_t frame_id);
  // The frame of an image; of a rig, the others with it.
  void RegisterImage(image_t image_id, const Rigid3d& cam_from_world);
  void DeregisterImage(image_t image_id) { DeregisterFrame(images.at(image_id).frame_id); }
  bool IsRegistered(image_t image_id) const { return images.contains(image_id); }
  // An image that is known and not registered, alone in a trivial frame of a trivial rig. Its 2D features name
  // nothing in 3D.
  void AddUnregisteredImage(image_t image_id, Image image);
  // Registered or not. Null: no such image.
  Image* FindImage(image_t image_id);
  const Image* FindImage(image_t image_id) const;

  // --- Points, lines and their observations. A 2D feature observes one 3D feature at most.
  point3D_t AddPoint3D(const Eigen::Vector3d& xyz, std::span<const PointObservation> track = {},
                       PointOrigin origin = PointOrigin::kDetected, const std::array<uint8_t, 3>& rgb = {0, 0, 0});
  line3D_t AddLine3D(const PlueckerLine& line, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                     std::span<const LineObservation> track = {});
  void AddObservation(point3D_t point3D_id, const PointObservation& observation);
  void AddObservation(line3D_t line3D_id, const LineObservation& observation);
  // The feature stays, also without a track. The 2D feature must observe one.
  void DeleteObservation(const PointObservation& observation);
  void DeleteObservation(const LineObservation& observation);
  // With all their observations, memberships and edges.
  void DeletePoint3D(point3D_t point3D_id);
  void DeleteLine3D(line3D_t line3D_id);
  // `other` goes; its observations, memberships and edges go to `id`. The place of a point is the mean of both,
  // weighted by the lengths of their tracks, as in COLMAP; a line stays where it is, its extent reaches over both.
  void MergePoints3D(point3D_t id, point3D_t other);
  void MergeLines3D(line3D_t id, line3D_t other);

  // --- Groups, members, edges, relations. A group may be without members: nothing has joined it yet, or all left.
  group3D_t AddGroup3D(const GroupType& type, std::vector<double> params, std::vector<point3D_t> point3D_ids = {},
                       std::vector<line3D_t> line3D_ids = {});
  void DeleteGroup3D(group3D_t group3D_id);
  // False: it is a member already (is none).
  bool AddPointMember(group3D_t group3D_id, point3D_t point3D_id);
  bool AddLineMember(group3D_t group3D_id, line3D_t line3D_id);
  bool DeletePointMember(group3D_t group3D_id, point3D_t point3D_id);
  bool DeleteLineMember(group3D_t group3D_id, line3D_t line3D_id);
  // A 2D group that observes none yet, of the same type.
  void AddObservation(group3D_t group3D_id, const GroupObservation& observation);
  void DeleteObservation(const GroupObservation& observation);
  // `other` goes; members, observations and relations go to `id`, whose parameters stay. Of one type.
  void MergeGroups3D(group3D_t id, group3D_t other);
  // False: they are joined already (are not).
  bool AddEdge(const WireframeEdge& edge);
  bool DeleteEdge(point3D_t point3D_id, line3D_t line3D_id);
  // False: the two groups have a relation already (have none).
  bool AddRelation(const Relation& relation);
  bool DeleteRelation(group3D_t group3D_id1, group3D_t group3D_id2);

  // --- What a feature belongs to, in no particular order.
  std::span<const group3D_t> GroupsOfPoint(point3D_t point3D_id) const;
  std::span<const group3D_t> GroupsOfLine(line3D_t line3D_id) const;
  std::span<const line3D_t> LinesThrough(point3D_t point3D_id) const;
  std::span<const point3D_t> PointsOn(line3D_t line3D_id) const;
  // In `wireframe`. Empty: they are not joined.
  std::optional<size_t> PositionOfEdge(point3D_t point3D_id, line3D_t line3D_id) const;

  // --- 2D features of images, registered or not.
  point2D_t AddPoint2D(image_t image_id, const Eigen::Vector2d& xy);
  line2D_t AddLine2D(image_t image_id, const LineSegment2d& segment);
  // Its features must exist and be of kinds that the type takes; it observes no 3D group yet.
  group2D_t AddGroup2D(image_t image_id, Group2D group);
  // Removes those for which `remove(idx)` holds; what observes them is deleted first. Indices of the others, in
  // tracks and 2D groups, follow. A 2D group without features goes as well.
  void RemovePoints2D(image_t image_id, const std::function<bool(point2D_t)>& remove);
  void RemoveLines2D(image_t image_id, const std::function<bool(line2D_t)>& remove);
  void RemoveGroups2D(image_t image_id, const std::function<bool(group2D_t)>& remove);

  // --- Many at once, in one pass over the model; the order of what stays does not change.
  // Members, edges, relations and references of 2D features to what goes are gone with it; observations stay
  // in the images as 2D features that observe nothing.
  void DeletePoints3D(const std::function<bool(point3D_t, const Point3D&)>& remove);
  void DeleteLines3D(const std::function<bool(line3D_t, const Line3D&)>& remove);
  void DeleteGroups3D(const std::function<bool(group3D_t, const Group3D&)>& remove);
  // Of all groups; returns how many.
  size_t DeleteMembers(const std::function<bool(group3D_t, const Group3D&, point3D_t)>& remove_point,
                       const std::function<bool(group3D_t, const Group3D&, line3D_t)>& remove_line);
  size_t DeleteEdges(const std::function<bool(const WireframeEdge&)>& remove);
  // The members of a group, at once; each once.
  void SetMembers(group3D_t group3D_id, std::vector<point3D_t> point3D_ids, std::vector<line3D_t> line3D_ids);

  // Similarity of everything: poses (and sensor poses by the scale), points, lines, groups.
  void Transform(const Sim3d& new_from_old);

  // Empty if consistent; otherwise the first inconsistency in words (unknown ids, tracks that do not match the
  // images' back references, members of a kind that the group does not take, non-finite numbers, an index of
  // associations that is not that of the groups and edges, ...).
  std::optional<std::string> FindInconsistency() const;

 private:
  AssociationIndex& Associations() const;

  // Made on first use; copies of the model make their own. Like every other change of a value, using it for the
  // first time is not for several threads at once.
  mutable std::unique_ptr<AssociationIndex> associations_;
};

}  // namespace holba
