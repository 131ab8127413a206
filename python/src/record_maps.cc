// SPDX-License-Identifier: BSD-3-Clause
// The maps of a model: like dict, with all numbers of one kind as arrays. Arrays that show records
// where they lie are strided; that needs records one behind the other (record_layout.h). Records do
// not move, and their memory is the model's until that ends: an array stays valid whatever becomes
// of them.
#include <fmt/format.h>
#include <nanobind/make_iterator.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>

#include "arrays.h"
#include "reconstruction.h"
#include "record_layout.h"
#include "records.h"

namespace holba::python {
namespace {

template <auto kMap, typename RefType>
struct MapView {
  using Ref = RefType;
  nb::object owner;
  Reconstruction* model;

  auto& Map() const { return model->*kMap; }
  Ref At(typename Ref::Id id) const {
    if (!Map().contains(id)) NoRecord(Ref::kName, id);
    Ref ref;
    ref.owner = owner;
    ref.model = model;
    ref.id = id;
    return ref;
  }
};
using PointMap = MapView<&Reconstruction::points3D, PointRef>;
using LineMap = MapView<&Reconstruction::lines3D, LineRef>;
using GroupMap = MapView<&Reconstruction::groups3D, GroupRef>;
using ImageMap = MapView<&Reconstruction::images, ImageRef>;
using UnregisteredImageMap = MapView<&Reconstruction::unregistered_images, ImageRef>;
using FrameMap = MapView<&Reconstruction::frames, FrameRef>;
using UnregisteredFrameMap = MapView<&Reconstruction::unregistered_frames, FrameRef>;
using RigMap = MapView<&Reconstruction::rigs, RigRef>;

// Numbers of all records, which begin at first(record) and are of the shape `inner`. `copy` as
// numpy.asarray has it.
template <typename A, typename View, typename First>
A NumbersOf(const View& view, const First& first, std::vector<size_t> inner,
            std::optional<bool> copy) {
  auto& map = view.Map();
  using Scalar = std::remove_pointer_t<decltype(first(map.begin()->second))>;
  std::vector<size_t> shape{map.size()};
  shape.insert(shape.end(), inner.begin(), inner.end());
  size_t count = 1;
  for (size_t n : inner) count *= n;
  const bool wants_view = !copy.value_or(false);
  const std::optional<int64_t> stride = wants_view ? StrideOf(map) : std::nullopt;
  if (stride && *stride % static_cast<int64_t>(sizeof(Scalar)) == 0 && !map.empty()) {
    std::vector<int64_t> strides(shape.size());
    int64_t step = 1;
    for (size_t i = shape.size(); --i > 0;) {
      strides[i] = step;
      step *= static_cast<int64_t>(shape[i]);
    }
    strides[0] = *stride / static_cast<int64_t>(sizeof(Scalar));
    return A(first(map.begin()->second), shape.size(), shape.data(), view.owner, strides.data());
  }
  if (copy == false && !map.empty()) {
    throw nb::value_error(
        "the records do not lie one behind the other, so that no array can show them; take a copy "
        "of "
        "the model (model.copy()), in which they do, or let the numbers be copied (copy=None)");
  }
  using Value = std::remove_const_t<Scalar>;
  auto values = std::make_unique<std::vector<Value>>();
  values->reserve(map.size() * count + 1);
  for (auto& [id, record] : map)
    values->insert(values->end(), first(record), first(record) + count);
  Value* data = values->data();
  nb::capsule owner(values.get(),
                    [](void* p) noexcept { delete static_cast<std::vector<Value>*>(p); });
  values.release();
  return A(data, shape.size(), shape.data(), owner);
}

template <typename View>
nb::class_<View> BindMap(nb::module_& m, const char* name, const char* doc) {
  using Id = typename View::Ref::Id;
  const auto keys = [](const View& v) {
    std::vector<Id> ids;
    ids.reserve(v.Map().size());
    for (const auto& [id, record] : v.Map()) ids.push_back(id);
    return ids;
  };
  nb::class_<View> type(m, name, doc);
  type.def("__len__", [](const View& v) { return v.Map().size(); });
  type.def("__contains__", [](const View& v, Id id) { return v.Map().contains(id); });
  type.def("__contains__", [](const View&, nb::object) { return false; }, nb::arg().none());
  type.def(
      "__getitem__", [](const View& v, Id id) { return v.At(id); }, nb::arg("id"),
      "Raises KeyError if there is none.");
  type.def(
      "get",
      [](const View& v, Id id) -> std::optional<typename View::Ref> {
        if (!v.Map().contains(id)) return std::nullopt;
        return v.At(id);
      },
      nb::arg("id"), "None: there is none.");
  type.def(
      "__iter__",
      [keys](const View& v) -> nb::object { return nb::cast(keys(v)).attr("__iter__")(); },
      nb::sig("def __iter__(self) -> collections.abc.Iterator[int]"),
      "Over the ids there are now; the model may change meanwhile.");
  type.def("keys", keys, "All ids, in the order of the files.");
  type.def("values", [](const View& v) {
    std::vector<typename View::Ref> refs;
    refs.reserve(v.Map().size());
    for (const auto& [id, record] : v.Map()) refs.push_back(v.At(id));
    return refs;
  });
  type.def(
      "items",
      [](const View& v) {
        nb::list items;
        for (const auto& [id, record] : v.Map()) items.append(nb::make_tuple(id, v.At(id)));
        return items;
      },
      nb::sig(fmt::format("def items(self) -> list[tuple[int, {}]]",
                          std::string(nb::cast<const char*>(
                              nb::type<typename View::Ref>().attr("__name__"))))
                  .c_str()));
  type.def(
      "ids",
      [](const View& v) {
        std::vector<Id> ids;
        ids.reserve(v.Map().size());
        for (const auto& [id, record] : v.Map()) ids.push_back(id);
        return Owned1(std::move(ids));
      },
      "(n,) all ids in the order of the files, in which all arrays of this map are; a copy.");
  type.def("__repr__", [name = std::string(name)](const View& v) {
    return fmt::format("{} of {}", name, v.Map().size());
  });
  return type;
}

constexpr const char* kCopyDoc =
    " copy: None: a view where the records lie one behind the other, else a copy; False: a view, "
    "or "
    "ValueError; True: a copy.";

template <typename A, typename View, typename First>
void BindNumbers(nb::class_<View>* type, const char* name, First first, std::vector<size_t> inner,
                 const char* doc) {
  type->def(
      name,
      [first, inner](const View& v, std::optional<bool> copy) {
        return NumbersOf<A>(v, first, inner, copy);
      },
      nb::kw_only(), nb::arg("copy") = nb::none(), (std::string(doc) + kCopyDoc).c_str());
}

template <typename View>
void BindAppearance(nb::class_<View>* type) {
  BindNumbers<Array<uint8_t, -1, 3>>(
      type, "rgb", [](auto& r) { return r.rgb.data(); }, {3}, "(n, 3) colours.");
  BindNumbers<Array<double, -1>>(
      type, "errors", [](auto& r) { return &r.error; }, {},
      "(n,) mean reprojection errors, px; -1: unset.");
  type->def(
      "track_lengths",
      [](const View& v) {
        std::vector<uint32_t> lengths;
        for (const auto& [id, record] : v.Map())
          lengths.push_back(static_cast<uint32_t>(record.track.size()));
        return Owned1(std::move(lengths));
      },
      "(n,) numbers of observations, a copy.");
}

template <typename View, typename Pose>
void BindPoses(nb::class_<View>* type, Pose pose, const char* what) {
  const std::string of = std::string(" of ") + what;
  BindNumbers<Array<const double, -1, 4>>(
      type, "quaternions",
      [pose](auto& r) -> const double* { return pose(r).rotation.coeffs().data(); }, {4},
      ("(n, 4) rotations [x y z w]" + of +
       "; they cannot be written, set_frame_pose moves cameras.")
          .c_str());
  BindNumbers<Array<const double, -1, 3>>(
      type, "translations", [pose](auto& r) -> const double* { return pose(r).translation.data(); },
      {3}, ("(n, 3) translations" + of + ", model units; they cannot be written.").c_str());
}

struct CameraMap {
  nb::object owner;
  Reconstruction* model;
};

void BindCameraMap(nb::module_& m) {
  nb::class_<CameraMap> type(m, "CameraMap",
                             "Cameras by id. A camera is a value: assign to change one.");
  type.def("__len__", [](const CameraMap& v) { return v.model->cameras.size(); });
  type.def("__contains__",
           [](const CameraMap& v, camera_t id) { return v.model->cameras.contains(id); });
  type.def(
      "__getitem__",
      [](const CameraMap& v, camera_t id) {
        const Camera* camera = v.model->cameras.Find(id);
        if (camera == nullptr) NoRecord("camera", id);
        return *camera;
      },
      nb::arg("id"), "Raises KeyError if there is none.");
  type.def(
      "__setitem__",
      [](const CameraMap& v, camera_t id, const Camera& camera) {
        if (Camera* old = v.model->cameras.Find(id)) {
          *old = camera;
        } else {
          if (id == kInvalidId32) throw nb::value_error("this number is not an id");
          v.model->cameras.Add(id, camera);
        }
      },
      nb::arg("id"), nb::arg("camera"), "Replaces a camera, or adds one.");
  const auto keys = [](const CameraMap& v) {
    std::vector<camera_t> ids;
    for (const auto& [id, camera] : v.model->cameras) ids.push_back(id);
    return ids;
  };
  type.def(
      "__iter__",
      [keys](const CameraMap& v) -> nb::object { return nb::cast(keys(v)).attr("__iter__")(); },
      nb::sig("def __iter__(self) -> collections.abc.Iterator[int]"));
  type.def("keys", keys);
  type.def("values", [](const CameraMap& v) {
    std::vector<Camera> cameras;
    for (const auto& [id, camera] : v.model->cameras) cameras.push_back(camera);
    return cameras;
  });
  type.def(
      "items",
      [](const CameraMap& v) {
        nb::list items;
        for (const auto& [id, camera] : v.model->cameras) items.append(nb::make_tuple(id, camera));
        return items;
      },
      nb::sig("def items(self) -> list[tuple[int, Camera]]"));
  type.def("__repr__", [](const CameraMap& v) {
    return fmt::format("CameraMap of {}", v.model->cameras.size());
  });
}

template <typename View>
void BindAccess(nb::class_<Reconstruction>* model, const char* name) {
  const std::string signature =
      fmt::format("def {}(self) -> {}", name,
                  std::string(nb::cast<const char*>(nb::type<View>().attr("__name__"))));
  model->def_prop_ro(
      name, [](nb::object self) { return View{self, nb::cast<Reconstruction*>(self)}; },
      nb::for_getter(nb::sig(signature.c_str())));
}

}  // namespace

void BindMaps(nb::module_& m, nb::class_<Reconstruction>* model) {
  auto points = BindMap<PointMap>(m, "PointMap", "Points by id.");
  BindNumbers<Array<double, -1, 3>>(
      &points, "xyz", [](Point3D& p) { return p.xyz.data(); }, {3},
      "(n, 3) positions, world frame, model units; a view moves the points.");
  BindAppearance(&points);
  auto lines = BindMap<LineMap>(m, "LineMap", "Lines by id.");
  BindNumbers<Array<const double, -1, 3>>(
      &lines, "directions", [](Line3D& l) -> const double* { return l.line.direction.data(); }, {3},
      "(n, 3) unit directions; they cannot be written.");
  BindNumbers<Array<const double, -1, 3>>(
      &lines, "moments", [](Line3D& l) -> const double* { return l.line.moment.data(); }, {3},
      "(n, 3) moments p x d, model units; they cannot be written.");
  BindNumbers<Array<const double, -1, 2, 3>>(
      &lines, "ends", [](Line3D& l) -> const double* { return l.start.data(); }, {2, 3},
      "(n, 2, 3) start and end of the extents, model units; they cannot be written.");
  BindAppearance(&lines);
  BindMap<GroupMap>(m, "GroupMap", "Groups by id.");
  auto images = BindMap<ImageMap>(m, "ImageMap", "Images with a pose by id.");
  BindPoses(&images, [](Image& i) -> Rigid3d& { return i.cam_from_world; }, "cam_from_world");
  images.def(
      "centres",
      [](const ImageMap& v) {
        std::vector<double> out;
        for (const auto& [id, image] : v.Map()) {
          const Eigen::Vector3d c = image.cam_from_world.OriginInA();
          out.insert(out.end(), c.data(), c.data() + 3);
        }
        return OwnedRows<3>(std::move(out));
      },
      "(n, 3) camera centres in the world, model units; a copy.");
  images.def("names", [](const ImageMap& v) {
    std::vector<std::string> out;
    for (const auto& [id, image] : v.Map()) out.push_back(image.name);
    return out;
  });
  BindMap<UnregisteredImageMap>(m, "UnregisteredImageMap", "Images without a pose by id.");
  auto frames = BindMap<FrameMap>(m, "FrameMap", "Frames with a pose by id.");
  BindPoses(&frames, [](Frame& f) -> Rigid3d& { return f.rig_from_world; }, "rig_from_world");
  BindMap<UnregisteredFrameMap>(m, "UnregisteredFrameMap", "Frames without a pose by id.");
  BindMap<RigMap>(m, "RigMap", "Rigs by id.");
  BindCameraMap(m);
  BindAccess<CameraMap>(model, "cameras");
  BindAccess<RigMap>(model, "rigs");
  BindAccess<FrameMap>(model, "frames");
  BindAccess<ImageMap>(model, "images");
  BindAccess<UnregisteredFrameMap>(model, "unregistered_frames");
  BindAccess<UnregisteredImageMap>(model, "unregistered_images");
  BindAccess<PointMap>(model, "points3D");
  BindAccess<LineMap>(model, "lines3D");
  BindAccess<GroupMap>(model, "groups3D");
}

}  // namespace holba::python
