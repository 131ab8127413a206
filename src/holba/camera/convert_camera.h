// SPDX-License-Identifier: BSD-3-Clause
// A camera in the parameters of another model.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "holba/camera/camera_model.h"

namespace holba {

// Parameters of `to` that see the rays of `from` where that sees them, as nearly as they can: least
// squares in pixels over a grid of the image (width x height px). The principal point is kept.
// Exact where `to` contains the other camera. Empty: too few pixels have a ray, or no such camera
// is found.
std::optional<std::vector<double>> ConvertCamera(const CameraModel& from,
                                                 std::span<const double> params, double width,
                                                 double height, const CameraModel& to);

}  // namespace holba
