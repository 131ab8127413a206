// SPDX-License-Identifier: BSD-3-Clause
// Records of a model as Python has them: a model with an id, looked up at each use, so that one
// that was deleted is a KeyError and never memory of something else.
#pragma once

#include <nanobind/nanobind.h>

#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba::python {

namespace nb = nanobind;

// A Python error "there is no NAME 5 in the model".
[[noreturn]] void NoRecord(const char* name, uint64_t id);

template <typename IdType>
struct RecordRef {
  nb::object owner;  // the model, or what keeps it alive
  Reconstruction* model = nullptr;
  IdType id{};
};

#define HOLBA_RECORD(Class, IdType, Record, map, name) \
  struct Class : RecordRef<IdType> {                   \
    using Id = IdType;                                 \
    static constexpr const char* kName = name;         \
    Record& Get() const {                              \
      Record* record = model->map.Find(id);            \
      if (record == nullptr) NoRecord(kName, id);      \
      return *record;                                  \
    }                                                  \
  };
HOLBA_RECORD(PointRef, point3D_t, Point3D, points3D, "point")
HOLBA_RECORD(LineRef, line3D_t, Line3D, lines3D, "line")
HOLBA_RECORD(GroupRef, group3D_t, Group3D, groups3D, "group")
HOLBA_RECORD(RigRef, rig_t, Rig, rigs, "rig")
#undef HOLBA_RECORD

// Registered or not.
struct ImageRef : RecordRef<image_t> {
  using Id = image_t;
  static constexpr const char* kName = "image";
  Image& Get() const {
    Image* image = model->FindImage(id);
    if (image == nullptr) NoRecord(kName, id);
    return *image;
  }
};
struct FrameRef : RecordRef<frame_t> {
  using Id = frame_t;
  static constexpr const char* kName = "frame";
  Frame& Get() const {
    Frame* frame = model->frames.Find(id);
    if (frame == nullptr) frame = model->unregistered_frames.Find(id);
    if (frame == nullptr) NoRecord(kName, id);
    return *frame;
  }
};

// Raises InputError for parameters (plain values of the files) that are no group of the type.
void CheckGroupParams(const GroupType& type, const std::vector<double>& params);

// --- Features of an image lie in vectors, which move when features come or go. While an array
// shows such a vector, verbs that would move it raise BufferError, as bytearray does. What the
// array owns: keeps the model alive, and the vector pinned.
nb::object Pin(const void* features, nb::object owner);
void CheckUnpinned(const void* features);

}  // namespace holba::python
