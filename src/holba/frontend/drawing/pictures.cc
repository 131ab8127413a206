// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/pictures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/frontend/drawing/canvas.h"
#include "holba/frontend/drawing/picture_parts.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

constexpr Rgb kWhite = {255, 255, 255}, kPale = {215, 215, 215};
constexpr double kLineWidth = 1.8, kFaintWidth = 0.6, kFaintOpacity = 0.5;

// Planes steeper than 70 degrees have a trace when seen from above.
constexpr double kMaxVerticalPlaneCosine = 0.34;
constexpr double kRegionOpacity = 0.45;

bool IsVp(const Group3D& group) { return group.type->IsParallelism(); }

void DrawPath(const std::vector<Eigen::Vector2d>& places, const Rgb& colour, double width,
              Canvas* canvas) {
  for (size_t i = 1; i < places.size(); ++i) canvas->Line(places[i - 1], places[i], colour, width);
}

double Percentile(std::vector<double> values, double part) {
  const auto nth = values.begin() + std::lround(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

void DrawOutline(const Reconstruction& model, const Image& image, const Group3D& group,
                 const Eigen::Vector2d& scale, const Rgb& colour, Canvas* canvas) {
  std::vector<Eigen::Vector3d> members;
  for (const point3D_t id : group.point3D_ids) members.push_back(model.points3D.at(id).xyz);
  for (const line3D_t id : group.line3D_ids) {
    members.push_back(model.lines3D.at(id).start);
    members.push_back(model.lines3D.at(id).end);
  }
  double g[kMaxGroupParams];
  if (!group.type->from_file(group.params.data(), g)) return;
  const GroupMesh mesh = group.type->mesh(g, members);
  const Camera& camera = model.cameras.at(image.camera_id);
  std::vector<Eigen::Vector3d> in_cam;
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    in_cam.push_back(image.cam_from_world * vertex);
  // An edge is seen as outline between a triangle that faces the camera and one that does not.
  std::map<std::pair<uint32_t, uint32_t>, std::vector<bool>> facing_of_edge;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d &a = in_cam[triangle[0]], &b = in_cam[triangle[1]],
                          &c = in_cam[triangle[2]];
    const bool facing = (b - a).cross(c - a).dot(a) < 0.0;
    for (int k = 0; k < 3; ++k) {
      facing_of_edge[std::minmax(triangle[k], triangle[(k + 1) % 3])].push_back(facing);
    }
  }
  for (const auto& [edge, facing] : facing_of_edge) {
    if (facing.size() == 2 && facing[0] == facing[1]) continue;
    // In pieces, which bend with the lens, and of which those in front of the camera are seen.
    constexpr int kNumPieces = 16;
    std::optional<Eigen::Vector2d> last;
    for (int i = 0; i <= kNumPieces; ++i) {
      const Eigen::Vector3d& a = in_cam[edge.first];
      Eigen::Vector2d pixel;
      if (!camera.model->project(camera.params.data(),
                                 a + (in_cam[edge.second] - a) * i / kNumPieces, &pixel)) {
        last.reset();
        continue;
      }
      pixel = pixel.cwiseProduct(scale);
      if (last) canvas->Line(*last, pixel, colour, 2.0);
      last = pixel;
    }
  }
}

}  // namespace

Rgb GroupColour(const Reconstruction& model, group3D_t group3D_id) {
  return GroupColours(model).at(group3D_id);
}

ColourImage DrawSegments(const Reconstruction& model, image_t image_id,
                         const ColourImage& photograph) {
  const Image& image = model.images.at(image_id);
  const Camera& camera = model.cameras.at(image.camera_id);
  const Eigen::Vector2d scale = PhotographScale(model, image, photograph);
  const auto colours = LineColours(model);
  Canvas canvas(photograph);
  const auto draw = [&](const Line2D& line, const Rgb& colour, double width) {
    DrawPath(AlongLens(camera, line.segment.start, line.segment.end, scale), colour, width,
             &canvas);
  };
  canvas.Translucent(kFaintOpacity, [&] {
    for (const Line2D& line : image.lines2D) {
      if (line.line3D_id == kNoId) draw(line, kBlack, kFaintWidth);
    }
  });
  // Grey ones do not cover coloured ones.
  for (const bool has_vp : {false, true}) {
    for (const Line2D& line : image.lines2D) {
      if (line.line3D_id == kNoId || colours.contains(line.line3D_id) != has_vp) continue;
      draw(line, ColourOr(colours, line.line3D_id, kGrey), kLineWidth);
    }
  }
  return canvas.ToImage();
}

