// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_scene.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/threads.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/scene/covisibility.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// A tenth of an interval that segments reach into costs little, and one cell holds few of them.
constexpr double kGridCellPx = 24.0;
constexpr double kGridReachPx = 3.0;
// Fewer shared points say nothing about a pair of images, fewer points nothing about depths.
constexpr size_t kMinSharedPoints = 3;
constexpr size_t kMinDepthPoints = 5;

struct SeenPoint {
  Eigen::Vector2d ideal;
  uint32_t point_idx;
};

void AddSegments(const LineOptions& options, const ImageFeatures& features, bool described,
                 uint32_t view_idx, SceneView* view, std::map<std::string, size_t>* dropped) {
  const IdealView& ideal_view = view->view;
  for (uint32_t i = 0; i < features.segments.size(); ++i) {
    const LineSegment2d& pixels = features.segments[i];
    if (!(pixels.Length() >= options.min_segment_px)) {
      ++(*dropped)["segment: shorter than min_segment_px"];
      continue;
    }
    const std::optional<LineSegment2d> ideal = ideal_view.ToIdeal(pixels);
    if (!ideal || !(ideal->Length() > 0.0) || !ideal->start.allFinite() ||
        !ideal->end.allFinite()) {
      ++(*dropped)["segment: no ideal pixels"];
      continue;
    }
    SceneSegment s;
    s.line2D_idx = i;
    s.ideal = *ideal;
    s.line = ideal->Line();
    s.length_px = ideal->Length();
    s.along = (ideal->end - ideal->start) / s.length_px;
    s.ray_start = ideal_view.Ray(ideal->start);
    s.ray_end = ideal_view.Ray(ideal->end);
    s.normal = ideal_view.NormalOfSegment(*ideal);
    const Eigen::Vector3d axis = ideal_view.R().row(2);
    s.depth_per_start = axis.dot(s.ray_start);
    s.depth_per_end = axis.dot(s.ray_end);
    view->segments.push_back(s);
    view->ideal.push_back(*ideal);
    view->supports.emplace_back(ideal_view, *ideal, view_idx);
    view->start_x.push_back(static_cast<float>(ideal->start.x()));
    view->start_y.push_back(static_cast<float>(ideal->start.y()));
    view->end_x.push_back(static_cast<float>(ideal->end.x()));
    view->end_y.push_back(static_cast<float>(ideal->end.y()));
    view->image_vp.push_back(features.vp_of_segment.empty() ? -1 : features.vp_of_segment[i]);
    if (described) {
      const float* d = features.segment_descriptors.data() + size_t{i} * kSegmentDescriptorSize;
      view->descriptors.insert(view->descriptors.end(), d, d + kSegmentDescriptorSize);
    }
  }
  for (const ImageVanishingPoint& vp : features.vanishing_points)
    view->image_directions.push_back(ideal_view.R().transpose() * vp.direction_in_cam);
  view->grid = SegmentGrid(view->ideal, kGridCellPx, kGridReachPx);
}

void AddNearPoints(std::vector<SeenPoint> seen, SceneView* view) {
  std::sort(seen.begin(), seen.end(), [](const SeenPoint& a, const SeenPoint& b) {
    return a.ideal.y() != b.ideal.y() ? a.ideal.y() < b.ideal.y() : a.point_idx < b.point_idx;
  });
  std::vector<NearPoint> near;
  for (SceneSegment& s : view->segments) {
    near.clear();
    const double low = std::min(s.ideal.start.y(), s.ideal.end.y()) - kPlanePointPx;
    const double high = std::max(s.ideal.start.y(), s.ideal.end.y()) + kPlanePointPx;
    auto it = std::lower_bound(seen.begin(), seen.end(), low,
                               [](const SeenPoint& p, double y) { return p.ideal.y() < y; });
    for (; it != seen.end() && it->ideal.y() <= high; ++it) {
      const double across = s.line.dot(it->ideal.homogeneous());
      if (std::abs(across) > kPlanePointPx) continue;
      const double t = s.along.dot(it->ideal - s.ideal.start);
      const double beyond = std::max({0.0, -t, t - s.length_px});
      const double distance = std::hypot(across, beyond);
      if (distance <= kPlanePointPx) near.push_back({it->point_idx, static_cast<float>(distance)});
    }
    std::sort(near.begin(), near.end(), [](const NearPoint& a, const NearPoint& b) {
      return a.point_idx != b.point_idx ? a.point_idx < b.point_idx : a.distance_px < b.distance_px;
    });
    // Of a point with two observations in one image the nearer one counts.
    near.erase(std::unique(near.begin(), near.end(),
                           [](const NearPoint& a, const NearPoint& b) {
                             return a.point_idx == b.point_idx;
                           }),
               near.end());
    s.near_begin = static_cast<uint32_t>(view->near_points.size());
    view->near_points.insert(view->near_points.end(), near.begin(), near.end());
    s.near_end = static_cast<uint32_t>(view->near_points.size());
  }
}

