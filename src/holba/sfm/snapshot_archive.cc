// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/snapshot_archive.h"

#include "holba/scene/correspondence_graph.h"

namespace holba {
namespace {

const Frame& FrameOf(const Reconstruction& scene, frame_t id) {
  const Frame* frame = scene.frames.Find(id);
  return frame != nullptr ? *frame : scene.unregistered_frames.at(id);
}

bool HaveSamePlaces(const std::vector<Point2D>& a, const std::vector<Point2D>& b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    if (a[i].xy != b[i].xy) return false;
  }
  return true;
}

bool HaveSamePlaces(const std::vector<Line2D>& a, const std::vector<Line2D>& b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i) {
    if (a[i].segment.start != b[i].segment.start || a[i].segment.end != b[i].segment.end)
      return false;
  }
  return true;
}

// No id is given twice, also to records that were gone when the snapshot was written.
template <typename Id, typename T>
void RestoreNextId(Id next_id, IdMap<Id, T>* records) {
  if (records->NextId() >= next_id) return;
  records->Add(next_id - 1, T{});
  records->Remove(next_id - 1);
}

// 64 bits of what is mixed in, word by word.
class Fingerprint {
 public:
  void Add(uint64_t word) {
    hash_ = (hash_ ^ word) * 0x9e3779b97f4a7c15ULL;
    hash_ ^= hash_ >> 29;
  }
  void Add(double value) {
    uint64_t word;
    std::memcpy(&word, &value, sizeof(word));
    Add(word);
  }
  void Add(const Eigen::Vector2d& pixel) {
    Add(pixel.x());
    Add(pixel.y());
  }
  uint64_t hash() const { return hash_; }

 private:
  uint64_t hash_ = 0xcbf29ce484222325ULL;
};

}  // namespace

// ---- Writing.

template <typename Id, typename T>
void SnapshotWriter::WriteRecords(const IdMap<Id, T>& records) {
  Write(records.size());
  Write(records.NextId());
  for (const auto& [id, record] : records) {
    Write(id);
    if constexpr (std::is_same_v<T, Image>) {
      WriteImage(id, record);
    } else {
      Write(record);
    }
  }
}

void SnapshotWriter::Write(const Reconstruction& model) {
  WriteRecords(model.cameras);
  WriteRecords(model.rigs);
  WriteRecords(model.frames);
  WriteRecords(model.unregistered_frames);
  WriteRecords(model.images);
  WriteRecords(model.unregistered_images);
  WriteRecords(model.points3D);
  WriteRecords(model.lines3D);
  WriteRecords(model.groups3D);
  Write(model.wireframe);
  Write(model.relations);
}

void SnapshotWriter::Write(const Rig& rig) {
  for (const Rig::Sensor& sensor : rig.sensors) Write(sensor.sensor_from_rig);
}

void SnapshotWriter::Write(const Frame& frame) {
  Write(frame.rig_from_world);
  // Cameras that became one are in the rig of that.
  Write(frame.rig_id);
  for (const Frame::Data& data : frame.data) Write(data.sensor.id);
}

void SnapshotWriter::Write(const Group2D& group) {
  Write(group.type);
  Write(group.group3D_id);
  Write(group.point2D_idxs);
  Write(group.line2D_idxs);
}

void SnapshotWriter::WriteImage(image_t id, const Image& image) {
  Write(image.camera_id);
  Write(image.cam_from_world);
  Write(image.groups2D);
  const Image& of_scene = *scene_.FindImage(id);
  const bool same_points = HaveSamePlaces(image.points2D, of_scene.points2D);
  Write(same_points);
  if (!same_points) {
    Write(image.points2D.size());
    for (const Point2D& point : image.points2D) Write(point.xy);
  }
  const bool same_lines = HaveSamePlaces(image.lines2D, of_scene.lines2D);
  Write(same_lines);
  if (!same_lines) {
    Write(image.lines2D.size());
    for (const Line2D& line : image.lines2D) {
      Write(line.segment.start);
      Write(line.segment.end);
    }
  }
}

void SnapshotWriter::Write(const Point3D& point) {
  Write(point.xyz);
  Write(point.rgb);
  Write(point.error);
  Write(point.track);
  Write(point.origin);
}

void SnapshotWriter::Write(const Line3D& line) {
  Write(line.line);
  Write(line.start);
  Write(line.end);
  Write(line.rgb);
  Write(line.error);
  Write(line.track);
}

void SnapshotWriter::Write(const Group3D& group) {
  Write(group.type);
  Write(group.params);
  Write(group.point3D_ids);
  Write(group.line3D_ids);
  Write(group.observations);
}

// ---- Reading.

template <typename Id, typename T>
void SnapshotReader::ReadRecords(IdMap<Id, T>* records) {
  const auto size = Get<size_t>();
  const auto next_id = Get<Id>();
  *records = {};
  records->Reserve(size);
  for (size_t i = 0; i < size; ++i) {
    const auto id = Get<Id>();
    T record;
    if constexpr (std::is_same_v<T, Rig>) record = scene_.rigs.at(id);
    if constexpr (std::is_same_v<T, Camera>) record = scene_.cameras.at(id);
    if constexpr (std::is_same_v<T, Frame>) record = FrameOf(scene_, id);
    Read(&record);
    HOLBA_CHECK(records->Add(id, std::move(record)));
  }
  RestoreNextId(next_id, records);
}

