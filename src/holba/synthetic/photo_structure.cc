// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/photo_structure.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "holba/group/known_types.h"

namespace holba {
namespace {

constexpr int kMinFeatures = 3;
// Pixels of the image that one of the map is wide.
constexpr uint64_t kMapStep = 8, kFineMapStep = 4;

LabelMap EmptyMap(const Camera& camera, uint64_t step) {
  LabelMap map;
  map.width = static_cast<int>((camera.width + step - 1) / step);
  map.height = static_cast<int>((camera.height + step - 1) / step);
  map.labels.assign(static_cast<size_t>(map.width) * map.height, 0);
  return map;
}

// A panel as rays from one place meet it: t = distance / normal.ray, then a and b of the panel.
struct PanelFromPlace {
  uint16_t label;
  Eigen::Vector3d normal, along_u, along_v;
  double distance, offset_u, offset_v;
};

LabelMap LabelPanels(const PhotoScene& scene, uint32_t view,
                     const std::map<int, uint16_t>& label_of_plane) {
  const Camera& camera = scene.cameras[scene.camera_of_view[view]];
  const Rigid3d& pose = scene.cam_from_world[view];
  const Eigen::Matrix3d world_from_cam = pose.RotationMatrix().transpose();
  const Eigen::Vector3d centre = pose.OriginInA();
  std::vector<PanelFromPlace> panels;
  for (const ScenePanel& panel : scene.content.panels) {
    const auto label = label_of_plane.find(static_cast<int>(panel.group));
    if (label == label_of_plane.end()) continue;
    const Eigen::Vector3d normal = panel.u.cross(panel.v);
    const Eigen::Vector3d along_u = panel.u / panel.u.squaredNorm();
    const Eigen::Vector3d along_v = panel.v / panel.v.squaredNorm();
    const Eigen::Vector3d to_corner = panel.corner - centre;
    panels.push_back({label->second, normal, along_u, along_v, normal.dot(to_corner),
                      along_u.dot(to_corner), along_v.dot(to_corner)});
  }
  LabelMap map = EmptyMap(camera, kMapStep);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const Eigen::Vector2d pixel((x + 0.5) * static_cast<double>(camera.width) / map.width,
                                  (y + 0.5) * static_cast<double>(camera.height) / map.height);
      const auto in_cam = camera.model->unproject(camera.params.data(), pixel);
      if (!in_cam) continue;
      const Eigen::Vector3d ray = world_from_cam * *in_cam;
      double nearest = INFINITY;
      for (const PanelFromPlace& panel : panels) {
        const double t = panel.distance / panel.normal.dot(ray);
        if (!(t > 0.0 && t < nearest)) continue;
        const double a = t * panel.along_u.dot(ray) - panel.offset_u;
        const double b = t * panel.along_v.dot(ray) - panel.offset_v;
        if (!(a >= 0.0 && a <= 1.0 && b >= 0.0 && b <= 1.0)) continue;
        nearest = t;
        map.labels[static_cast<size_t>(y) * map.width + x] = panel.label;
      }
    }
  }
  return map;
}

LabelMap LabelFeatures(const Camera& camera, const PlanesOfFeatures& planes,
                       const PhotoSetImage& image, const std::map<int, uint16_t>& label_of_plane) {
  LabelMap map = EmptyMap(camera, kFineMapStep);
  const auto paint = [&](const Eigen::Vector2d& pixel, int plane) {
    const auto label = label_of_plane.find(plane);
    if (label == label_of_plane.end()) return;
    const int x = static_cast<int>(pixel.x() / kFineMapStep);
    const int y = static_cast<int>(pixel.y() / kFineMapStep);
    for (int v = std::max(0, y - 1); v <= std::min(map.height - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(map.width - 1, x + 1); ++u)
        map.labels[static_cast<size_t>(v) * map.width + u] = label->second;
    }
  };
  // Points last: a segment shows its label along its length, a point has no more than its place.
  for (size_t i = 0; i < image.segments.size(); ++i) {
    const LineSegment2d& s = image.segments[i];
    const int num_steps = static_cast<int>(s.Length() / kFineMapStep) + 1;
    for (int k = 0; k <= num_steps; ++k)
      paint(s.start + (s.end - s.start) * k / num_steps, planes.of_segments[i]);
  }
  for (size_t i = 0; i < image.keypoints.size(); ++i)
    paint(image.keypoints.Position(i), planes.of_keypoints[i]);
  return map;
}

}  // namespace

void FindVanishingPoints(const Camera& camera, std::span<const int> axis_of_segment,
                         PhotoSetImage* image) {
  const IdealCalibration k = camera.model->ideal_calibration(camera.params.data());
  std::array<Eigen::Matrix3d, 3> moments;
  std::array<uint32_t, 3> counts{};
  for (Eigen::Matrix3d& moment : moments) moment.setZero();
  const auto ray_of = [&](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector3d> {
    const auto ideal = IdealPixel(*camera.model, camera.params.data(), pixel);
    if (!ideal) return std::nullopt;
    return Eigen::Vector3d((ideal->x() - k.cx) / k.fx, (ideal->y() - k.cy) / k.fy, 1.0);
  };
  for (size_t i = 0; i < image->segments.size(); ++i) {
    const int axis = axis_of_segment[i];
    if (axis < 0) continue;
    const auto start = ray_of(image->segments[i].start), end = ray_of(image->segments[i].end);
    if (!start || !end) continue;
    // Longer segments know their direction better: the norm of the product is that weight.
    const Eigen::Vector3d normal = start->cross(*end);
    moments[axis] += normal * normal.transpose();
    ++counts[axis];
  }
  std::array<int32_t, 3> vp_of_axis = {-1, -1, -1};
  image->vanishing_points.clear();
  for (int axis = 0; axis < 3; ++axis) {
    if (counts[axis] < kMinFeatures) continue;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments[axis]);
    vp_of_axis[axis] = static_cast<int32_t>(image->vanishing_points.size());
    image->vanishing_points.push_back({eigen.eigenvectors().col(0).normalized(), counts[axis]});
  }
  image->vp_of_segment.clear();
  for (const int axis : axis_of_segment)
    image->vp_of_segment.push_back(axis < 0 ? -1 : vp_of_axis[axis]);
}

LabelMap LabelPlanes(const PhotoScene& scene, uint32_t view, const PlanesOfFeatures& planes,
                     const PhotoSetImage& image) {
  std::map<int, int> num_keypoints;
  for (const int plane : planes.of_keypoints) {
    if (plane >= 0) ++num_keypoints[plane];
  }
  std::map<int, uint16_t> label_of_plane;
  for (const auto& [plane, count] : num_keypoints) {
    if (count < kMinFeatures) continue;
    label_of_plane.emplace(plane, static_cast<uint16_t>(label_of_plane.size() + 1));
  }
  const Camera& camera = scene.cameras[scene.camera_of_view[view]];
  LabelMap map = scene.content.panels.empty() ? LabelFeatures(camera, planes, image, label_of_plane)
                                              : LabelPanels(scene, view, label_of_plane);
  for (const auto& [plane, label] : label_of_plane) map.types.emplace(label, &PlaneType());
  return map;
}

}  // namespace holba