void SetDepthRange(const LineOptions& options, const std::vector<Eigen::Vector3d>& points,
                   const std::vector<SeenPoint>& seen, SceneView* view) {
  std::vector<double> depths;
  for (const SeenPoint& p : seen) {
    const double depth = view->view.Depth(points[p.point_idx]);
    if (depth > 0.0) depths.push_back(depth);
  }
  if (depths.size() < kMinDepthPoints) {
    view->min_depth = 0.0;
    view->max_depth = std::numeric_limits<double>::infinity();
    return;
  }
  const auto percentile = [&](double share) {
    const size_t rank = static_cast<size_t>(share * (depths.size() - 1) + 0.5);
    std::nth_element(depths.begin(), depths.begin() + rank, depths.end());
    return depths[rank];
  };
  view->min_depth = options.min_depth_factor * percentile(0.02);
  view->max_depth = options.max_depth_factor * percentile(0.98);
}

void FindNeighbours(const LineOptions& options, const Covisibility& covisibility,
                    uint32_t view_idx, LineScene* scene) {
  SceneView& view = scene->views[view_idx];
  const auto covisible = covisibility.NeighboursOf(view_idx);
  const Covisibility::Shared shared = covisibility.SharedWithNeighbours(view_idx);
  struct Neighbour {
    double dice;
    uint32_t view;
  };
  std::vector<Neighbour> found;
  std::vector<double> cosines;
  const double max_cosine = std::cos(DegToRad(options.min_neighbour_angle_deg));
  for (size_t k = 0; k < covisible.size(); ++k) {
    const uint32_t other = covisible[k].image_idx, num_points = covisible[k].num_points;
    if (num_points < kMinSharedPoints) continue;
    cosines.clear();
    uint32_t last_point = kInvalidId32;
    for (const SharedSighting& s : shared[k]) {
      if (s.point_idx == last_point) continue;  // observed twice in one image
      last_point = s.point_idx;
      const Eigen::Vector3d& X = scene->points[s.point_idx];
      const Eigen::Vector3d a = (X - view.view.centre()).normalized();
      const Eigen::Vector3d b = (X - scene->views[other].view.centre()).normalized();
      cosines.push_back(a.dot(b));
    }
    // Upper quartile of the angles.
    std::nth_element(cosines.begin(), cosines.begin() + cosines.size() / 4, cosines.end());
    if (cosines[cosines.size() / 4] > max_cosine) continue;
    found.push_back(
        {2.0 * num_points / (covisibility.NumPoints(view_idx) + covisibility.NumPoints(other)),
         other});
  }
  std::sort(found.begin(), found.end(), [](const Neighbour& a, const Neighbour& b) {
    return a.dice != b.dice ? a.dice > b.dice : a.view < b.view;
  });
  if (found.size() > static_cast<size_t>(options.max_neighbours))
    found.resize(options.max_neighbours);
  for (const Neighbour& n : found) view.neighbours.push_back(n.view);
}

}  // namespace

double LineScene::DescriptorDistance(uint32_t view1, uint32_t segment1, uint32_t view2,
                                     uint32_t segment2) const {
  if (!described) return 0.0;
  using Descriptor = Eigen::Matrix<float, kSegmentDescriptorSize, 1>;
  const Eigen::Map<const Descriptor> a(views[view1].descriptors.data() +
                                       size_t{segment1} * kSegmentDescriptorSize);
  const Eigen::Map<const Descriptor> b(views[view2].descriptors.data() +
                                       size_t{segment2} * kSegmentDescriptorSize);
  return std::sqrt(std::max(0.0f, 2.0f - 2.0f * a.dot(b)));
}

