// SPDX-License-Identifier: BSD-3-Clause
// Cameras: values that do not change; a model's is replaced as a whole.
#include <fmt/format.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <limits>

#include "arrays.h"
#include "holba/base/error.h"
#include "holba/scene/reconstruction.h"
#include "module.h"

namespace holba::python {
namespace {

std::string ModelNames() {
  std::string names;
  for (const CameraModel* model : AllCameraModels())
    names += (names.empty() ? "" : ", ") + std::string(model->name);
  return names;
}

Camera MakeCamera(const std::string& model, uint64_t width, uint64_t height,
                  std::vector<double> params) {
  Camera camera{FindCameraModel(model), width, height, std::move(params)};
  if (camera.model == nullptr)
    throw InputError(
        fmt::format("camera model: expected one of {}, found '{}'", ModelNames(), model));
  if (camera.params.size() != static_cast<size_t>(camera.model->num_params)) {
    throw InputError(fmt::format("params of {}: expected {} ({}), found {}", camera.model->name,
                                 camera.model->num_params, camera.model->param_names,
                                 camera.params.size()));
  }
  for (double x : camera.params) {
    if (!std::isfinite(x))
      throw InputError(
          fmt::format("params of {}: expected finite numbers, found {}", camera.model->name, x));
  }
  return camera;
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void BindCameras(nb::module_& m) {
  nb::class_<Camera> camera(m, "Camera",
                            "Intrinsics of a camera, by the names of COLMAP's models. It does not "
                            "change: a model's camera "
                            "is replaced, model.cameras[id] = camera.replace(params=...).");
  camera.def(
      "__init__",
      [](Camera* self, const std::string& model, uint64_t width, uint64_t height,
         std::vector<double> params) {
        new (self) Camera(MakeCamera(model, width, height, std::move(params)));
      },
      nb::arg("model"), nb::arg("width"), nb::arg("height"), nb::arg("params"),
      nb::sig("def __init__(self, model: str, width: int, height: int, params: "
              "collections.abc.Sequence[float] | numpy.typing.NDArray[numpy.float64]) -> None"),
      "model: \"PINHOLE\", \"OPENCV\", ...; width, height: px; params: in COLMAP's order, px and "
      "without unit. Raises InputError for an unknown model and parameters that do not fit it.");
  camera.def_prop_ro(
      "model", [](const Camera& c) { return std::string(c.model->name); },
      "Name of the model, COLMAP's.");
  camera.def_prop_ro(
      "model_id", [](const Camera& c) { return c.model->id; }, "COLMAP's number of it.");
  camera.def_ro("width", &Camera::width, "px");
  camera.def_ro("height", &Camera::height, "px");
  camera.def_prop_ro(
      "params", [](const Camera& c) { return Owned1(c.params); }, "(n,) a copy of the parameters.");
  camera.def_prop_ro(
      "param_names", [](const Camera& c) { return std::string(c.model->param_names); },
      "\"f cx cy k\"");
  camera.def_prop_ro(
      "focal_length_idxs",
      [](const Camera& c) {
        return std::vector<int>(c.model->focal_idxs.begin(), c.model->focal_idxs.end());
      },
      "Which parameters are focal lengths.");
  camera.def(
      "replace",
      [](const Camera& c, std::optional<std::vector<double>> params, std::optional<uint64_t> width,
         std::optional<uint64_t> height) {
        return MakeCamera(std::string(c.model->name), width.value_or(c.width),
                          height.value_or(c.height), params ? std::move(*params) : c.params);
      },
      nb::kw_only(), nb::arg("params") = nb::none(), nb::arg("width") = nb::none(),
      nb::arg("height") = nb::none(),
      nb::sig("def replace(self, *, params: collections.abc.Sequence[float] | "
              "numpy.typing.NDArray[numpy.float64] | None = None, width: int | None = None, "
              "height: int | None = None) -> Camera"),
      "The camera with other values. Raises InputError.");
  camera.def(
      "calibration_matrix",
      [](const Camera& c) {
        const IdealCalibration k = c.model->ideal_calibration(c.params.data());
        Eigen::Matrix3d K;
        K << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1;
        return ToArray<3, 3>(K);
      },
      "(3, 3) K of the ideal pixels, px.");
  camera.def(
      "project",
      [](const Camera& c, const ArrayArg<double, -1, 3>& points) {
        std::vector<double> pixels(2 * points.shape(0), kNan);
        for (size_t i = 0; i < points.shape(0); ++i) {
          Eigen::Vector2d pixel;
          if (c.model->project(c.params.data(), Eigen::Vector3d(points.data() + 3 * i), &pixel))
            Eigen::Map<Eigen::Vector2d>(pixels.data() + 2 * i) = pixel;
        }
        return OwnedRows<2>(std::move(pixels));
      },
      nb::arg("points_in_cam"),
      "Pixels (n, 2) of points (n, 3) in the camera's frame; NaN where a point has no image.");
  camera.def(
      "unproject",
      [](const Camera& c, const ArrayArg<double, -1, 2>& pixels) {
        std::vector<double> rays(3 * pixels.shape(0), kNan);
        for (size_t i = 0; i < pixels.shape(0); ++i) {
          const auto ray =
              c.model->unproject(c.params.data(), Eigen::Vector2d(pixels.data() + 2 * i));
          if (ray) Eigen::Map<Eigen::Vector3d>(rays.data() + 3 * i) = *ray;
        }
        return OwnedRows<3>(std::move(rays));
      },
      nb::arg("pixels"),
      "Unit rays (n, 3) in the camera's frame of pixels (n, 2); NaN where a pixel has none.");
  camera.def(
      "__eq__",
      [](const Camera& a, const Camera& b) {
        return a.model == b.model && a.width == b.width && a.height == b.height &&
               a.params == b.params;
      },
      nb::is_operator(), nb::sig("def __eq__(self, other: object, /) -> bool"));
  camera.def("__repr__", [](const Camera& c) {
    return fmt::format("Camera(model='{}', width={}, height={}, params=[{}])", c.model->name,
                       c.width, c.height, fmt::join(c.params, ", "));
  });
  camera.def("__getstate__", [](const Camera& c) {
    return nb::make_tuple(std::string(c.model->name), c.width, c.height, c.params);
  });
  camera.def("__setstate__", [](Camera* self, nb::tuple state) {
    new (self)
        Camera(MakeCamera(nb::cast<std::string>(state[0]), nb::cast<uint64_t>(state[1]),
                          nb::cast<uint64_t>(state[2]), nb::cast<std::vector<double>>(state[3])));
  });
  m.def(
      "camera_models",
      [] {
        std::vector<std::string> names;
        for (const CameraModel* model : AllCameraModels()) names.emplace_back(model->name);
        return names;
      },
      "Names of all camera models.");
}

}  // namespace holba::python
