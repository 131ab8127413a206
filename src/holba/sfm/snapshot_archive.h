// SPDX-License-Identifier: BSD-3-Clause
// A mapper's state as bytes, exact to the last bit: values, the order of records, ids that were
// given and are gone. One list of fields serves both directions: Visit(archive) of a class calls
// (*archive)(field, field, ...), and what SnapshotWriter wrote SnapshotReader reads into the same
// fields. Models are written without what the scene has that the mapper began with: keypoints and
// segments. For the program that wrote it, on the same kind of machine.
#pragma once

#include <Eigen/Core>
#include <cstring>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/geometry/rigid3d.h"
#include "holba/group/group_type.h"
#include "holba/scene/reconstruction.h"

namespace holba {

class SnapshotWriter {
 public:
  static constexpr bool kReads = false;

  explicit SnapshotWriter(const Reconstruction& scene) : scene_(scene) {}

  template <typename... Fields>
  void operator()(const Fields&... fields) {
    (Write(fields), ...);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  template <typename T>
  void Write(const T& value) {
    if constexpr (std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>) {
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    } else {
      // The list of fields does not change what it is not asked to change.
      const_cast<T&>(value).Visit(this);
    }
  }
  template <typename Scalar, int kRows, int kColumns>
  void Write(const Eigen::Matrix<Scalar, kRows, kColumns>& matrix) {
    bytes_.append(reinterpret_cast<const char*>(matrix.data()), sizeof(Scalar) * matrix.size());
  }
  void Write(const Rigid3d& pose) {
    Write(Eigen::Vector4d(pose.rotation.coeffs()));
    Write(pose.translation);
  }
  void Write(const PlueckerLine& line) {
    Write(line.direction);
    Write(line.moment);
  }
  void Write(const GroupType* const& type) { Write(std::string(type->name)); }
  void Write(const std::string& text) {
    Write(text.size());
    bytes_ += text;
  }
  template <typename T>
  void Write(const std::optional<T>& value) {
    Write(value.has_value());
    if (value) Write(*value);
  }
  template <typename A, typename B>
  void Write(const std::pair<A, B>& pair) {
    Write(pair.first);
    Write(pair.second);
  }
  template <typename T>
  void Write(const std::vector<T>& values) {
    WriteAll(values);
  }
  template <typename T>
  void Write(const std::set<T>& values) {
    WriteAll(values);
  }
  template <typename K, typename V>
  void Write(const std::map<K, V>& values) {
    WriteAll(values);
  }
  template <typename Container>
  void WriteAll(const Container& values) {
    Write(values.size());
    for (const auto& value : values) Write(value);
  }

  void Write(const Reconstruction& model);
  void Write(const Camera& camera) {
    Write(camera.model->id);
    Write(camera.params);
  }
  void Write(const Rig& rig);
  void Write(const Frame& frame);
  // Field by field: bytes between fields are of chance.
  void Write(const Relation& relation) {
    Write(relation.group3D_id1);
    Write(relation.group3D_id2);
    Write(relation.type);
  }
  void Write(const Group2D& group);
  void Write(const Point3D& point);
  void Write(const Line3D& line);
  void Write(const Group3D& group);
  void WriteImage(image_t id, const Image& image);
  template <typename Id, typename T>
  void WriteRecords(const IdMap<Id, T>& records);

  const Reconstruction& scene_;
  std::string bytes_;
};

class SnapshotReader {
 public:
  static constexpr bool kReads = true;

  // The scene is that which the writer had; both must outlive the reader.
  SnapshotReader(std::string_view bytes, const Reconstruction& scene)
      : bytes_(bytes), scene_(scene) {}

  bool AtEnd() const { return at_ == bytes_.size(); }

  template <typename... Fields>
  void operator()(Fields&... fields) {
    (Read(&fields), ...);
  }

 private:
  const char* Take(size_t count) {
    HOLBA_CHECK_MSG(count <= bytes_.size() - at_, "a snapshot is longer than its bytes");
    at_ += count;
    return bytes_.data() + at_ - count;
  }
  template <typename T>
  T Get() {
    T value{};
    Read(&value);
    return value;
  }

  template <typename T>
  void Read(T* value) {
    if constexpr (std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>) {
      std::memcpy(static_cast<void*>(value), Take(sizeof(T)), sizeof(T));
    } else {
      value->Visit(this);
    }
  }
  template <typename Scalar, int kRows, int kColumns>
  void Read(Eigen::Matrix<Scalar, kRows, kColumns>* matrix) {
    std::memcpy(matrix->data(), Take(sizeof(Scalar) * matrix->size()),
                sizeof(Scalar) * matrix->size());
  }
  void Read(Rigid3d* pose) {
    pose->rotation.coeffs() = Get<Eigen::Vector4d>();
    Read(&pose->translation);
  }
  void Read(PlueckerLine* line) {
    Read(&line->direction);
    Read(&line->moment);
  }
  void Read(const GroupType** type) {
    *type = FindGroupType(Get<std::string>());
    HOLBA_CHECK(*type != nullptr);
  }
  void Read(std::string* text) {
    const auto size = Get<size_t>();
    text->assign(Take(size), size);
  }
  template <typename T>
  void Read(std::optional<T>* value) {
    value->reset();
    if (Get<bool>()) Read(&value->emplace());
  }
  template <typename A, typename B>
  void Read(std::pair<A, B>* pair) {
    Read(&pair->first);
    Read(&pair->second);
  }
  template <typename T>
  void Read(std::vector<T>* values) {
    values->clear();
    for (auto left = Get<size_t>(); left > 0; --left) Read(&values->emplace_back());
  }
  template <typename T>
  void Read(std::set<T>* values) {
    values->clear();
    for (auto left = Get<size_t>(); left > 0; --left) values->insert(Get<T>());
  }
  template <typename K, typename V>
  void Read(std::map<K, V>* values) {
    values->clear();
    for (auto left = Get<size_t>(); left > 0; --left) {
      const K key = Get<K>();
      Read(&(*values)[key]);
    }
  }

  void Read(Reconstruction* model);
  void Read(Camera* camera) {
    camera->model = FindCameraModel(Get<int>());
    HOLBA_CHECK(camera->model != nullptr);
    Read(&camera->params);
  }
  void Read(Rig* rig);
  void Read(Frame* frame);
  void Read(Relation* relation) {
    Read(&relation->group3D_id1);
    Read(&relation->group3D_id2);
    Read(&relation->type);
  }
  void Read(Group2D* group);
  void Read(Point3D* point);
  void Read(Line3D* line);
  void Read(Group3D* group);
  void ReadImages(IdMap<image_t, Image>* images);
  template <typename Id, typename T>
  void ReadRecords(IdMap<Id, T>* records);
  void RestoreLinks(Reconstruction* model) const;

  std::string_view bytes_;
  size_t at_ = 0;
  const Reconstruction& scene_;
};

// Of what a mapper begins with: a snapshot of other images or matches is of no use.
class CorrespondenceGraph;
uint64_t FingerprintOf(const CorrespondenceGraph& graph, const Reconstruction& scene);

}  // namespace holba
