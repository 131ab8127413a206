// SPDX-License-Identifier: BSD-3-Clause
// Images of a model with their 2D features as arrays that show them where they lie.
#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "arrays.h"
#include "records.h"

namespace holba::python {
namespace {

// A view of one member of the elements of a vector. `first(element)`: where the numbers of that
// member begin; they are of the shape `inner`.
template <typename A, typename Element, typename First>
A MemberView(std::vector<Element>& elements, const First& first,
             std::initializer_list<size_t> inner, const nb::object& owner) {
  using Scalar = std::remove_pointer_t<decltype(first(elements[0]))>;
  static_assert(sizeof(Element) % sizeof(Scalar) == 0);
  std::vector<size_t> shape{elements.size()};
  shape.insert(shape.end(), inner);
  std::vector<int64_t> strides(shape.size());
  int64_t stride = 1;
  for (size_t i = shape.size(); --i > 0;) {
    strides[i] = stride;
    stride *= static_cast<int64_t>(shape[i]);
  }
  strides[0] = sizeof(Element) / sizeof(Scalar);
  static std::remove_const_t<Scalar> nothing{};  // an empty array has to be somewhere, too
  if (elements.empty()) return A(&nothing, shape.size(), shape.data(), nb::none(), strides.data());
  return A(first(elements[0]), shape.size(), shape.data(), Pin(elements.data(), owner),
           strides.data());
}

using Pixels = Array<double, -1, 2>;
using Segments = Array<double, -1, 2, 2>;
using FeatureIds = Array<const uint64_t, -1>;

}  // namespace

void BindImage(nb::module_& m) {
  nb::class_<ImageRef> type(m, "Image",
                            "An image of a model. Once it is gone, its use raises KeyError.");
  type.def_prop_ro("id", [](const ImageRef& r) { return r.id; });
  type.def(
      "__eq__",
      [](const ImageRef& a, const ImageRef& b) { return a.model == b.model && a.id == b.id; },
      nb::is_operator(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  type.def("__hash__", [](const ImageRef& r) { return static_cast<nb::ssize_t>(r.id); });
  type.def_prop_rw(
      "name", [](const ImageRef& r) { return r.Get().name; },
      [](const ImageRef& r, std::string name) { r.Get().name = std::move(name); });
  type.def_prop_ro("camera_id", [](const ImageRef& r) { return r.Get().camera_id; });
  type.def_prop_ro("frame_id", [](const ImageRef& r) { return r.Get().frame_id; });
  type.def_prop_ro(
      "is_registered",
      [](const ImageRef& r) {
        r.Get();
        return r.model->IsRegistered(r.id);
      },
      "Whether it has a pose.");
  type.def_prop_ro(
      "cam_from_world",
      [](const ImageRef& r) -> std::optional<Rigid3d> {
        const Image& image = r.Get();
        if (!r.model->IsRegistered(r.id)) return std::nullopt;
        return image.cam_from_world;
      },
      "Its pose; None while it is not registered.");
  type.def_prop_ro(
      "points2D",
      [](const ImageRef& r) {
        return MemberView<Pixels>(
            r.Get().points2D, [](Point2D& p) { return p.xy.data(); }, {2}, r.owner);
      },
      "(n, 2) keypoints, px: a view, no copy; the centre of the top left pixel is at (0.5, 0.5).");
  type.def_prop_ro(
      "point3D_ids",
      [](const ImageRef& r) {
        return MemberView<FeatureIds>(
            r.Get().points2D, [](Point2D& p) -> const uint64_t* { return &p.point3D_id; }, {},
            r.owner);
      },
      "(n,) which point each keypoint observes, holba.NO_ID: none. A view that cannot be written.");
  type.def_prop_ro(
      "lines2D",
      [](const ImageRef& r) {
        return MemberView<Segments>(
            r.Get().lines2D, [](Line2D& l) { return l.segment.start.data(); }, {2, 2}, r.owner);
      },
      "(n, 2, 2) start and end of each segment, px: a view, no copy.");
  type.def_prop_ro(
      "line3D_ids",
      [](const ImageRef& r) {
        return MemberView<FeatureIds>(
            r.Get().lines2D, [](Line2D& l) -> const uint64_t* { return &l.line3D_id; }, {},
            r.owner);
      },
      "(n,) which line each segment observes, holba.NO_ID: none. A view that cannot be written.");
  type.def_prop_ro(
      "groups2D",
      [](const ImageRef& r) {
        std::vector<std::tuple<std::string, uint64_t, std::vector<uint32_t>, std::vector<uint32_t>>>
            out;
        for (const Group2D& g : r.Get().groups2D)
          out.emplace_back(std::string(g.type->name), g.group3D_id, g.point2D_idxs, g.line2D_idxs);
        return out;
      },
      "(type, group id or holba.NO_ID, indices of its keypoints, of its segments) of each, a "
      "copy.");
  type.def("__repr__", [](const ImageRef& r) {
    const Image& image = r.Get();
    return fmt::format("Image(id={}, name='{}', camera_id={}, {} points2D, {} lines2D)", r.id,
                       image.name, image.camera_id, image.points2D.size(), image.lines2D.size());
  });
}

}  // namespace holba::python
