// SPDX-License-Identifier: BSD-3-Clause
// holistic.json: the format version and the frame that the side files belong to. COLMAP's tools
// move the cameras of a model without knowing our files; the stated frame shows it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "holba/scene/reconstruction.h"

namespace holba {

// Mean of the camera centres and root mean square distance from it, model units.
struct ModelFrame {
  uint64_t num_images = 0;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  double spread = 0.0;
};

// What to do where the side files do not fit the cameras, points or lines of the model; ends a
// message.
inline constexpr const char* kSideFilesRemedy =
    "a tool that does not know the side files has changed the model, so that lines and groups no "
    "longer fit it; restore the COLMAP files, or make the change with this program's commands, or "
    "remove the side files (lines2D, lines3D, groups2D, groups3D, wireframe, relations, "
    "point_origins and holistic.json) to read a plain COLMAP model";

ModelFrame FrameOf(const Reconstruction& model);

// Throws InputError: no JSON, another format version, fields that are missing or of a wrong kind.
ModelFrame ParseHolisticJson(std::string_view bytes, const std::filesystem::path& path);
std::string HolisticJson(const ModelFrame& frame);

// Throws InputError if the poses of the model disagree with the stated frame by more than 1 % of
// the spread.
void CheckFrame(const ModelFrame& stated, const ModelFrame& actual,
                const std::filesystem::path& path);

}  // namespace holba
