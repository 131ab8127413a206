// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/words.h"
#include "holba/geometry/angle.h"
#include "holba/render/photographer.h"

namespace holba {
namespace {

// What the parameters beyond focal length and principal point are if no one says: no distortion, or
// for models that are nothing without it, that of a usual lens.
std::vector<double> UsualExtraParams(const CameraModel& model) {
  std::vector<double> extra(model.extra_idxs.size(), 0.0);
  if (model.name == "FOV") extra = {0.9};
  if (model.name == "EUCM") extra = {0.6, 1.1};
  return extra;
}

// Degrees between the rays of the middles of the left and right rim. Empty: one of them has none.
std::optional<double> FieldOfView(const Camera& camera) {
  const double y = 0.5 * static_cast<double>(camera.height);
  const auto left = camera.model->unproject(camera.params.data(), {0.0, y});
  const auto right =
      camera.model->unproject(camera.params.data(), {static_cast<double>(camera.width), y});
  if (!left || !right) return std::nullopt;
  // Each side on its own: together they may be more than a half turn.
  const auto from_axis = [](const Eigen::Vector3d& ray) {
    return std::atan2(std::hypot(ray.x(), ray.y()), ray.z());
  };
  return (from_axis(*left) + from_axis(*right)) * 180.0 / std::numbers::pi;
}

}  // namespace

void RenderCameraOptions::Describe(OptionTable* table) const {
  table->Section("Camera");
  table->Field("width", &width, Between(16, 20000), "Width of a photograph in pixels.").Basic();
  table->Field("height", &height, Between(16, 20000), "Height of a photograph in pixels.").Basic();
  table->Field("model", &model, "COLMAP's name of the camera's model, as OPENCV or OPENCV_FISHEYE.")
      .Basic();
  table
      ->Field("field_of_view_deg", &field_of_view_deg, Between(0, 350),
              "Horizontal field of view in degrees; 0: what suits the place.")
      .Basic();
  table->Field("params", &params, AnyValue(),
               "All parameters of the model in COLMAP's order, instead of it.");
  table->Field("extra_params", &extra_params, AnyValue(),
               "Parameters beyond focal length and principal point: the distortion.");
  table->Section("");
}

Camera MakeCamera(const RenderCameraOptions& options, double usual_field_of_view_deg) {
  const CameraModel* model = FindCameraModel(options.model);
  if (model == nullptr) {
    throw InputError(fmt::format(
        "unknown camera model '{}'; give one of COLMAP's, as PINHOLE or OPENCV", options.model));
  }
  Camera camera{
      model, static_cast<uint64_t>(options.width), static_cast<uint64_t>(options.height), {}};
  const auto num_params = static_cast<size_t>(model->num_params);
  if (!options.params.empty()) {
    if (options.params.size() != num_params) {
      throw InputError(fmt::format("Camera.params: expected {} of {} ({}), found {}",
                                   Counted(num_params, "parameter"), model->name,
                                   model->param_names, options.params.size()));
    }
    camera.params = options.params;
    return camera;
  }
  if (model->focal_idxs.empty()) {  // the whole sphere: as the image is
    camera.params = {static_cast<double>(options.width), static_cast<double>(options.height)};
    return camera;
  }
  const std::vector<double> extra =
      options.extra_params.empty() ? UsualExtraParams(*model) : options.extra_params;
  if (extra.size() != model->extra_idxs.size()) {
    throw InputError(fmt::format("Camera.extra_params: expected {} of {} ({}), found {}",
                                 Counted(model->extra_idxs.size(), "parameter"), model->name,
                                 model->param_names, extra.size()));
  }
  camera.params.assign(num_params, 0.0);
  for (size_t i = 0; i < extra.size(); ++i) {
    camera.params[static_cast<size_t>(model->extra_idxs[i])] = extra[i];
  }
  const std::span<const int> centre = model->principal_point_idxs;
  camera.params[static_cast<size_t>(centre[0])] = 0.5 * options.width;
  camera.params[static_cast<size_t>(centre[1])] = 0.5 * options.height;
  // The focal length with this field of view: a longer one sees less.
  const double wanted_deg =
      options.field_of_view_deg > 0.0 ? options.field_of_view_deg : usual_field_of_view_deg;
  double low = std::log(1e-3 * options.width), high = std::log(1e3 * options.width);
  for (int step = 0; step < 100; ++step) {
    const double middle = 0.5 * (low + high);
    for (const int idx : model->focal_idxs)
      camera.params[static_cast<size_t>(idx)] = std::exp(middle);
    const auto found_deg = FieldOfView(camera);
    (!found_deg || *found_deg > wanted_deg ? low : high) = middle;
  }
  const auto found_deg = FieldOfView(camera);
  if (!found_deg || std::abs(*found_deg - wanted_deg) > 0.1) {
    throw InputError(fmt::format(
        "no {} camera sees {:g} degrees with this distortion; change Camera.field_of_view_deg or "
        "Camera.extra_params",
        model->name, wanted_deg));
  }
  return camera;
}

}  // namespace holba
