// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/true_edges.h"

#include <algorithm>
#include <cmath>

#include "holba/geometry/angle.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kStepPx = 1.5;      // between the places at which an edge is looked at
constexpr double kAcrossPx = 0.3;    // how far beside it
const double kMinCosine = std::cos(85.0 / kDegPerRad);

class EdgeView {
 public:
  EdgeView(const Place& place, const RayCaster& caster, const Camera& camera,
           const Rigid3d& cam_from_world, const Edge& edge)
      : place_(place),
        caster_(caster),
        camera_(camera),
        cam_from_world_(cam_from_world),
        world_from_cam_(cam_from_world.Inverse()),
        edge_(edge),
        way_((edge.end - edge.start).normalized()) {}

  Vector3d At(double part) const { return edge_.start + part * (edge_.end - edge_.start); }

  std::optional<Vector2d> PixelAt(double part) const {
    const Vector3d in_cam = cam_from_world_ * At(part);
    if (!(in_cam.z() > kMinCosine * in_cam.norm())) return std::nullopt;
    return PixelInImage(camera_, in_cam);
  }

  // Whether the edge is seen there: beside it on one side is a flat surface that it bounds, on the
  // other one that is bent to this or lies behind.
  bool IsSeen(double part) const {
    const auto pixel = PixelAt(part);
    if (!pixel) return false;
    const Vector3d point = At(part);
    const Vector3d ray =
        (cam_from_world_.rotation * (point - world_from_cam_.translation)).normalized();
    const Vector3d in_cam_way = cam_from_world_.rotation * way_;
    const Vector3d across = ray.cross(in_cam_way);
    const double sine = across.norm();
    if (sine < 1e-3) return false;  // seen from its end
    const double distance = (point - world_from_cam_.translation).norm();
    // kAcrossPx beside it, as an angle.
    const auto beside =
        camera_.model->unproject(camera_.params.data(), *pixel + Vector2d(kAcrossPx, 0));
    if (!beside) return false;
    const double angle = std::max((*beside - ray).norm(), 1e-5);
    std::optional<RayCaster::Hit> sides[2];
    bool bounds[2] = {false, false};
    for (int side = 0; side < 2; ++side) {
      const Vector3d turned = (ray + (side == 0 ? angle : -angle) / sine * across).normalized();
      sides[side] = caster_.Cast(world_from_cam_.translation, world_from_cam_.rotation * turned);
      bounds[side] = sides[side] && sides[side]->from_outside && Bounds(sides[side]->surface);
    }
    for (int side = 0; side < 2; ++side) {
      if (!bounds[side]) continue;
      const auto& here = sides[side];
      const auto& other = sides[1 - side];
      if (!other) return true;
      if (bounds[1 - side]) {
        if (here->normal.cross(other->normal).norm() > 1e-3 ||
            here->normal.dot(other->normal) < 0.0)
          return true;
        continue;  // one plane goes on over the edge
      }
      // Something behind, not before.
      if (other->distance > distance * (1.0 + 1e-6)) return true;
    }
    return false;
  }

 private:
  // The edge lies in the plane of a flat surface.
  bool Bounds(int surface_idx) const {
    const Surface& surface = place_.surfaces[static_cast<size_t>(surface_idx)];
    if (surface.shape != Shape::kRectangle) return false;
    const Vector3d normal = surface.axes.col(2);
    return std::abs(normal.dot(edge_.start - surface.origin)) < kSamePlace &&
           std::abs(normal.dot(edge_.end - surface.origin)) < kSamePlace;
  }

  const Place& place_;
  const RayCaster& caster_;
  const Camera& camera_;
  const Rigid3d& cam_from_world_;
  Rigid3d world_from_cam_;
  const Edge& edge_;
  Vector3d way_;
};

}  // namespace

std::optional<Vector2d> PixelInImage(const Camera& camera, const Vector3d& point_in_cam) {
  Vector2d pixel;
  if (!camera.model->project(camera.params.data(), point_in_cam, &pixel)) return std::nullopt;
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= static_cast<double>(camera.width) &&
        pixel.y() <= static_cast<double>(camera.height))) {
    return std::nullopt;
  }
  const auto ray = camera.model->unproject(camera.params.data(), pixel);
  if (!ray || (*ray - point_in_cam.normalized()).norm() > 1e-6) return std::nullopt;
  return pixel;
}

