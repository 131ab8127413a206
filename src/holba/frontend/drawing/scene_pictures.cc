// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "holba/base/words.h"
#include "holba/frontend/drawing/canvas.h"
#include "holba/frontend/drawing/picture_parts.h"
#include "holba/frontend/drawing/scene_raster.h"
#include "holba/group/known_types.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

// Sizes are those on a picture with a longer side of this many pixels.
constexpr double kSizeForWidths = 1600.0;
constexpr double kWidthOfLine = 2.6, kWidthOfPlainLine = 1.7, kHaloOfLine = 1.6;
constexpr double kWidthOfOutline = 1.5, kWidthOfCamera = 1.3, kWidthOfEdge = 1.2;
constexpr double kRadiusOfJunction = 3.2;
constexpr double kOpacityOfSurface = 0.26, kOpacityOfSurfaceInImage = 0.34;
constexpr Rgb kColourOfCamera = {50, 56, 68}, kColourOfPlainLine = {115, 118, 124};
constexpr Rgb kWhiteEdge = {255, 255, 255};
// Of a camera's pyramid, as a share of the scene's extent; of many cameras less.
constexpr double kSizeOfCamera = 0.035, kLeastSizeOfCamera = 0.012;
// Points lie in planes and lines on points to this share of their depth; what is nearer to another
// than this does not hide it.
constexpr double kSlackShare = 0.004;
// Edges of a mesh are drawn where its surface bends by more than this (30 degrees).
constexpr double kMinCosineOfSmooth = 0.866;
// Keypoints this far from what projects have the last colour of the scale.
constexpr double kGreatestErrorPx = 4.0;
constexpr size_t kMaxNumInLegend = 6;

Rgb Darker(const Rgb& colour, double factor) {
  Rgb darker{};
  for (size_t k = 0; k < 3; ++k) darker[k] = static_cast<uint8_t>(std::lround(factor * colour[k]));
  return darker;
}

// White on white would not be seen.
Rgb OnWhite(const Rgb& colour) {
  const int least = std::min({colour[0], colour[1], colour[2]});
  return least > 190 ? Darker(colour, 190.0 / least) : colour;
}

double RadiusOfPoints(size_t num_points) {
  return num_points < 5'000 ? 2.4 : num_points < 30'000 ? 1.8 : num_points < 300'000 ? 1.2 : 0.8;
}

std::vector<Eigen::Vector3d> PlacesOfMembers(const Reconstruction& model, const Group3D& group) {
  std::vector<Eigen::Vector3d> members;
  for (const point3D_t id : group.point3D_ids) members.push_back(model.points3D.at(id).xyz);
  for (const line3D_t id : group.line3D_ids) {
    members.push_back(model.lines3D.at(id).start);
    members.push_back(model.lines3D.at(id).end);
  }
  return members;
}

