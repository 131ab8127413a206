// SPDX-License-Identifier: BSD-3-Clause
// Adjustment problems in the text form of Bundle Adjustment in the Large (Agarwal et al., ECCV
// 2010):
//   NUM_CAMERAS NUM_POINTS NUM_OBSERVATIONS, then CAMERA_IDX POINT_IDX X Y for each observation,
//   then nine numbers for each camera (rotation vector, translation, f, k1, k2) and three for each
//   point.
// There, P = R X + t looks along -z and pixels count from the principal point, x right, y up:
//   p = -P / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p.
// With y and z of the camera turned round (diag(1, -1, -1) P) and y of the pixels negated this is
// the RADIAL camera model with principal point (0, 0), but that points behind the camera have
// pixels too (camera/snavely.h).
#pragma once

#include <filesystem>
#include <ostream>
#include <string_view>

#include "holba/scene/reconstruction.h"

namespace holba {

// Whether a file begins like a BAL problem.
bool IsBalFile(const std::filesystem::path& path);

// One camera for each image, ids from 1 in the order of the file, width and height 0. Throws
// InputError.
Reconstruction ReadBal(const std::filesystem::path& path);
Reconstruction ParseBal(std::string_view bytes, const std::filesystem::path& path);

// The inverse of ReadBal, for models whose cameras fit: SIMPLE_PINHOLE, PINHOLE with fx = fy,
// SIMPLE_RADIAL, RADIAL. Pixels are moved by the principal point. Lines and groups are left out.
// Throws InputError.
void WriteBal(const Reconstruction& model, const std::filesystem::path& path);
void FormatBal(const Reconstruction& model, std::ostream* stream);

}  // namespace holba
