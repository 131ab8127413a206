// SPDX-License-Identifier: BSD-3-Clause
// Single points, lines, groups, images, frames and rigs of a model.
#include "records.h"

#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <memory>

#include "arrays.h"
#include "holba/base/error.h"
#include "module.h"

namespace holba::python {

void NoRecord(const char* name, uint64_t id) {
  throw nb::key_error(fmt::format("there is no {} {} in the model", name, id).c_str());
}

void CheckGroupParams(const GroupType& type, const std::vector<double>& params) {
  if (params.size() != static_cast<size_t>(type.num_file_params)) {
    throw InputError(fmt::format("params of {}: expected {} ({}), found {}", type.name,
                                 type.num_file_params, type.file_params, params.size()));
  }
  double in_memory[kMaxGroupParams];
  if (!type.from_file(params.data(), in_memory))
    throw InputError(fmt::format("params of {}: expected {}, found {}", type.name, type.requirement,
                                 fmt::join(params, " ")));
}

namespace {

// Guarded by the interpreter's lock.
std::map<const void*, int>& Pins() {
  static std::map<const void*, int> pins;
  return pins;
}

struct PinOwner {
  const void* features;
  nb::object owner;
};

}  // namespace

nb::object Pin(const void* features, nb::object owner) {
  ++Pins()[features];
  return nb::capsule(new PinOwner{features, std::move(owner)}, [](void* p) noexcept {
    const std::unique_ptr<PinOwner> pin(static_cast<PinOwner*>(p));
    const auto at = Pins().find(pin->features);
    if (--at->second == 0) Pins().erase(at);
  });
}

void CheckUnpinned(const void* features) {
  if (features != nullptr && Pins().contains(features)) {
    throw nb::buffer_error(
        "arrays show the 2D features of this image, which would move; copy them, and drop the "
        "views");
  }
}

namespace {

using Ids = std::vector<uint64_t>;

template <typename Track>
std::vector<std::pair<uint32_t, uint32_t>> Pairs(const Track& track) {
  std::vector<std::pair<uint32_t, uint32_t>> pairs;
  for (const auto& observation : track) {
    if constexpr (requires { observation.point2D_idx; }) {
      pairs.emplace_back(observation.image_id, observation.point2D_idx);
    } else if constexpr (requires { observation.line2D_idx; }) {
      pairs.emplace_back(observation.image_id, observation.line2D_idx);
    } else {
      pairs.emplace_back(observation.image_id, observation.group2D_idx);
    }
  }
  return pairs;
}

template <typename Ref>
nb::class_<Ref> BindRef(nb::module_& m, const char* name, const char* doc) {
  nb::class_<Ref> type(m, name, doc);
  type.def_prop_ro("id", [](const Ref& r) { return r.id; });
  type.def(
      "__eq__", [](const Ref& a, const Ref& b) { return a.model == b.model && a.id == b.id; },
      nb::is_operator(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  type.def("__hash__", [](const Ref& r) { return static_cast<nb::ssize_t>(r.id); });
  return type;
}

// Colour and error, which points and lines have.
template <typename Ref>
void BindAppearance(nb::class_<Ref>* type) {
  type->def_prop_rw(
      "rgb",
      [](const Ref& r) {
        const auto& c = r.Get().rgb;
        return std::tuple<int, int, int>(c[0], c[1], c[2]);
      },
      [](const Ref& r, const std::tuple<uint8_t, uint8_t, uint8_t>& c) {
        r.Get().rgb = {std::get<0>(c), std::get<1>(c), std::get<2>(c)};
      },
      "Colour, 0 to 255.");
  type->def_prop_rw(
      "error", [](const Ref& r) { return r.Get().error; },
      [](const Ref& r, double error) { r.Get().error = error; },
      "Mean reprojection error, px; -1: unset.");
  type->def_prop_ro(
      "track", [](const Ref& r) { return Pairs(r.Get().track); },
      "What observes it: (image id, index of the 2D feature), a copy.");
  type->def("__len__", [](const Ref& r) { return r.Get().track.size(); }, "Length of the track.");
}

void BindPoint(nb::module_& m) {
  auto type = BindRef<PointRef>(m, "Point3D",
                                "A point of a model. Once it is deleted, its use raises KeyError.");
  type.def_prop_rw(
      "xyz", [](const PointRef& r) { return ToArray<3>(r.Get().xyz); },
      [](const PointRef& r, const Vec<3>& xyz) { r.Get().xyz = xyz.value; },
      nb::for_setter(nb::sig("def xyz(self, value: holba._types.ArrayLike) -> None")),
      "(3,) a copy of the position, world frame, model units; assign to move the point.");
  BindAppearance(&type);
  type.def_prop_ro(
      "origin",
      [](const PointRef& r) {
        switch (r.Get().origin) {
          case PointOrigin::kImported:
            return "imported";
          case PointOrigin::kJunction:
            return "junction";
          case PointOrigin::kCorner:
            return "corner";
          default:
            return "detected";
        }
      },
      "Where it comes from: detected, imported, junction or corner.");
  type.def_prop_ro(
      "group_ids",
      [](const PointRef& r) {
        r.Get();
        const auto ids = r.model->GroupsOfPoint(r.id);
        return Ids(ids.begin(), ids.end());
      },
      "Groups that it is a member of.");
  type.def_prop_ro(
      "line_ids",
      [](const PointRef& r) {
        r.Get();
        const auto ids = r.model->LinesThrough(r.id);
        return Ids(ids.begin(), ids.end());
      },
      "Lines that it lies on (edges of the wireframe).");
  type.def("__repr__", [](const PointRef& r) {
    const Point3D& p = r.Get();
    return fmt::format("Point3D(id={}, xyz=[{:.6g}, {:.6g}, {:.6g}], {} observations)", r.id,
                       p.xyz.x(), p.xyz.y(), p.xyz.z(), p.track.size());
  });
}

void BindLine(nb::module_& m) {
  auto type = BindRef<LineRef>(m, "Line3D",
                               "A line of a model. Once it is deleted, its use raises KeyError.");
  type.def_prop_ro(
      "direction", [](const LineRef& r) { return ToArray<3>(r.Get().line.direction); },
      "(3,) unit.");
  type.def_prop_ro(
      "moment", [](const LineRef& r) { return ToArray<3>(r.Get().line.moment); },
      "(3,) p x direction for any point p of the line, model units.");
  type.def_prop_ro(
      "start", [](const LineRef& r) { return ToArray<3>(r.Get().start); },
      "(3,) one end of its extent, for display.");
  type.def_prop_ro(
      "end", [](const LineRef& r) { return ToArray<3>(r.Get().end); }, "(3,) the other end.");
  type.def(
      "set_ends",
      [](const LineRef& r, const Vec<3>& start, const Vec<3>& end) {
        if (!((end.value - start.value).norm() > 0.0))
          throw nb::value_error("expected two different points");
        Line3D& line = r.Get();
        line.line = PlueckerLine::FromPoints(start.value, end.value);
        line.start = start.value;
        line.end = end.value;
      },
      nb::arg("start"), nb::arg("end"),
      nb::sig(
          "def set_ends(self, start: holba._types.ArrayLike, end: holba._types.ArrayLike) -> None"),
      "Puts the line through two points (3,), which are the ends of its extent. Raises ValueError "
      "if "
      "they are one.");
  BindAppearance(&type);
  type.def_prop_ro(
      "group_ids",
      [](const LineRef& r) {
        r.Get();
        const auto ids = r.model->GroupsOfLine(r.id);
        return Ids(ids.begin(), ids.end());
      },
      "Groups that it is a member of.");
  type.def_prop_ro(
      "point_ids",
      [](const LineRef& r) {
        r.Get();
        const auto ids = r.model->PointsOn(r.id);
        return Ids(ids.begin(), ids.end());
      },
      "Points that lie on it (edges of the wireframe).");
  type.def("__repr__", [](const LineRef& r) {
    const Line3D& l = r.Get();
    return fmt::format(
        "Line3D(id={}, start=[{:.6g}, {:.6g}, {:.6g}], end=[{:.6g}, {:.6g}, {:.6g}], {} "
        "observations)",
        r.id, l.start.x(), l.start.y(), l.start.z(), l.end.x(), l.end.y(), l.end.z(),
        l.track.size());
  });
}

void BindGroup(nb::module_& m) {
  auto type = BindRef<GroupRef>(m, "Group3D",
                                "A vanishing point, plane, sphere, ... of a model. Once it is "
                                "deleted, its use raises KeyError.");
  type.def_prop_ro(
      "type", [](const GroupRef& r) { return std::string(r.Get().type->name); },
      "Name of its type: \"PLANE\", \"VP\", ...");
  type.def_prop_ro("param_names",
                   [](const GroupRef& r) { return std::string(r.Get().type->file_params); });
  type.def_prop_rw(
      "params", [](const GroupRef& r) { return Owned1(r.Get().params); },
      [](const GroupRef& r, std::vector<double> params) {
        Group3D& group = r.Get();
        CheckGroupParams(*group.type, params);
        group.params = std::move(params);
      },
      nb::for_setter(nb::sig("def params(self, value: collections.abc.Sequence[float] | "
                             "numpy.typing.NDArray[numpy.float64]) -> None")),
      "(n,) a copy of its parameters, the plain values of docs/FORMAT.md; assign to change them. "
      "Raises InputError for values that are no group of its type.");
  type.def_prop_ro(
      "point3D_ids", [](const GroupRef& r) { return r.Get().point3D_ids; }, "Member points.");
  type.def_prop_ro(
      "line3D_ids", [](const GroupRef& r) { return r.Get().line3D_ids; }, "Member lines.");
  type.def_prop_ro(
      "observations", [](const GroupRef& r) { return Pairs(r.Get().observations); },
      "(image id, index of the 2D group).");
  type.def("__repr__", [](const GroupRef& r) {
    const Group3D& g = r.Get();
    return fmt::format("Group3D(id={}, type='{}', params=[{}], {} points, {} lines)", r.id,
                       g.type->name, fmt::join(g.params, ", "), g.point3D_ids.size(),
                       g.line3D_ids.size());
  });
}

void BindFrame(nb::module_& m) {
  auto type = BindRef<FrameRef>(
      m, "Frame", "A frame: one pose of a rig, with an image of each of its cameras.");
  type.def_prop_ro("rig_id", [](const FrameRef& r) { return r.Get().rig_id; });
  type.def_prop_ro("is_registered", [](const FrameRef& r) {
    r.Get();
    return r.model->frames.contains(r.id);
  });
  type.def_prop_ro(
      "rig_from_world",
      [](const FrameRef& r) -> std::optional<Rigid3d> {
        const Frame& frame = r.Get();
        if (!r.model->frames.contains(r.id)) return std::nullopt;
        return frame.rig_from_world;
      },
      "Its pose; None while it is not registered. Model.set_frame_pose moves it.");
  type.def_prop_ro(
      "data_ids",
      [](const FrameRef& r) {
        std::vector<std::tuple<int, uint32_t, uint64_t>> out;
        for (const Frame::Data& d : r.Get().data)
          out.emplace_back(static_cast<int>(d.sensor.type), d.sensor.id, d.data_id);
        return out;
      },
      "(type of sensor, 0: camera; its id; id of its datum, of a camera that of the image).");
  type.def_prop_ro("image_ids", [](const FrameRef& r) {
    std::vector<image_t> out;
    for (const Frame::Data& d : r.Get().data) {
      if (d.sensor.type == SensorType::kCamera &&
          r.model->FindImage(static_cast<image_t>(d.data_id)))
        out.push_back(static_cast<image_t>(d.data_id));
    }
    return out;
  });
  type.def("__repr__", [](const FrameRef& r) {
    return fmt::format("Frame(id={}, rig_id={})", r.id, r.Get().rig_id);
  });
}

void BindRig(nb::module_& m) {
  auto type = BindRef<RigRef>(m, "Rig", "Cameras that are mounted together.");
  type.def_prop_ro(
      "ref_sensor",
      [](const RigRef& r) -> std::optional<std::pair<int, uint32_t>> {
        const Rig& rig = r.Get();
        if (!rig.ref_sensor) return std::nullopt;
        return std::pair(static_cast<int>(rig.ref_sensor->type), rig.ref_sensor->id);
      },
      "(type, 0: camera; id) of the sensor at the rig's origin.");
  type.def_prop_ro(
      "sensors",
      [](const RigRef& r) {
        std::vector<std::tuple<int, uint32_t, std::optional<Rigid3d>>> out;
        for (const Rig::Sensor& s : r.Get().sensors)
          out.emplace_back(static_cast<int>(s.id.type), s.id.id, s.sensor_from_rig);
        return out;
      },
      "(type, id, sensor_from_rig or None where it is not known) of the others.");
  type.def("__repr__", [](const RigRef& r) {
    return fmt::format("Rig(id={}, {} sensors beside the reference)", r.id, r.Get().sensors.size());
  });
}

}  // namespace

void BindImage(nb::module_& m);  // image_records.cc

void BindRecords(nb::module_& m) {
  BindPoint(m);
  BindLine(m);
  BindGroup(m);
  BindImage(m);
  BindFrame(m);
  BindRig(m);
}

}  // namespace holba::python