std::vector<Edge> MergeEdges(const std::vector<Edge>& edges) {
  std::vector<Edge> merged;
  for (Edge edge : edges) {
    if ((edge.end - edge.start).norm() < 1e-3) continue;
    // One direction, so that those of one line can be told.
    for (int i = 0; i < 3; ++i) {
      const double step = edge.end[i] - edge.start[i];
      if (std::abs(step) < kSamePlace) continue;
      if (step < 0.0) std::swap(edge.start, edge.end);
      break;
    }
    for (size_t i = 0; i < merged.size();) {
      const Edge& other = merged[i];
      const Vector3d way = (edge.end - edge.start).normalized();
      const auto off = [&](const Vector3d& point) { return way.cross(point - edge.start).norm(); };
      const double length = (edge.end - edge.start).norm();
      const double from = way.dot(other.start - edge.start), to = way.dot(other.end - edge.start);
      if (off(other.start) < kSamePlace && off(other.end) < kSamePlace &&
          from < length + kSamePlace && to > -kSamePlace) {
        if (from < 0.0) edge.start = other.start;
        if (to > length) edge.end = other.end;
        merged.erase(merged.begin() + static_cast<long>(i));
        i = 0;  // it is longer now, and may reach others
      } else {
        ++i;
      }
    }
    merged.push_back(edge);
  }
  return merged;
}

std::vector<VisiblePart> VisibleParts(const Place& place, const RayCaster& caster,
                                      const Camera& camera, const Rigid3d& cam_from_world,
                                      const Edge& edge, double min_length_px) {
  const EdgeView view(place, caster, camera, cam_from_world, edge);
  // A first look: how long it is in the image, and whether it is there at all.
  constexpr int kCoarse = 24;
  double length_px = 0.0;
  bool is_inside = false, was_inside = false;
  Vector2d last = Vector2d::Zero();
  for (int i = 0; i <= kCoarse; ++i) {
    const auto pixel = view.PixelAt(static_cast<double>(i) / kCoarse);
    is_inside |= pixel.has_value();
    if (pixel && was_inside) length_px += (*pixel - last).norm();
    // A piece that leaves the image counts half of the image's width.
    if (pixel.has_value() != was_inside && i > 0)
      length_px += 0.5 * static_cast<double>(camera.width);
    was_inside = pixel.has_value();
    if (pixel) last = *pixel;
  }
  if (!is_inside || length_px < min_length_px) return {};
  const int num = std::clamp(static_cast<int>(std::ceil(length_px / kStepPx)), 4, 4000);
  std::vector<VisiblePart> parts;
  const auto add = [&](double from, double to) {
    const auto start = view.PixelAt(from), end = view.PixelAt(to);
    if (!start || !end || (*end - *start).norm() < min_length_px) return;
    parts.push_back({from, to, {*start, *end}});
  };
  // Where it begins or ends between two places, to a hundredth of a step. The ends of the edge
  // belong to what is seen next to them.
  const auto border = [&](double seen, double hidden) {
    for (int step = 0; step < 7; ++step) {
      const double middle = 0.5 * (seen + hidden);
      (view.IsSeen(middle) ? seen : hidden) = middle;
    }
    return seen;
  };
  bool is_open = false;
  double from = 0.0, before = 0.0;
  for (int i = 0; i < num; ++i) {
    const double at = (i + 0.5) / num;
    const bool is_seen = view.IsSeen(at);
    if (is_seen && !is_open) {
      from = i == 0 ? (view.PixelAt(0.0) ? 0.0 : border(at, 0.0)) : border(at, before);
    } else if (!is_seen && is_open) {
      add(from, border(before, at));
    }
    is_open = is_seen;
    before = at;
  }
  if (is_open) add(from, view.PixelAt(1.0) ? 1.0 : border(before, 1.0));
  return parts;
}

}  // namespace holba