ColourImage DrawGroups(const Reconstruction& model, image_t image_id,
                       const ColourImage& photograph) {
  const Image& image = model.images.at(image_id);
  const Camera& camera = model.cameras.at(image.camera_id);
  const Eigen::Vector2d scale = PhotographScale(model, image, photograph);
  const auto colours = GroupColours(model);
  std::unordered_map<point3D_t, std::vector<Eigen::Vector2d>> seen_points;
  for (const Point2D& point : image.points2D) {
    if (point.point3D_id != kNoId)
      seen_points[point.point3D_id].push_back(point.xy.cwiseProduct(scale));
  }
  // Their paths.
  std::unordered_map<line3D_t, std::vector<std::vector<Eigen::Vector2d>>> seen_lines;
  for (const Line2D& line : image.lines2D) {
    if (line.line3D_id == kNoId) continue;
    seen_lines[line.line3D_id].push_back(
        AlongLens(camera, line.segment.start, line.segment.end, scale));
  }
  Canvas canvas(photograph);
  struct Seen {
    const Group3D* group;
    Rgb colour;
    std::vector<Eigen::Vector2d> points;  // of which regions are made
    size_t num_dots;                      // the first of them
  };
  std::vector<Seen> all_seen;
  for (const auto& [id, group] : model.groups3D) {
    if (IsVp(group)) continue;
    Seen seen{&group, colours.at(id), {}, 0};
    const auto add = [&](const Eigen::Vector2d& point) {
      if (canvas.IsNear(point)) seen.points.push_back(point);
    };
    for (const point3D_t point3D_id : group.point3D_ids) {
      const auto found = seen_points.find(point3D_id);
      if (found == seen_points.end()) continue;
      for (const Eigen::Vector2d& point : found->second) add(point);
    }
    seen.num_dots = seen.points.size();
    for (const line3D_t line3D_id : group.line3D_ids) {
      const auto found = seen_lines.find(line3D_id);
      if (found == seen_lines.end()) continue;
      for (const std::vector<Eigen::Vector2d>& path : found->second) {
        // Not only the ends: a region must not break along a long segment.
        add(path.front());
        for (size_t k = 1; k < path.size(); ++k) {
          const Eigen::Vector2d way = path[k] - path[k - 1];
          const int num =
              1 + static_cast<int>(std::min(way.norm() / (0.02 * canvas.Diagonal()), 100.0));
          for (int i = 1; i <= num; ++i) add(path[k - 1] + way * i / num);
        }
      }
    }
    if (!seen.points.empty()) all_seen.push_back(std::move(seen));
  }
  const auto is_plane = [](const Group3D& group) { return IsPlane(*group.type); };
  canvas.Translucent(kRegionOpacity, [&] {
    for (const Seen& seen : all_seen) {
      if (!is_plane(*seen.group)) continue;
      for (const auto& triangle : RegionTriangles(seen.points, canvas.Diagonal())) {
        canvas.Fill({triangle[0], triangle[1], triangle[2]}, seen.colour);
      }
    }
  });
  for (const Seen& seen : all_seen) {
    for (size_t i = 0; i < seen.num_dots; ++i) canvas.Dot(seen.points[i], seen.colour, 1.7);
    if (!is_plane(*seen.group)) {
      DrawOutline(model, image, *seen.group, scale, seen.colour, &canvas);
    }
  }
  return canvas.ToImage();
}

ColourImage DrawWireframe(const Reconstruction& model, image_t image_id,
                          const ColourImage& photograph) {
  const Image& image = model.images.at(image_id);
  const Camera& camera = model.cameras.at(image.camera_id);
  const Eigen::Vector2d scale = PhotographScale(model, image, photograph);
  const auto colours = LineColours(model);
  std::unordered_map<point3D_t, std::unordered_set<line3D_t>> lines_of_point;
  std::unordered_set<line3D_t> joined;
  for (const WireframeEdge& edge : model.wireframe) {
    lines_of_point[edge.point3D_id].insert(edge.line3D_id);
    joined.insert(edge.line3D_id);
  }
  Canvas canvas(photograph);
  const auto draw = [&](const Line2D& line, const Rgb& colour, double width) {
    DrawPath(AlongLens(camera, line.segment.start, line.segment.end, scale), colour, width,
             &canvas);
  };
  canvas.Translucent(kFaintOpacity, [&] {
    for (const Line2D& line : image.lines2D) {
      if (!joined.contains(line.line3D_id)) draw(line, kBlack, kFaintWidth);
    }
  });
  for (const Line2D& line : image.lines2D) {
    if (!joined.contains(line.line3D_id)) continue;
    draw(line, ColourOr(colours, line.line3D_id, kGrey), kLineWidth);
  }
  for (const Point2D& point : image.points2D) {
    const auto lines = lines_of_point.find(point.point3D_id);
    if (point.point3D_id == kNoId || lines == lines_of_point.end()) continue;
    const Eigen::Vector2d at = point.xy.cwiseProduct(scale);
    for (const Line2D& line : image.lines2D) {
      if (!lines->second.contains(line.line3D_id)) continue;
      // From the junction to where its segment begins.
      const Eigen::Vector2d &a = line.segment.start, &b = line.segment.end;
      const bool a_is_nearer = (a - point.xy).norm() < (b - point.xy).norm();
      DrawPath(AlongLens(camera, point.xy, a_is_nearer ? a : b, scale),
               ColourOr(colours, line.line3D_id, kGrey), 0.9, &canvas);
    }
    canvas.Dot(at, kWhite, 4.0);
    canvas.Ring(at, kBlack, 4.0, 1.2);
  }
  return canvas.ToImage();
}