void SnapshotReader::ReadImages(IdMap<image_t, Image>* images) {
  const auto size = Get<size_t>();
  const auto next_id = Get<image_t>();
  *images = {};
  images->Reserve(size);
  for (size_t i = 0; i < size; ++i) {
    const auto id = Get<image_t>();
    Image image = *scene_.FindImage(id);
    Read(&image.camera_id);
    Read(&image.cam_from_world);
    Read(&image.groups2D);
    if (!Get<bool>()) {
      image.points2D.resize(Get<size_t>());
      for (Point2D& point : image.points2D) Read(&point.xy);
    }
    if (!Get<bool>()) {
      image.lines2D.resize(Get<size_t>());
      for (Line2D& line : image.lines2D) {
        Read(&line.segment.start);
        Read(&line.segment.end);
      }
    }
    for (Point2D& point : image.points2D) point.point3D_id = kNoId;
    for (Line2D& line : image.lines2D) line.line3D_id = kNoId;
    images->Add(id, std::move(image));
  }
  RestoreNextId(next_id, images);
}

void SnapshotReader::Read(Reconstruction* model) {
  *model = Reconstruction();
  model->has_rig_files = scene_.has_rig_files;
  ReadRecords(&model->cameras);
  ReadRecords(&model->rigs);
  ReadRecords(&model->frames);
  ReadRecords(&model->unregistered_frames);
  ReadImages(&model->images);
  ReadImages(&model->unregistered_images);
  ReadRecords(&model->points3D);
  ReadRecords(&model->lines3D);
  ReadRecords(&model->groups3D);
  Read(&model->wireframe);
  Read(&model->relations);
  RestoreLinks(model);
}

void SnapshotReader::RestoreLinks(Reconstruction* model) const {
  for (const auto& [id, point] : model->points3D) {
    for (const PointObservation& observation : point.track)
      model->images.at(observation.image_id).points2D.at(observation.point2D_idx).point3D_id = id;
  }
  for (const auto& [id, line] : model->lines3D) {
    for (const LineObservation& observation : line.track)
      model->images.at(observation.image_id).lines2D.at(observation.line2D_idx).line3D_id = id;
  }
}

void SnapshotReader::Read(Rig* rig) {
  for (Rig::Sensor& sensor : rig->sensors) Read(&sensor.sensor_from_rig);
}

void SnapshotReader::Read(Frame* frame) {
  Read(&frame->rig_from_world);
  Read(&frame->rig_id);
  for (Frame::Data& data : frame->data) Read(&data.sensor.id);
}

void SnapshotReader::Read(Group2D* group) {
  Read(&group->type);
  Read(&group->group3D_id);
  Read(&group->point2D_idxs);
  Read(&group->line2D_idxs);
}

void SnapshotReader::Read(Point3D* point) {
  Read(&point->xyz);
  Read(&point->rgb);
  Read(&point->error);
  Read(&point->track);
  Read(&point->origin);
}

void SnapshotReader::Read(Line3D* line) {
  Read(&line->line);
  Read(&line->start);
  Read(&line->end);
  Read(&line->rgb);
  Read(&line->error);
  Read(&line->track);
}

void SnapshotReader::Read(Group3D* group) {
  Read(&group->type);
  Read(&group->params);
  Read(&group->point3D_ids);
  Read(&group->line3D_ids);
  Read(&group->observations);
}

uint64_t FingerprintOf(const CorrespondenceGraph& graph, const Reconstruction& scene) {
  Fingerprint fingerprint;
  for (const auto& [id, camera] : scene.cameras) {
    fingerprint.Add(uint64_t{id});
    for (const double value : camera.params) fingerprint.Add(value);
  }
  const auto add_image = [&](image_t id, const Image& image) {
    fingerprint.Add(uint64_t{id});
    fingerprint.Add(uint64_t{image.camera_id});
    for (const Point2D& point : image.points2D) fingerprint.Add(point.xy);
    for (const Line2D& line : image.lines2D) {
      fingerprint.Add(line.segment.start);
      fingerprint.Add(line.segment.end);
    }
    if (!graph.Contains(id)) return;
    for (point2D_t idx = 0; idx < graph.NumKeypoints(id); ++idx) {
      for (const Correspondence& other : graph.CorrespondencesOf(id, idx))
        fingerprint.Add((uint64_t{other.image_id} << 32) | other.point2D_idx);
    }
    for (line2D_t idx = 0; idx < graph.NumSegments(id); ++idx) {
      for (const LineCorrespondence& other : graph.LineCorrespondencesOf(id, idx))
        fingerprint.Add((uint64_t{other.image_id} << 32) | other.line2D_idx);
    }
  };
  for (const auto& [id, image] : scene.images) add_image(id, image);
  for (const auto& [id, image] : scene.unregistered_images) add_image(id, image);
  for (const auto& [id, point] : scene.points3D) {
    for (int i = 0; i < 3; ++i) fingerprint.Add(point.xyz[i]);
  }
  return fingerprint.hash();
}

}  // namespace holba