// Where a plane's members lie in it; of other groups the mesh that their type makes.
GroupMesh ExtentOf(const Reconstruction& model, const Group3D& group) {
  double g[kMaxGroupParams];
  if (!group.type->from_file(group.params.data(), g)) return {};
  const std::vector<Eigen::Vector3d> members = PlacesOfMembers(model, group);
  GroupMesh mesh = group.type->mesh(g, members);
  if (!IsPlane(*group.type) || mesh.vertices.size() != 4) return mesh;
  const Eigen::Vector3d origin = mesh.vertices[0], x = mesh.vertices[1] - origin,
                        y = mesh.vertices[3] - origin;
  const double width = x.norm(), height = y.norm();
  // In thousandths of the diagonal, as the triangles have single precision.
  const double unit = 1000.0 / std::hypot(width, height);
  const auto flat = [&](const Eigen::Vector3d& X) {
    return Eigen::Vector2d(unit * x.dot(X - origin) / width, unit * y.dot(X - origin) / height);
  };
  std::vector<Eigen::Vector2d> places;
  for (const point3D_t id : group.point3D_ids) places.push_back(flat(model.points3D.at(id).xyz));
  for (const line3D_t id : group.line3D_ids) {
    const Line3D& line = model.lines3D.at(id);
    const Eigen::Vector2d a = flat(line.start), b = flat(line.end);
    // Not only the ends: a region must not break along a long line.
    const int num = 1 + static_cast<int>((b - a).norm() / 20.0);
    for (int i = 0; i <= num; ++i) places.push_back(a + (b - a) * i / num);
  }
  GroupMesh region;
  std::map<std::pair<double, double>, uint32_t> index;
  // Twice as far as in a photograph, which shows points that no other one does.
  for (const Triangle2d& triangle : RegionTriangles(places, 2000.0)) {
    auto& corners = region.triangles.emplace_back();
    for (size_t k = 0; k < 3; ++k) {
      const auto [found, is_new] = index.try_emplace({triangle[k].x(), triangle[k].y()},
                                                     static_cast<uint32_t>(region.vertices.size()));
      if (is_new) {
        region.vertices.push_back(origin + triangle[k].x() / (unit * width) * x +
                                  triangle[k].y() / (unit * height) * y);
      }
      corners[k] = found->second;
    }
  }
  // Members that are far apart are no region.
  return region.triangles.empty() ? mesh : region;
}

// Draws things of the world by a function from places of the world to places of the picture.
class WorldPainter {
 public:
  // Empty: not in front of who looks.
  using Place = std::function<std::optional<RasterPlace>(const Eigen::Vector3d&)>;

  WorldPainter(SceneRaster* raster, Place place, const Eigen::Vector3d& eye, bool is_straight)
      : raster_(*raster), place_(std::move(place)), eye_(eye), is_straight_(is_straight) {}

  void Dot(const Eigen::Vector3d& X, double radius, const Rgb& colour) {
    if (const auto at = place_(X)) raster_.AddDot(*at, radius, colour);
  }

  void Line(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double width, const Rgb& colour,
            double halo = 0.0) {
    std::optional<RasterPlace> last = place_(a);
    const std::optional<RasterPlace> end = place_(b);
    if (is_straight_ && last && end) return raster_.AddLine(*last, *end, width, colour, halo);
    // In pieces, which bend with the lens, and of which those in front are seen.
    constexpr int kNumPieces = 24;
    for (int i = 1; i <= kNumPieces; ++i) {
      const std::optional<RasterPlace> next = place_(a + (b - a) * i / kNumPieces);
      if (last && next) raster_.AddLine(*last, *next, width, colour, halo);
      last = next;
    }
  }

  void Mesh(const GroupMesh& mesh, bool is_flat, const Rgb& colour, double opacity,
            double outline_width) {
    // A flat mesh of two triangles is cut finely, a fine one little.
    const int num_parts = is_straight_ ? 8 : 24;
    const int parts = std::clamp(
        static_cast<int>(num_parts /
                         std::sqrt(0.5 * static_cast<double>(mesh.triangles.size()) + 0.5)),
        1, num_parts);
    struct Facing {
      bool faces;
      Eigen::Vector3d normal;
    };
    std::map<std::pair<uint32_t, uint32_t>, std::vector<Facing>> edges;
    for (const auto& triangle : mesh.triangles) {
      const Eigen::Vector3d &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                            &c = mesh.vertices[triangle[2]];
      const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
      const Eigen::Vector3d ray = eye_is_direction_ ? eye_ : Eigen::Vector3d(a - eye_);
      const bool faces = normal.dot(ray) < 0.0;
      for (int k = 0; k < 3; ++k)
        edges[std::minmax(triangle[k], triangle[(k + 1) % 3])].push_back({faces, normal});
      // Brighter where it faces who looks, so that what is round looks round; a plane is as it is.
      const double light = is_flat ? 1.0 : 0.55 + 0.45 * std::abs(normal.dot(ray.normalized()));
      Triangle(a, b, c, Darker(colour, light), opacity, parts);
    }
    for (const auto& [edge, facing] : edges) {
      const bool is_outline =
          facing.size() != 2 ||
          (!is_flat && (facing[0].faces != facing[1].faces ||
                        facing[0].normal.dot(facing[1].normal) < kMinCosineOfSmooth));
      if (is_outline) {
        Line(mesh.vertices[edge.first], mesh.vertices[edge.second], outline_width,
             Darker(colour, 0.8));
      }
    }
  }

