// SPDX-License-Identifier: BSD-3-Clause
// Covariances of an adjusted model.
#include "holba/bundle/uncertainty.h"

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include <filesystem>

#include "arrays.h"
#include "calls.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/io/uncertainty_file.h"
#include "module.h"
#include "options.h"
#include "records.h"

namespace holba::python {
namespace {

template <typename Map>
auto& At(const Map& map, const char* name, uint64_t id) {
  const auto found = map.find(static_cast<typename Map::key_type>(id));
  if (found == map.end()) NoRecord(name, id);
  return found->second;
}

template <int N, typename Map>
std::tuple<Array<uint64_t, -1>, Array<double, -1, N, N>> All(const Map& map) {
  std::vector<uint64_t> ids;
  std::vector<double> values;
  for (const auto& [id, covariance] : map) {
    ids.push_back(id);
    // Symmetric: the order of storage does not matter.
    values.insert(values.end(), covariance.data(), covariance.data() + N * N);
  }
  const size_t n = ids.size();
  return {Owned1(std::move(ids)),
          Owned<Array<double, -1, N, N>>(std::move(values), {n, size_t{N}, size_t{N}})};
}

}  // namespace

void BindUncertainty(nb::module_& m) {
  nb::class_<ModelUncertainty> type(
      m, "ModelUncertainty",
      "Covariances of the elements of an adjusted model, with the gauge that it held (what was "
      "held has 0), in "
      "model units. Elements that nothing determines are missing (KeyError).");
  type.def_ro("sigma_px", &ModelUncertainty::sigma_px,
              "Measured standard deviation of one observed coordinate, px.");
  type.def(
      "pose",
      [](const ModelUncertainty& u, frame_t id) {
        return ToArray<6, 6>(At(u.poses, "covariance of frame", id));
      },
      nb::arg("frame_id"),
      "(6, 6) of rig_from_world: rotation vector w (rad) of R' = exp(w) R, then translation.");
  type.def(
      "point",
      [](const ModelUncertainty& u, point3D_t id) {
        return ToArray<3, 3>(At(u.points, "covariance of point", id));
      },
      nb::arg("point3D_id"), "(3, 3) of the position.");
  type.def(
      "line",
      [](const ModelUncertainty& u, line3D_t id) {
        const LineCovariance& c = At(u.lines, "covariance of line", id);
        return std::tuple(ToArray<3, 3>(c.start), ToArray<3, 3>(c.end));
      },
      nb::arg("line3D_id"),
      "(3, 3) of the start and of the end of its extent; along the line they are held.");
  type.def(
      "group",
      [](const ModelUncertainty& u, group3D_t id) {
        return ToArray<-1, -1>(At(u.groups, "covariance of group", id));
      },
      nb::arg("group3D_id"), "(n, n) of the plain parameters of the files.");
  type.def(
      "poses", [](const ModelUncertainty& u) { return All<6>(u.poses); },
      "Frame ids (n,) and covariances (n, 6, 6).");
  type.def(
      "points", [](const ModelUncertainty& u) { return All<3>(u.points); },
      "Point ids (n,) and covariances (n, 3, 3).");
  type.def(
      "write",
      [](const ModelUncertainty& u, const std::filesystem::path& path) {
        Unlocked([&] { WriteUncertainty(u, path); });
      },
      nb::arg("path"), "As the program's covariances.txt. Raises InputError.");
  m.def("_covariances", [](const Reconstruction& model, const BundleSummary& summary,
                           const AdjustOptions& options) {
    BundleOptions bundle = options.values.bundle;
    bundle.SetDefaultLosses(false);
    return Unlocked([&] {
      return EstimateUncertainty(model, bundle, summary, options.values.solver.num_threads);
    });
  });
}

}  // namespace holba::python
