// SPDX-License-Identifier: BSD-3-Clause
// The verbs of Reconstruction: what changes how records are tied to each other.
#include <fmt/format.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "arrays.h"
#include "holba/base/error.h"
#include "reconstruction.h"
#include "records.h"

namespace holba::python {
namespace {

using Pairs = std::vector<std::pair<uint32_t, uint32_t>>;

template <typename Observation>
std::vector<Observation> Track(const Pairs& pairs) {
  std::vector<Observation> track;
  for (const auto& [image_id, idx] : pairs) track.push_back({image_id, idx});
  return track;
}

PointOrigin OriginOf(const std::string& name) {
  if (name == "detected") return PointOrigin::kDetected;
  if (name == "imported") return PointOrigin::kImported;
  if (name == "junction") return PointOrigin::kJunction;
  if (name == "corner") return PointOrigin::kCorner;
  throw InputError(
      fmt::format("origin: expected detected, imported, junction or corner, found '{}'", name));
}

RelationType RelationOf(const std::string& name) {
  if (name == "orthogonal") return RelationType::kOrthogonal;
  if (name == "parallel") return RelationType::kParallel;
  throw InputError(fmt::format("relation: expected orthogonal or parallel, found '{}'", name));
}

const GroupType& TypeOf(const std::string& name) {
  const GroupType* type = FindGroupType(name);
  if (type != nullptr) return *type;
  std::string names;
  for (const GroupType* t : AllGroupTypes())
    names += (names.empty() ? "" : ", ") + std::string(t->name);
  throw InputError(fmt::format("group type: expected one of {}, found '{}'", names, name));
}

Image& ImageOf(Reconstruction& model, image_t id) {
  Image* image = model.FindImage(id);
  if (image == nullptr) NoRecord("image", id);
  return *image;
}

// Asks Python about single records; an exception there ends the verb before anything is changed.
template <typename Id>
std::vector<bool> Ask(const std::function<bool(Id)>& remove, size_t count) {
  std::vector<bool> answers(count);
  for (size_t i = 0; i < count; ++i) answers[i] = remove(static_cast<Id>(i));
  return answers;
}

void BindImages(nb::class_<Reconstruction>* type) {
  type->def(
      "set_frame_pose",
      [](Reconstruction& m, frame_t id, const Rigid3d& pose) { m.SetFramePose(id, pose); },
      nb::arg("frame_id"), nb::arg("rig_from_world"),
      "The way to move cameras: sets the frame's pose and those of its images.");
  type->def(
      "register_frame", &Reconstruction::RegisterFrame, nb::arg("frame_id"),
      nb::arg("rig_from_world"),
      "Gives an unregistered frame a pose: it and its images go to the end of frames and images.");
  type->def("deregister_frame", &Reconstruction::DeregisterFrame, nb::arg("frame_id"),
            "Takes the pose away, with all observations in its images and the points and lines "
            "that fewer "
            "than two observations are left of. 2D features stay.");
  type->def("register_image", &Reconstruction::RegisterImage, nb::arg("image_id"),
            nb::arg("cam_from_world"), "The frame of an image; of a rig, the others with it.");
  type->def("deregister_image", &Reconstruction::DeregisterImage, nb::arg("image_id"));
  type->def("is_registered", &Reconstruction::IsRegistered, nb::arg("image_id"));
  type->def(
      "find_image",
      [](nb::object self, image_t id) -> std::optional<ImageRef> {
        auto* model = nb::cast<Reconstruction*>(self);
        if (model->FindImage(id) == nullptr) return std::nullopt;
        ImageRef ref;
        ref.owner = self;
        ref.model = model;
        ref.id = id;
        return ref;
      },
      nb::arg("image_id"), "Registered or not. None: there is no such image.");
  type->def(
      "add_camera",
      [](Reconstruction& m, const Camera& camera) {
        const camera_t id = m.cameras.NextId();
        m.cameras.Add(id, camera);
        return id;
      },
      nb::arg("camera"), "Returns its id.");
  type->def(
      "add_image",
      [](Reconstruction& m, std::string name, camera_t camera_id,
         std::optional<ArrayArg<double, -1, 2>> points2D, std::optional<image_t> image_id) {
        Image image;
        image.name = std::move(name);
        image.camera_id = camera_id;
        if (points2D) {
          for (size_t i = 0; i < points2D->shape(0); ++i)
            image.points2D.push_back({Eigen::Vector2d(points2D->data() + 2 * i), kNoId});
        }
        const image_t id =
            image_id.value_or(std::max(m.images.NextId(), m.unregistered_images.NextId()));
        m.AddUnregisteredImage(id, std::move(image));
        return id;
      },
      nb::arg("name"), nb::arg("camera_id"), nb::arg("points2D") = nb::none(),
      nb::arg("image_id") = nb::none(),
      "Adds an image without a pose, alone in a frame, with keypoints (n, 2), px. Returns its id.");
}

void BindPointsAndLines(nb::class_<Reconstruction>* type) {
  type->def(
      "add_point3D",
      [](Reconstruction& m, const Vec<3>& xyz, const Pairs& track, const std::string& origin,
         const std::tuple<uint8_t, uint8_t, uint8_t>& rgb) {
        return m.AddPoint3D(xyz.value, Track<PointObservation>(track), OriginOf(origin),
                            {std::get<0>(rgb), std::get<1>(rgb), std::get<2>(rgb)});
      },
      nb::arg("xyz"), nb::arg("track") = Pairs(), nb::arg("origin") = "detected",
      nb::arg("rgb") = std::tuple(0, 0, 0),
      nb::sig("def add_point3D(self, xyz: holba._types.ArrayLike, track: "
              "collections.abc.Sequence[tuple[int, int]] = ..., origin: str = 'detected', rgb: "
              "tuple[int, int, int] = (0, 0, 0)) -> int"),
      "A point (3,), world frame, with its observations (image id, index of the keypoint). A "
      "keypoint observes "
      "one point at most. Returns its id.");
  type->def(
      "add_line3D",
      [](Reconstruction& m, const Vec<3>& start, const Vec<3>& end, const Pairs& track) {
        if (!((end.value - start.value).norm() > 0.0))
          throw nb::value_error("expected two different points");
        return m.AddLine3D(PlueckerLine::FromPoints(start.value, end.value), start.value, end.value,
                           Track<LineObservation>(track));
      },
      nb::arg("start"), nb::arg("end"), nb::arg("track") = Pairs(),
      nb::sig("def add_line3D(self, start: holba._types.ArrayLike, end: holba._types.ArrayLike, "
              "track: collections.abc.Sequence[tuple[int, int]] = ...) -> int"),
      "The line through two points (3,), world frame, with its observations (image id, index of "
      "the segment). "
      "Returns its id.");
  type->def(
      "add_point_observation",
      [](Reconstruction& m, point3D_t id, image_t image_id, point2D_t idx) {
        m.AddObservation(id, PointObservation{image_id, idx});
      },
      nb::arg("point3D_id"), nb::arg("image_id"), nb::arg("point2D_idx"));
  type->def(
      "add_line_observation",
      [](Reconstruction& m, line3D_t id, image_t image_id, line2D_t idx) {
        m.AddObservation(id, LineObservation{image_id, idx});
      },
      nb::arg("line3D_id"), nb::arg("image_id"), nb::arg("line2D_idx"));
  type->def(
      "delete_point_observation",
      [](Reconstruction& m, image_t image_id, point2D_t idx) {
        m.DeleteObservation(PointObservation{image_id, idx});
      },
      nb::arg("image_id"), nb::arg("point2D_idx"), "The point stays, also without a track.");
  type->def(
      "delete_line_observation",
      [](Reconstruction& m, image_t image_id, line2D_t idx) {
        m.DeleteObservation(LineObservation{image_id, idx});
      },
      nb::arg("image_id"), nb::arg("line2D_idx"), "The line stays, also without a track.");
  type->def("delete_point3D", &Reconstruction::DeletePoint3D, nb::arg("point3D_id"),
            "With its observations, memberships and edges.");
  type->def("delete_line3D", &Reconstruction::DeleteLine3D, nb::arg("line3D_id"));
  type->def("merge_points3D", &Reconstruction::MergePoints3D, nb::arg("id"), nb::arg("other"),
            "`other` goes; what it had goes to `id`, which moves to the mean of both, weighted by "
            "their tracks.");
  type->def("merge_lines3D", &Reconstruction::MergeLines3D, nb::arg("id"), nb::arg("other"),
            "`other` goes; what it had goes to `id`, whose extent reaches over both.");
}

void BindGroups(nb::class_<Reconstruction>* type) {
  type->def(
      "add_group3D",
      [](Reconstruction& m, const std::string& name, std::vector<double> params,
         std::vector<point3D_t> points, std::vector<line3D_t> lines) {
        const GroupType& group_type = TypeOf(name);
        CheckGroupParams(group_type, params);
        return m.AddGroup3D(group_type, std::move(params), std::move(points), std::move(lines));
      },
      nb::arg("type"), nb::arg("params"), nb::arg("point3D_ids") = std::vector<point3D_t>(),
      nb::arg("line3D_ids") = std::vector<line3D_t>(),
      nb::sig("def add_group3D(self, type: str, params: collections.abc.Sequence[float] | "
              "numpy.typing.NDArray[numpy.float64], point3D_ids: collections.abc.Sequence[int] = "
              "..., line3D_ids: collections.abc.Sequence[int] = ...) -> int"),
      "A group of a type of holba.group_types(), with the plain parameters of docs/FORMAT.md. "
      "Returns its id. "
      "Raises InputError for parameters that are no such group.");
  type->def("delete_group3D", &Reconstruction::DeleteGroup3D, nb::arg("group3D_id"));
  type->def("add_point_member", &Reconstruction::AddPointMember, nb::arg("group3D_id"),
            nb::arg("point3D_id"), "False: it is a member already.");
  type->def("add_line_member", &Reconstruction::AddLineMember, nb::arg("group3D_id"),
            nb::arg("line3D_id"), "False: it is a member already.");
  type->def("delete_point_member", &Reconstruction::DeletePointMember, nb::arg("group3D_id"),
            nb::arg("point3D_id"), "False: it is none.");
  type->def("delete_line_member", &Reconstruction::DeleteLineMember, nb::arg("group3D_id"),
            nb::arg("line3D_id"), "False: it is none.");
  type->def("set_members", &Reconstruction::SetMembers, nb::arg("group3D_id"),
            nb::arg("point3D_ids"), nb::arg("line3D_ids"), "All members of a group at once.");
  type->def(
      "add_group_observation",
      [](Reconstruction& m, group3D_t id, image_t image_id, group2D_t idx) {
        m.AddObservation(id, GroupObservation{image_id, idx});
      },
      nb::arg("group3D_id"), nb::arg("image_id"), nb::arg("group2D_idx"));
  type->def(
      "delete_group_observation",
      [](Reconstruction& m, image_t image_id, group2D_t idx) {
        m.DeleteObservation(GroupObservation{image_id, idx});
      },
      nb::arg("image_id"), nb::arg("group2D_idx"));
  type->def("merge_groups3D", &Reconstruction::MergeGroups3D, nb::arg("id"), nb::arg("other"),
            "`other` goes; members, observations and relations go to `id`, whose parameters stay.");
  type->def(
      "add_edge",
      [](Reconstruction& m, point3D_t point, line3D_t line, uint64_t num_images) {
        return m.AddEdge({point, line, num_images});
      },
      nb::arg("point3D_id"), nb::arg("line3D_id"), nb::arg("num_images") = 0,
      "The point lies on the line. False: they are joined already.");
  type->def("delete_edge", &Reconstruction::DeleteEdge, nb::arg("point3D_id"), nb::arg("line3D_id"),
            "False: they are not joined.");
  type->def(
      "add_relation",
      [](Reconstruction& m, group3D_t a, group3D_t b, const std::string& relation) {
        return m.AddRelation({a, b, RelationOf(relation)});
      },
      nb::arg("group3D_id1"), nb::arg("group3D_id2"), nb::arg("relation"),
      "relation: orthogonal or parallel. False: the two have one already.");
  type->def("delete_relation", &Reconstruction::DeleteRelation, nb::arg("group3D_id1"),
            nb::arg("group3D_id2"), "False: they have none.");
}

void BindFeatures2D(nb::class_<Reconstruction>* type) {
  type->def(
      "add_point2D",
      [](Reconstruction& m, image_t id, const Vec<2>& xy) {
        CheckUnpinned(ImageOf(m, id).points2D.data());
        return m.AddPoint2D(id, xy.value);
      },
      nb::arg("image_id"), nb::arg("xy"),
      nb::sig("def add_point2D(self, image_id: int, xy: holba._types.ArrayLike) -> int"),
      "A keypoint (2,), px. Returns its index. BufferError while arrays show the image's "
      "keypoints.");
  type->def(
      "add_line2D",
      [](Reconstruction& m, image_t id, const Vec<2>& start, const Vec<2>& end) {
        CheckUnpinned(ImageOf(m, id).lines2D.data());
        return m.AddLine2D(id, {start.value, end.value});
      },
      nb::arg("image_id"), nb::arg("start"), nb::arg("end"),
      nb::sig("def add_line2D(self, image_id: int, start: holba._types.ArrayLike, end: "
              "holba._types.ArrayLike) -> int"),
      "A segment between two pixels (2,). Returns its index. BufferError while arrays show the "
      "image's segments.");
  type->def(
      "add_group2D",
      [](Reconstruction& m, image_t id, const std::string& name, std::vector<point2D_t> points,
         std::vector<line2D_t> lines) {
        ImageOf(m, id);
        return m.AddGroup2D(id, {&TypeOf(name), kNoId, std::move(points), std::move(lines)});
      },
      nb::arg("image_id"), nb::arg("type"), nb::arg("point2D_idxs") = std::vector<point2D_t>(),
      nb::arg("line2D_idxs") = std::vector<line2D_t>(), "Returns its index.");
  type->def(
      "remove_points2D",
      [](Reconstruction& m, image_t id, const std::function<bool(point2D_t)>& remove) {
        const auto& points = ImageOf(m, id).points2D;
        CheckUnpinned(points.data());
        const std::vector<bool> goes = Ask(remove, points.size());
        m.RemovePoints2D(id, [&](point2D_t idx) { return goes[idx]; });
      },
      nb::arg("image_id"), nb::arg("remove"),
      "Removes the keypoints for which remove(index) holds; indices of the others follow.");
  type->def(
      "remove_lines2D",
      [](Reconstruction& m, image_t id, const std::function<bool(line2D_t)>& remove) {
        const auto& lines = ImageOf(m, id).lines2D;
        CheckUnpinned(lines.data());
        const std::vector<bool> goes = Ask(remove, lines.size());
        m.RemoveLines2D(id, [&](line2D_t idx) { return goes[idx]; });
      },
      nb::arg("image_id"), nb::arg("remove"),
      "Removes the segments for which remove(index) holds; indices of the others follow.");
  type->def(
      "remove_groups2D",
      [](Reconstruction& m, image_t id, const std::function<bool(group2D_t)>& remove) {
        const std::vector<bool> goes = Ask(remove, ImageOf(m, id).groups2D.size());
        m.RemoveGroups2D(id, [&](group2D_t idx) { return goes[idx]; });
      },
      nb::arg("image_id"), nb::arg("remove"));
}

// Ids that Python named, as a set to ask.
template <typename Id>
std::function<bool(Id)> Among(std::vector<Id> ids) {
  std::sort(ids.begin(), ids.end());
  return [ids = std::move(ids)](Id id) { return std::binary_search(ids.begin(), ids.end(), id); };
}

void BindMany(nb::class_<Reconstruction>* type) {
  type->def(
      "delete_points3D",
      [](Reconstruction& m, std::vector<point3D_t> ids) {
        m.DeletePoints3D(
            [goes = Among(std::move(ids))](point3D_t id, const Point3D&) { return goes(id); });
      },
      nb::arg("point3D_ids"),
      "Many at once, in one pass over the model; ids that are not there are passed over.");
  type->def(
      "delete_lines3D",
      [](Reconstruction& m, std::vector<line3D_t> ids) {
        m.DeleteLines3D(
            [goes = Among(std::move(ids))](line3D_t id, const Line3D&) { return goes(id); });
      },
      nb::arg("line3D_ids"));
  type->def(
      "delete_groups3D",
      [](Reconstruction& m, std::vector<group3D_t> ids) {
        m.DeleteGroups3D(
            [goes = Among(std::move(ids))](group3D_t id, const Group3D&) { return goes(id); });
      },
      nb::arg("group3D_ids"));
  type->def_prop_ro(
      "wireframe",
      [](const Reconstruction& m) {
        std::vector<std::tuple<uint64_t, uint64_t, uint64_t>> out;
        for (const WireframeEdge& e : m.wireframe)
          out.emplace_back(e.point3D_id, e.line3D_id, e.num_images);
        return out;
      },
      "(point id, line id, number of images that saw them meet) of each edge, a copy.");
  type->def_prop_ro(
      "relations",
      [](const Reconstruction& m) {
        std::vector<std::tuple<uint64_t, uint64_t, std::string>> out;
        for (const Relation& r : m.relations)
          out.emplace_back(r.group3D_id1, r.group3D_id2,
                           r.type == RelationType::kOrthogonal ? "orthogonal" : "parallel");
        return out;
      },
      "(group id, group id, orthogonal or parallel), a copy.");
}

}  // namespace

void BindVerbs(nb::class_<Reconstruction>* model) {
  BindImages(model);
  BindPointsAndLines(model);
  BindGroups(model);
  BindFeatures2D(model);
  BindMany(model);
}

}  // namespace holba::python
