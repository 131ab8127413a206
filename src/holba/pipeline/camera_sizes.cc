// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/camera_sizes.h"

#include <map>
#include <optional>

#include "holba/base/error.h"
#include "holba/frontend/photographs/photograph_header.h"

namespace holba {
namespace {

std::optional<PhotographHeader> HeaderIfAny(const std::filesystem::path& path) {
  try {
    return ReadPhotographHeader(path);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

bool HasPrincipalPointAtOrigin(const Camera& camera) {
  const auto idxs = camera.model->principal_point_idxs;
  return idxs.size() == 2 && camera.params[idxs[0]] == 0.0 && camera.params[idxs[1]] == 0.0;
}

}  // namespace

size_t TakeSizesFromPhotographs(const PhotographFolder& photographs, Reconstruction* model) {
  std::map<camera_t, Eigen::Vector2d> shift_px;
  size_t num_cameras = 0;
  for (const auto& [image_id, image] : model->images) {
    Camera& camera = model->cameras.at(image.camera_id);
    if (camera.width != 0 || camera.height != 0) continue;
    const std::optional<PhotographHeader> header = HeaderIfAny(photographs / image.name);
    if (!header) continue;
    camera.width = header->width;
    camera.height = header->height;
    ++num_cameras;
    if (!HasPrincipalPointAtOrigin(camera)) continue;
    const Eigen::Vector2d middle(0.5 * static_cast<double>(camera.width),
                                 0.5 * static_cast<double>(camera.height));
    for (int i = 0; i < 2; ++i) camera.params[camera.model->principal_point_idxs[i]] = middle[i];
    shift_px.emplace(image.camera_id, middle);
  }
  for (auto* images : {&model->images, &model->unregistered_images}) {
    for (auto& [image_id, image] : *images) {
      const auto shift = shift_px.find(image.camera_id);
      if (shift == shift_px.end()) continue;
      for (Point2D& point : image.points2D) point.xy += shift->second;
      for (Line2D& line : image.lines2D) {
        line.segment.start += shift->second;
        line.segment.end += shift->second;
      }
    }
  }
  return num_cameras;
}

}  // namespace holba
