// SPDX-License-Identifier: BSD-3-Clause
// What building lines reads of a model, laid out for it: views with their segments in ideal pixels,
// the points near each segment, neighbours, depth ranges, directions and planes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "holba/estimation/lines/line_fit.h"
#include "holba/estimation/lines/line_options.h"
#include "holba/estimation/lines/segment_grid.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/image_features.h"

namespace holba {

struct SceneSegment {
  line2D_t line2D_idx = kInvalidId32;
  LineSegment2d ideal;
  Eigen::Vector3d line;   // ideal.Line()
  Eigen::Vector2d along;  // unit
  double length_px = 0.0;
  // Unit rays of the ends, world; depth per length along them; normal of their plane.
  Eigen::Vector3d ray_start, ray_end, normal;
  double depth_per_start = 0.0, depth_per_end = 0.0;
  uint32_t near_begin = 0, near_end = 0;  // in SceneView::near_points
};

// A point with a place in 3D that is seen beside a segment.
struct NearPoint {
  uint32_t point_idx = 0;  // in LineScene::points
  float distance_px = 0.0f;
};

struct SceneView {
  SceneView(image_t image_id, const IdealView& view) : image_id(image_id), view(view) {}

  image_t image_id;
  IdealView view;
  std::vector<SceneSegment> segments;  // the usable ones
  std::vector<LineSegment2d> ideal;    // theirs, for the grid
  std::vector<LineSupport> supports;   // theirs
  // Ends once more, for the loop over all pairs.
  std::vector<float> start_x, start_y, end_x, end_y;
  std::vector<float> descriptors;                 // kSegmentDescriptorSize each; empty: none
  std::vector<NearPoint> near_points;             // by segment, ascending point_idx
  std::vector<int32_t> image_vp;                  // of each segment in image_directions, -1: none
  std::vector<Eigen::Vector3d> image_directions;  // world, of the image's own vanishing points
  SegmentGrid grid;
  double min_depth = 0.0, max_depth = 0.0;
  std::vector<uint32_t> neighbours;  // view indices, best first

  bool DepthIsPossible(double depth) const { return depth >= min_depth && depth <= max_depth; }
  std::span<const NearPoint> PointsNear(const SceneSegment& segment) const {
    return {near_points.data() + segment.near_begin, segment.near_end - segment.near_begin};
  }
};

struct ScenePlane {
  group3D_t id = kNoId;
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();  // n.x + w = 0
};

struct LineScene {
  std::vector<SceneView> views;  // in the order of the model's images
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<uint32_t>> planes_of_point;
  std::vector<ScenePlane> planes;
  std::vector<Eigen::Vector3d> directions;  // of the vanishing points, unit
  std::vector<group3D_t> direction_ids;
  bool described = false;  // all segments have descriptors

  // Euclidean; 0 where segments are not described.
  double DescriptorDistance(uint32_t view1, uint32_t segment1, uint32_t view2,
                            uint32_t segment2) const;
};

// How near a point must be to a segment, px.
inline constexpr double kOnSegmentPx = 2.0;       // it may lie on the line (proposals)
inline constexpr double kDepthPointPx = 3.0;      // it gives a line of known direction its depth
inline constexpr double kBesideSegmentPx = 10.0;  // shared ones speak for a match
inline constexpr double kPlanePointPx = 25.0;     // members of a plane speak for the line on it

// `dropped` counts segments that cannot be used, by reason.
LineScene MakeLineScene(const LineOptions& options, const Reconstruction& model,
                        const ImageFeatureMap& features, int num_threads,
                        std::map<std::string, size_t>* dropped);

// Share of the shorter of a segment and an interval of its direction that both cover, in [0, 1];
// a and b are the interval's ends in the image.
double OverlapInImage(const SceneSegment& segment, const Eigen::Vector2d& a,
                      const Eigen::Vector2d& b);

}  // namespace holba