ColourImage DrawTopView(const Reconstruction& model, int size_px) {
  HOLBA_CHECK(size_px > 0);
  Canvas canvas(size_px, size_px);
  const Eigen::Vector3d down = EstimateDown(model);
  const PlanAxes paper = EstimatePlanAxes(model, down);

  std::array<std::vector<double>, 2> coordinates;
  const auto add = [&](const Eigen::Vector3d& X) {
    const Eigen::Vector2d p = paper(X);
    for (int k = 0; k < 2; ++k) coordinates[k].push_back(p[k]);
  };
  for (const auto& [id, line] : model.lines3D) {
    add(line.start);
    add(line.end);
  }
  if (coordinates[0].empty()) {
    for (const auto& [id, point] : model.points3D) add(point.xyz);
  }
  Eigen::Vector2d low = Eigen::Vector2d::Constant(INFINITY), high = -low;
  if (!coordinates[0].empty()) {
    for (int k = 0; k < 2; ++k) {
      low[k] = Percentile(coordinates[k], 0.02);
      high[k] = Percentile(coordinates[k], 0.98);
    }
  }
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector2d centre = paper(image.cam_from_world.OriginInA());
    low = low.cwiseMin(centre);
    high = high.cwiseMax(centre);
  }
  if (!low.allFinite()) return canvas.ToImage();
  const double extent = std::max((high - low).maxCoeff(), 1e-12);
  const double scale = 0.9 * size_px / extent;  // a margin of a twentieth on each side
  const Eigen::Vector2d middle = 0.5 * (low + high);
  const auto at = [&](const Eigen::Vector3d& X) {
    return Eigen::Vector2d((paper(X) - middle) * scale + Eigen::Vector2d::Constant(0.5 * size_px));
  };

  for (const auto& [id, point] : model.points3D) canvas.Dot(at(point.xyz), kPale, 0.7);

  const auto group_colours = GroupColours(model);
  canvas.Translucent(0.5, [&] {
    for (const auto& [id, group] : model.groups3D) {
      if (!IsPlane(*group.type) || group.point3D_ids.empty()) continue;
      const Eigen::Vector3d normal = Eigen::Vector3d(group.params.data()).normalized();
      if (std::abs(normal.dot(down)) > kMaxVerticalPlaneCosine) continue;  // it has no trace
      const Eigen::Vector2d along =
          Eigen::Vector2d(-normal.dot(paper.below), normal.dot(paper.right)).normalized();
      std::vector<double> positions;
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (const point3D_t point3D_id : group.point3D_ids) {
        const Eigen::Vector2d p = at(model.points3D.at(point3D_id).xyz);
        positions.push_back(along.dot(p));
        mean += p / static_cast<double>(group.point3D_ids.size());
      }
      const Eigen::Vector2d foot = mean - along * along.dot(mean);
      canvas.Line(foot + along * Percentile(positions, 0.02),
                  foot + along * Percentile(positions, 0.98), group_colours.at(id), 11.0);
    }
  });

  const auto colours = LineColours(model);
  for (const bool with_vp : {false, true}) {
    for (const auto& [id, line] : model.lines3D) {
      if (colours.contains(id) != with_vp) continue;
      canvas.Line(at(line.start), at(line.end), ColourOr(colours, id, kGrey), with_vp ? 1.2 : 0.8);
    }
  }
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d centre = image.cam_from_world.OriginInA();
    const Eigen::Vector3d axis =
        image.cam_from_world.rotation.normalized().conjugate() * Eigen::Vector3d::UnitZ();
    Eigen::Vector2d ahead(paper(axis));
    const Eigen::Vector2d p = at(centre);
    if (ahead.norm() < 0.1) {  // looks up or down
      canvas.Dot(p, kBlack, 5.0);
      continue;
    }
    ahead = ahead.normalized() * 0.012 * size_px;
    const Eigen::Vector2d aside(-0.5 * ahead.y(), 0.5 * ahead.x());
    canvas.Fill({p + ahead, p - 0.4 * ahead + aside, p - 0.4 * ahead - aside}, kBlack);
  }
  return canvas.ToImage();
}

}  // namespace holba