  void LookAlong(const Eigen::Vector3d& direction) {
    eye_ = direction;
    eye_is_direction_ = true;
  }

 private:
  void Triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                const Rgb& colour, double opacity, int parts) {
    const auto at = [&](int i, int j) {
      return place_(a + (b - a) * i / parts + (c - a) * j / parts);
    };
    for (int i = 0; i < parts; ++i) {
      for (int j = 0; j + i < parts; ++j) {
        const auto p = at(i, j), q = at(i + 1, j), r = at(i, j + 1);
        if (p && q && r) raster_.AddTriangle(*p, *q, *r, colour, opacity);
        if (i + j + 2 > parts) continue;
        const auto s = at(i + 1, j + 1);
        if (q && r && s) raster_.AddTriangle(*q, *s, *r, colour, opacity);
      }
    }
  }

  SceneRaster& raster_;
  Place place_;
  Eigen::Vector3d eye_;
  bool eye_is_direction_ = false;
  bool is_straight_;
};

// Through the corners of its photograph, at a depth of 1, in its frame; a lens that sees more than
// half of all around is drawn as one that sees less.
std::array<Eigen::Vector3d, 4> CornersOfCamera(const Camera& camera) {
  constexpr double kWidest = 1.2;
  std::array<Eigen::Vector3d, 4> corners;
  double widest = 0.0;
  for (size_t k = 0; k < 4; ++k) {
    const double u = k == 1 || k == 2, v = k >= 2;
    const auto ray = camera.model->unproject(
        camera.params.data(),
        {u * static_cast<double>(camera.width), v * static_cast<double>(camera.height)});
    corners[k] = ray && ray->z() > 0.3 ? Eigen::Vector3d(*ray / ray->z())
                                       : Eigen::Vector3d(u ? 0.8 : -0.8, v ? 0.6 : -0.6, 1.0);
    widest = std::max(widest, corners[k].head<2>().cwiseAbs().maxCoeff());
  }
  if (widest > kWidest) {
    for (Eigen::Vector3d& corner : corners) corner.head<2>() *= kWidest / widest;
  }
  return corners;
}

void DrawCamera(const Image& image, const Camera& camera, double size, double width,
                WorldPainter* painter) {
  const Rigid3d world_from_cam = image.cam_from_world.Inverse();
  const Eigen::Vector3d centre = world_from_cam.translation;
  std::array<Eigen::Vector3d, 4> corners = CornersOfCamera(camera);
  const Eigen::Vector3d top = 0.5 * (corners[0] + corners[1]) + 0.22 * (corners[0] - corners[3]);
  for (Eigen::Vector3d& corner : corners) corner = world_from_cam * (size * corner);
  for (size_t k = 0; k < 4; ++k) {
    painter->Line(centre, corners[k], width, kColourOfCamera);
    painter->Line(corners[k], corners[(k + 1) % 4], width, kColourOfCamera);
  }
  const Eigen::Vector3d tip = world_from_cam * (size * top);
  painter->Line(corners[0], tip, width, kColourOfCamera);
  painter->Line(tip, corners[1], width, kColourOfCamera);
}

double SizeOfCameras(size_t num_images, double extent) {
  // From fifty images on smaller, with the root of their number.
  const double crowd = std::sqrt(std::max(static_cast<double>(num_images) / 50.0, 1.0));
  return extent * std::max(kSizeOfCamera / crowd, kLeastSizeOfCamera);
}

