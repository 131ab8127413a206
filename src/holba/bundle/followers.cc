// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/followers.h"

#include <optional>

#include "holba/bundle/reprojection.h"
#include "holba/scene/track_images.h"

namespace holba {
namespace {

bool IsPresent(const Reconstruction& model, const Image& image, const Point3D& point,
               const PointObservation&) {
  return PixelOf(model, image, point.xyz).has_value();
}
bool IsPresent(const Reconstruction& model, const Image& image, const Line3D& line,
               const LineObservation& observation) {
  return EndOffsets(model, image, line.line, observation).has_value();
}

template <typename Id, typename Record>
std::vector<SeenOnce<Id>> SeenOnceOf(const Reconstruction& model,
                                     const IdMap<Id, Record>& records) {
  std::vector<SeenOnce<Id>> found;
  for (const auto& [id, record] : records) {
    const auto is_present = [&](const auto& observation) {
      return IsPresent(model, model.images.at(observation.image_id), record, observation);
    };
    const TrackImages images = ImagesOfTrack(record.track, is_present);
    if (!images.are_several) found.push_back({id, images.first});
  }
  return found;
}

}  // namespace

std::vector<SeenOnce<point3D_t>> PointsSeenOnce(const Reconstruction& model) {
  return SeenOnceOf(model, model.points3D);
}

std::vector<SeenOnce<line3D_t>> LinesSeenOnce(const Reconstruction& model) {
  return SeenOnceOf(model, model.lines3D);
}

Followers::Followers(const Reconstruction& model, std::span<const SeenOnce<point3D_t>> points,
                     std::span<const SeenOnce<line3D_t>> lines) {
  for (const auto& [id, image_id] : points) {
    if (image_id == kInvalidId32) continue;
    points_.push_back({id,
                       image_id,
                       ViewOf(model, image_id),
                       {SeenIn(model, image_id, model.points3D.at(id).xyz)}});
  }
  for (const auto& [id, image_id] : lines) {
    if (image_id == kInvalidId32) continue;
    const Line3D& line = model.lines3D.at(id);
    lines_.push_back({id,
                      image_id,
                      ViewOf(model, image_id),
                      {SeenIn(model, image_id, line.line.ClosestPoint(line.start)),
                       SeenIn(model, image_id, line.line.ClosestPoint(line.end))}});
  }
}

void Followers::Place(Reconstruction* model) const {
  for (const auto& point : points_) {
    if (IsAsItWas(*model, point.image_id, point.view)) continue;
    model->points3D.at(point.id).xyz =
        PositionNow(*model, point.image_id, point.view, point.seen[0]);
  }
  for (const auto& follower : lines_) {
    if (IsAsItWas(*model, follower.image_id, follower.view)) continue;
    const Eigen::Vector3d start =
        PositionNow(*model, follower.image_id, follower.view, follower.seen[0]);
    const Eigen::Vector3d end =
        PositionNow(*model, follower.image_id, follower.view, follower.seen[1]);
    if (!((end - start).norm() > 0.0)) continue;
    Line3D& line = model->lines3D.at(follower.id);
    line.line = PlueckerLine::FromPoints(start, end);
    line.start = start;
    line.end = end;
  }
}

Followers::View Followers::ViewOf(const Reconstruction& model, image_t image_id) {
  const Image& image = model.images.at(image_id);
  return {image.cam_from_world, model.cameras.at(image.camera_id).params};
}

Followers::Seen Followers::SeenIn(const Reconstruction& model, image_t image_id,
                                  const Eigen::Vector3d& X) {
  const Image& image = model.images.at(image_id);
  return {image.cam_from_world * X, PixelOf(model, image, X)};
}

Eigen::Vector3d Followers::PositionNow(const Reconstruction& model, image_t image_id,
                                       const View& before, const Seen& seen) {
  const Image& image = model.images.at(image_id);
  const Camera& camera = model.cameras.at(image.camera_id);
  Eigen::Vector3d in_cam = seen.in_cam;
  if (camera.params != before.params && seen.pixel) {
    // The ray of the same pixel.
    const std::optional<Eigen::Vector3d> ray =
        camera.model->unproject(camera.params.data(), *seen.pixel);
    if (ray) in_cam = seen.in_cam.norm() * *ray;
  }
  return image.cam_from_world.Inverse() * in_cam;
}

bool Followers::IsAsItWas(const Reconstruction& model, image_t image_id, const View& before) {
  const Image& image = model.images.at(image_id);
  return image.cam_from_world.rotation.coeffs() == before.cam_from_world.rotation.coeffs() &&
         image.cam_from_world.translation == before.cam_from_world.translation &&
         model.cameras.at(image.camera_id).params == before.params;
}

}  // namespace holba