LineScene MakeLineScene(const LineOptions& options, const Reconstruction& model,
                        const ImageFeatureMap& features, int num_threads,
                        std::map<std::string, size_t>* dropped) {
  LineScene scene;
  scene.described = true;
  bool any = false;
  const ViewMap views(model);
  for (const auto& [image_id, image] : model.images) {
    scene.views.emplace_back(image_id, views.at(image_id));
    const auto found = features.find(image_id);
    if (found == features.end() || found->second.segments.empty()) continue;
    const ImageFeatures& f = found->second;
    HOLBA_CHECK(f.segment_descriptors.empty() ||
                f.segment_descriptors.size() == f.segments.size() * kSegmentDescriptorSize);
    HOLBA_CHECK(f.vp_of_segment.empty() || f.vp_of_segment.size() == f.segments.size());
    any = true;
    if (f.segment_descriptors.empty()) scene.described = false;
  }
  scene.described = scene.described && any;

  std::unordered_map<point3D_t, uint32_t> point_idx;
  for (const auto& [id, point] : model.points3D) {
    point_idx.emplace(id, static_cast<uint32_t>(scene.points.size()));
    scene.points.push_back(point.xyz);
  }
  scene.planes_of_point.resize(scene.points.size());
  for (const auto& [id, group] : model.groups3D) {
    if (IsPlane(*group.type)) {
      const uint32_t plane_idx = static_cast<uint32_t>(scene.planes.size());
      scene.planes.push_back({id, Eigen::Map<const Eigen::Vector4d>(group.params.data())});
      for (point3D_t point : group.point3D_ids) {
        const auto it = point_idx.find(point);
        if (it != point_idx.end()) scene.planes_of_point[it->second].push_back(plane_idx);
      }
    } else if (group.type->IsParallelism()) {
      scene.directions.push_back(
          Eigen::Map<const Eigen::Vector3d>(group.params.data()).normalized());
      scene.direction_ids.push_back(id);
    }
  }

  const size_t num_views = scene.views.size();
  std::vector<std::vector<CovisibleSighting>> sightings_of_view(num_views);
  std::vector<std::map<std::string, size_t>> dropped_by_view(num_views);
  ParallelTasks(num_threads, num_views, [&](size_t v) {
    SceneView& view = scene.views[v];
    const Image& image = model.images.at(view.image_id);
    std::vector<SeenPoint> seen;
    for (const Point2D& p : image.points2D) {
      if (p.point3D_id == kNoId) continue;
      const std::optional<Eigen::Vector2d> ideal = view.view.ToIdeal(p.xy);
      if (!ideal) continue;
      const auto it = point_idx.find(p.point3D_id);
      HOLBA_CHECK(it != point_idx.end());
      seen.push_back({*ideal, it->second});
      sightings_of_view[v].push_back(
          {.point_idx = it->second, .image_idx = static_cast<uint32_t>(v)});
    }
    SetDepthRange(options, scene.points, seen, &view);
    const auto found = features.find(view.image_id);
    if (found == features.end()) return;
    AddSegments(options, found->second, scene.described, static_cast<uint32_t>(v), &view,
                &dropped_by_view[v]);
    AddNearPoints(std::move(seen), &view);
  });
  for (const auto& of_view : dropped_by_view) {
    for (const auto& [reason, count] : of_view) (*dropped)[reason] += count;
  }
  std::vector<CovisibleSighting> sightings;
  for (const auto& of_view : sightings_of_view) {
    sightings.insert(sightings.end(), of_view.begin(), of_view.end());
  }
  const Covisibility covisibility(num_views, scene.points.size(), sightings);
  ParallelTasks(num_threads, num_views, [&](size_t v) {
    FindNeighbours(options, covisibility, static_cast<uint32_t>(v), &scene);
  });
  for (const SceneView& view : scene.views) {
    if (view.neighbours.empty()) ++(*dropped)["image: no neighbour with enough shared points"];
  }
  return scene;
}

double OverlapInImage(const SceneSegment& segment, const Eigen::Vector2d& a,
                      const Eigen::Vector2d& b) {
  const double ta = segment.along.dot(a - segment.ideal.start);
  const double tb = segment.along.dot(b - segment.ideal.start);
  const double low = std::min(ta, tb), high = std::max(ta, tb);
  const double common = std::min(high, segment.length_px) - std::max(low, 0.0);
  const double shorter = std::min(high - low, segment.length_px);
  return shorter > 0.0 ? std::max(0.0, common) / shorter : 0.0;
}

}  // namespace holba