void DrawGroupsOf(const Reconstruction& model, const std::map<group3D_t, Rgb>& colours,
                  const std::vector<group3D_t>& ids, double opacity, double outline_width,
                  WorldPainter* painter) {
  for (const group3D_t id : ids) {
    const Group3D& group = model.groups3D.at(id);
    painter->Mesh(ExtentOf(model, group), IsPlane(*group.type), colours.at(id), opacity,
                  outline_width);
  }
}

// The vanishing points of most lines, what else there is, and the groups of most members.
std::vector<LegendEntry> LegendOf(const Reconstruction& model,
                                  const std::map<group3D_t, Rgb>& colours,
                                  const std::unordered_map<line3D_t, Rgb>& line_colours) {
  std::vector<LegendEntry> entries;
  const auto add = [&](bool parallel, LegendEntry::Swatch swatch, const char* others) {
    std::vector<std::pair<size_t, group3D_t>> ordered;
    for (const auto& [id, group] : model.groups3D) {
      const size_t size = group.line3D_ids.size() + (parallel ? 0 : group.point3D_ids.size());
      if (group.type->IsParallelism() == parallel && size > 0) ordered.emplace_back(size, id);
    }
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    for (size_t i = 0; i < std::min(ordered.size(), kMaxNumInLegend); ++i) {
      const auto& [size, id] = ordered[i];
      std::string type(model.groups3D.at(id).type->name);
      std::transform(type.begin(), type.end(), type.begin(),
                     [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      entries.push_back({swatch, colours.at(id),
                         parallel ? fmt::format("direction {} ({})", id, Counted(size, "line"))
                                  : fmt::format("{} {} ({})", type, id, Counted(size, "member")),
                         0.0});
    }
    if (ordered.size() > kMaxNumInLegend)
      entries.push_back(
          {swatch, kGrey, fmt::format("and {} {}", ordered.size() - kMaxNumInLegend, others), 0.0});
  };
  add(true, LegendEntry::Swatch::kLine, "more directions");
  size_t num_plain = 0;
  for (const auto& [id, line] : model.lines3D) num_plain += !line_colours.contains(id);
  if (num_plain > 0) {
    entries.push_back({LegendEntry::Swatch::kLine, kColourOfPlainLine,
                       line_colours.empty() ? Counted(num_plain, "line")
                                            : Counted(num_plain, "line") + " of no direction",
                       0.0});
  }
  add(false, LegendEntry::Swatch::kArea, "more surfaces");
  return entries;
}

ColourImage WhitePicture(int width, int height) {
  return {width, height, std::vector<uint8_t>(size_t{3} * width * height, 255)};
}

}  // namespace

ColourImage DrawScene(const Reconstruction& model, const SceneView& view,
                      const ScenePictureOptions& options) {
  const double extent = (view.high - view.low).maxCoeff();
  const double unit = std::max(view.width, view.height) / kSizeForWidths;
  SceneRaster raster(WhitePicture(view.width, view.height),
                     view.is_orthographic ? 0.0 : kSlackShare,
                     view.is_orthographic ? kSlackShare * extent : 0.0);
  const auto place = [&](const Eigen::Vector3d& X) -> std::optional<RasterPlace> {
    const Eigen::Vector3d in_view = view.view_from_world * X;
    if (!in_view.allFinite() || !view.Holds(X)) return std::nullopt;
    if (view.is_orthographic) return RasterPlace{view.ToPixel(in_view), -in_view.z()};
    if (in_view.z() < view.near) return std::nullopt;
    return RasterPlace{view.ToPixel(in_view), 1.0 / in_view.z()};
  };
  WorldPainter painter(&raster, place, view.view_from_world.OriginInA(), true);
  if (view.is_orthographic) {
    painter.LookAlong(view.view_from_world.rotation.normalized().conjugate() *
                      Eigen::Vector3d::UnitZ());
  }
  // What is near looks larger, so that one sees how deep it lies.
  const double middle_depth =
      view.is_orthographic ? 0.0 : (view.view_from_world * (0.5 * (view.low + view.high))).z();
  const double radius = unit * RadiusOfPoints(model.points3D.size());
  const bool has_colours =
      std::any_of(model.points3D.begin(), model.points3D.end(), [](const auto& entry) {
        return entry.second.rgb[0] != 0 || entry.second.rgb[1] != 0 || entry.second.rgb[2] != 0;
      });
  for (const auto& [id, point] : model.points3D) {
    double size = radius;
    if (!view.is_orthographic) {
      const double depth = (view.view_from_world * point.xyz).z();
      if (depth > 0.0) size *= std::clamp(middle_depth / depth, 0.7, 1.7);
    }
    const Rgb colour = {point.rgb[0], point.rgb[1], point.rgb[2]};
    painter.Dot(point.xyz, size, has_colours ? OnWhite(colour) : kGrey);
  }
  const auto colours = GroupColours(model);
  const auto line_colours = LineColours(model);
  for (const auto& [id, line] : model.lines3D) {
    const bool has_vp = line_colours.contains(id);
    painter.Line(line.start, line.end, unit * (has_vp ? kWidthOfLine : kWidthOfPlainLine),
                 ColourOr(line_colours, id, kColourOfPlainLine), unit * kHaloOfLine);
  }
  std::unordered_set<point3D_t> junctions;
  for (const WireframeEdge& edge : model.wireframe) {
    const Line3D& line = model.lines3D.at(edge.line3D_id);
    const Eigen::Vector3d& X = model.points3D.at(edge.point3D_id).xyz;
    const Eigen::Vector3d way = line.end - line.start;
    const double t =
        std::clamp(way.dot(X - line.start) / std::max(way.squaredNorm(), 1e-300), 0.0, 1.0);
    painter.Line(X, line.start + t * way, unit * kWidthOfEdge,
                 ColourOr(line_colours, edge.line3D_id, kColourOfPlainLine));
    junctions.insert(edge.point3D_id);
  }
  for (const point3D_t id : junctions) {
    const Eigen::Vector3d& X = model.points3D.at(id).xyz;
    painter.Dot(X, unit * kRadiusOfJunction, kBlack);
  }
  std::vector<group3D_t> surfaces;
  for (const auto& [id, group] : model.groups3D) {
    if (!group.type->IsParallelism()) surfaces.push_back(id);
  }
  DrawGroupsOf(model, colours, surfaces, kOpacityOfSurface, unit * kWidthOfOutline, &painter);
  const double camera_size = SizeOfCameras(model.images.size(), extent);
  for (const auto& [id, image] : model.images) {
    DrawCamera(image, model.cameras.at(image.camera_id), camera_size, unit * kWidthOfCamera,
               &painter);
  }
  std::vector<LegendEntry> legend = LegendOf(model, colours, line_colours);
  if (view.is_orthographic) {
    const double length = BarLength(view.width / view.scale);
    const std::string name = !options.unit.empty() ? options.unit
                             : length == 1.0       ? "unit"
                                                   : "units";
    legend.insert(legend.begin(), {LegendEntry::Swatch::kBar, kBlack,
                                   fmt::format("{:g} {}", length, name), length * view.scale});
  }
  return WithLegend(raster.Render(options.num_threads), legend);
}

ColourImage DrawSceneInImage(const Reconstruction& model, image_t image_id,
                             const ColourImage& photograph, int num_threads) {
  const Image& image = model.images.at(image_id);
  const Camera& camera = model.cameras.at(image.camera_id);
  const Eigen::Vector2d scale = PhotographScale(model, image, photograph);
  const double unit = std::max(photograph.width, photograph.height) / kSizeForWidths;
  SceneRaster raster(Pale(photograph), kSlackShare, 0.0);
  const auto project = [&](const Eigen::Vector3d& X) -> std::optional<Eigen::Vector2d> {
    Eigen::Vector2d pixel;
    if (!camera.model->project(camera.params.data(), image.cam_from_world * X, &pixel) ||
        !pixel.allFinite())
      return std::nullopt;
    return pixel;
  };
  // By distance, as a lens may see what is beside it.
  const auto place = [&](const Eigen::Vector3d& X) -> std::optional<RasterPlace> {
    const auto pixel = project(X);
    if (!pixel) return std::nullopt;
    return RasterPlace{pixel->cwiseProduct(scale),
                       1.0 / std::max((image.cam_from_world * X).norm(), 1e-300)};
  };
  WorldPainter painter(&raster, place, image.cam_from_world.OriginInA(), camera.model->is_pinhole);
  const auto colours = GroupColours(model);
  const auto line_colours = LineColours(model);
  // What the photograph shows of 2D lies upon all else.
  const auto on_top = [](const Eigen::Vector2d& pixel, int layer) {
    return RasterPlace{pixel, 1e20 * layer};
  };

  std::unordered_set<point3D_t> points;
  std::unordered_set<line3D_t> lines;
  for (const Point2D& point : image.points2D) {
    if (point.point3D_id != kNoId) points.insert(point.point3D_id);
  }
  for (const Line2D& line : image.lines2D) {
    if (line.line3D_id == kNoId) continue;
    lines.insert(line.line3D_id);
    const auto path = AlongLens(camera, line.segment.start, line.segment.end, scale);
    for (size_t i = 1; i < path.size(); ++i)
      raster.AddLine(on_top(path[i - 1], 1), on_top(path[i], 1), unit * 5.2, kWhiteEdge);
  }
  std::vector<group3D_t> surfaces;
  for (const auto& [id, group] : model.groups3D) {
    if (group.type->IsParallelism()) continue;
    const bool is_seen = std::any_of(group.point3D_ids.begin(), group.point3D_ids.end(),
                                     [&](point3D_t member) { return points.contains(member); }) ||
                         std::any_of(group.line3D_ids.begin(), group.line3D_ids.end(),
                                     [&](line3D_t member) { return lines.contains(member); });
    if (is_seen) surfaces.push_back(id);
  }
  DrawGroupsOf(model, colours, surfaces, kOpacityOfSurfaceInImage, unit * kWidthOfOutline,
               &painter);
  WorldPainter top(
      &raster,
      [&](const Eigen::Vector3d& X) -> std::optional<RasterPlace> {
        const auto pixel = project(X);
        if (!pixel) return std::nullopt;
        return on_top(pixel->cwiseProduct(scale), 2);
      },
      image.cam_from_world.OriginInA(), camera.model->is_pinhole);
  for (const auto& [id, line] : model.lines3D) {
    if (lines.contains(id)) {
      top.Line(line.start, line.end, unit * kWidthOfLine,
               ColourOr(line_colours, id, kColourOfPlainLine));
    }
  }
  for (const Point2D& point : image.points2D) {
    if (point.point3D_id == kNoId) continue;
    const auto pixel = project(model.points3D.at(point.point3D_id).xyz);
    const double error = pixel ? (*pixel - point.xy).norm() : kGreatestErrorPx;
    raster.AddDot(on_top(point.xy.cwiseProduct(scale), 3), unit * 3.0,
                  ScaleColour(error / kGreatestErrorPx));
  }
  std::vector<LegendEntry> legend;
  if (!lines.empty()) {
    legend.push_back({LegendEntry::Swatch::kLine, kColourOfPlainLine,
                      "projected lines, by direction; white: segments", 0.0});
  }
  if (!points.empty()) {
    legend.push_back({LegendEntry::Swatch::kScale,
                      {},
                      fmt::format("keypoint to projected point, 0 to {:g} px", kGreatestErrorPx),
                      0.0});
  }
  return WithLegend(raster.Render(num_threads), legend);
}

}  // namespace holba
