// SPDX-License-Identifier: BSD-3-Clause
// Which part of a model an adjustment moves.
#include <fmt/format.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <set>

#include "calls.h"
#include "holba/bundle/bundle_selection.h"
#include "module.h"
#include "options.h"

namespace holba::python {
namespace {

template <typename Item>
auto Pairs(const std::vector<Item>& items) {
  std::vector<std::pair<uint64_t, bool>> out;
  for (const Item& item : items) out.emplace_back(item.id, item.constant);
  return out;
}

template <typename Item>
void Hold(std::vector<Item>* items, const std::vector<uint64_t>& ids) {
  const std::set<uint64_t> held(ids.begin(), ids.end());
  for (Item& item : *items) item.constant = item.constant || held.contains(item.id);
}

template <typename Item>
void Drop(std::vector<Item>* items, const std::vector<uint64_t>& ids) {
  const std::set<uint64_t> dropped(ids.begin(), ids.end());
  std::erase_if(*items, [&](const Item& item) { return dropped.contains(item.id); });
}

// Which were held by hand may fix the gauge now, or no longer.
void SetGauges(BundleSelection* s, const Reconstruction& model, const AdjustOptions& options) {
  s->SetGauges(ChooseGaugesOfParts(model, options.values.bundle, *s));
}

}  // namespace

void BindSelection(nb::module_& m) {
  nb::class_<BundleSelection> type =
      nb::borrow<nb::class_<BundleSelection>>(nb::type<BundleSelection>());
  type.attr("__doc__") =
      "Which part of a model takes part in an adjustment, and what of it is held; made by "
      "holba.select_all and "
      "holba.select_around. What is not named stays as it is.";
  type.def_prop_ro(
      "frames", [](const BundleSelection& s) { return Pairs(s.frames); }, "(id, held) of each.");
  type.def_prop_ro(
      "cameras", [](const BundleSelection& s) { return Pairs(s.cameras); },
      "(id, intrinsics held); those of the images that are not here are held.");
  type.def_prop_ro(
      "points", [](const BundleSelection& s) { return Pairs(s.points); }, "(id, held) of each.");
  type.def_prop_ro(
      "lines", [](const BundleSelection& s) { return Pairs(s.lines); }, "(id, held) of each.");
  type.def_prop_ro(
      "groups", [](const BundleSelection& s) { return Pairs(s.groups); }, "(id, held) of each.");
  type.def("hold_cameras", &BundleSelection::HoldCameras, "Poses and intrinsics stay as they are.");
  type.def("hold_points", &BundleSelection::HoldPoints);
  type.def("hold_lines", &BundleSelection::HoldLines);
  type.def("_hold",
           [](BundleSelection& s, const Reconstruction& model, const AdjustOptions& options,
              const std::string& what, const std::vector<uint64_t>& ids) {
             if (what == "frames") Hold(&s.frames, ids);
             if (what == "cameras") Hold(&s.cameras, ids);
             if (what == "points") Hold(&s.points, ids);
             if (what == "lines") Hold(&s.lines, ids);
             if (what == "groups") Hold(&s.groups, ids);
             SetGauges(&s, model, options);
           });
  type.def("_drop",
           [](BundleSelection& s, const Reconstruction& model, const AdjustOptions& options,
              const std::string& what, const std::vector<uint64_t>& ids) {
             if (what == "points") Drop(&s.points, ids);
             if (what == "lines") Drop(&s.lines, ids);
             if (what == "groups") Drop(&s.groups, ids);
             SetGauges(&s, model, options);
           });
  type.def("copy", [](const BundleSelection& s) { return BundleSelection(s); });
  type.def("__repr__", [](const BundleSelection& s) {
    return fmt::format("BundleSelection of {} frames, {} points, {} lines, {} groups",
                       s.frames.size(), s.points.size(), s.lines.size(), s.groups.size());
  });
  m.def("_select_all", [](const Reconstruction& model, const AdjustOptions& options) {
    return Unlocked([&] { return BundleSelection::Everything(model, options.values.bundle); });
  });
  m.def("_select_around",
        [](const Reconstruction& model, const std::vector<image_t>& image_ids, bool surroundings,
           bool hold_intrinsics, const AdjustOptions& options) {
          for (image_t id : image_ids) {
            if (!model.images.contains(id))
              throw nb::key_error(
                  fmt::format("there is no image {} with a pose in the model", id).c_str());
          }
          return Unlocked([&] {
            return BundleSelection::Around(
                model, options.values.bundle, image_ids,
                {.surroundings = surroundings, .hold_cameras = hold_intrinsics});
          });
        });
}

}  // namespace holba::python
