// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/picture_parts.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/imgproc.hpp>

#include "holba/base/check.h"
#include "holba/frontend/drawing/canvas.h"

namespace holba {
namespace {

// Longest edge of a plane's region in units of the median of its triangles' shortest edges, and
// bounds of it as parts of the picture's diagonal.
constexpr double kMaxRegionEdge = 5.0, kMinRegionEdgePart = 0.045, kMaxRegionEdgePart = 0.09;

double MedianOf(std::vector<double> values) {
  const auto nth = values.begin() + static_cast<ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

std::map<group3D_t, Rgb> GroupColours(const Reconstruction& model) {
  std::map<group3D_t, Rgb> colours;
  size_t num_vps = 0, num_others = 0;
  for (const auto& [id, group] : model.groups3D) {
    colours[id] = PaletteColour(group.type->IsParallelism() ? num_vps++ : num_others++);
  }
  return colours;
}

std::unordered_map<line3D_t, Rgb> LineColours(const Reconstruction& model) {
  std::unordered_map<line3D_t, Rgb> colours;
  const auto group_colours = GroupColours(model);
  for (const auto& [id, group] : model.groups3D) {
    if (!group.type->IsParallelism()) continue;
    for (const line3D_t line3D_id : group.line3D_ids)
      colours.emplace(line3D_id, group_colours.at(id));
  }
  return colours;
}

Rgb ColourOr(const std::unordered_map<line3D_t, Rgb>& colours, line3D_t id, const Rgb& other) {
  const auto found = colours.find(id);
  return found == colours.end() ? other : found->second;
}

Eigen::Vector2d PhotographScale(const Reconstruction& model, const Image& image,
                                const ColourImage& photograph) {
  const Camera& camera = model.cameras.at(image.camera_id);
  HOLBA_CHECK(photograph.pixels.size() == size_t{3} * photograph.width * photograph.height);
  if (camera.width == 0 || camera.height == 0) return {1.0, 1.0};
  return {photograph.width / static_cast<double>(camera.width),
          photograph.height / static_cast<double>(camera.height)};
}

std::vector<Eigen::Vector2d> AlongLens(const Camera& camera, const Eigen::Vector2d& start,
                                       const Eigen::Vector2d& end, const Eigen::Vector2d& scale) {
  // An arc of a twelfth of the picture is straight to a few hundredths of a pixel for usual lenses.
  constexpr double kMaxPart = 1.0 / 12.0;
  std::vector<Eigen::Vector2d> places = {start.cwiseProduct(scale)};
  const double size = std::hypot(camera.width, camera.height);
  if (!camera.model->is_pinhole && size > 0.0) {
    const auto a = camera.model->unproject(camera.params.data(), start);
    const auto b = camera.model->unproject(camera.params.data(), end);
    const int num = 1 + static_cast<int>(std::min((end - start).norm() / (kMaxPart * size), 100.0));
    for (int i = 1; i < num && a && b; ++i) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d ray = *a + (*b - *a) * i / num;
      if (camera.model->project(camera.params.data(), ray, &pixel))
        places.push_back(pixel.cwiseProduct(scale));
    }
  }
  places.push_back(end.cwiseProduct(scale));
  return places;
}

std::vector<Triangle2d> RegionTriangles(const std::vector<Eigen::Vector2d>& points,
                                        double diagonal) {
  std::vector<Triangle2d> triangles;
  if (points.size() < 3) return triangles;
  Eigen::Vector2d low = points[0], high = points[0];
  for (const Eigen::Vector2d& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const cv::Point corner(cvFloor(low.x()) - 2, cvFloor(low.y()) - 2);
  const cv::Rect bounds(corner, cv::Point(cvCeil(high.x()) + 3, cvCeil(high.y()) + 3));
  cv::Subdiv2D subdivision(bounds);
  for (const Eigen::Vector2d& p : points) {
    subdivision.insert(cv::Point2f(static_cast<float>(p.x()), static_cast<float>(p.y())));
  }
  std::vector<cv::Vec6f> all;
  subdivision.getTriangleList(all);
  std::vector<double> shortest_edges, longest_edges;
  for (const cv::Vec6f& t : all) {
    const Triangle2d triangle = {Eigen::Vector2d(t[0], t[1]), Eigen::Vector2d(t[2], t[3]),
                                 Eigen::Vector2d(t[4], t[5])};
    double shortest = INFINITY, longest = 0.0;
    bool inside = true;
    for (int k = 0; k < 3; ++k) {
      const double length = (triangle[k] - triangle[(k + 1) % 3]).norm();
      shortest = std::min(shortest, length);
      longest = std::max(longest, length);
      // The subdivision's own outer corners lie outside.
      inside =
          inside && bounds.contains(cv::Point(cvFloor(triangle[k].x()), cvFloor(triangle[k].y())));
    }
    if (!inside) continue;
    triangles.push_back(triangle);
    shortest_edges.push_back(shortest);
    longest_edges.push_back(longest);
  }
  if (triangles.empty()) return triangles;
  const double max_edge = std::clamp(kMaxRegionEdge * MedianOf(shortest_edges),
                                     kMinRegionEdgePart * diagonal, kMaxRegionEdgePart * diagonal);
  std::vector<Triangle2d> short_ones;
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (longest_edges[i] <= max_edge) short_ones.push_back(triangles[i]);
  }
  return short_ones;
}

ColourImage Pale(const ColourImage& photograph) {
  ColourImage pale = photograph;
  for (size_t i = 0; i + 2 < pale.pixels.size(); i += 3) {
    uint8_t* rgb = &pale.pixels[i];
    const int grey = (299 * rgb[0] + 587 * rgb[1] + 114 * rgb[2]) / 1000;
    for (int k = 0; k < 3; ++k)
      rgb[k] = static_cast<uint8_t>(255 - (255 - (grey + rgb[k]) / 2) * 2 / 3);
  }
  return pale;
}

Rgb ScaleColour(double t) {
  constexpr Rgb kNodes[] = {{68, 1, 84},    {71, 45, 123},  {59, 82, 139},
                            {44, 114, 142}, {33, 145, 140}, {40, 174, 128},
                            {94, 201, 98},  {173, 220, 48}, {253, 231, 37}};
  const double x = std::clamp(t, 0.0, 1.0) * (std::size(kNodes) - 1);
  const size_t i = std::min(static_cast<size_t>(x), std::size(kNodes) - 2);
  const double f = x - static_cast<double>(i);
  Rgb colour{};
  for (size_t k = 0; k < 3; ++k) {
    colour[k] = static_cast<uint8_t>(std::lround((1.0 - f) * kNodes[i][k] + f * kNodes[i + 1][k]));
  }
  return colour;
}

ColourImage WithLegend(const ColourImage& picture, const std::vector<LegendEntry>& entries) {
  if (entries.empty() || picture.width < 200) return picture;
  // Capitals are a hundredth of the picture high.
  const double letter = picture.width / 100.0, row = 2.1 * letter, margin = 1.2 * letter;
  const double swatch = 2.6 * letter, gap = 0.7 * letter, between = 2.2 * letter;
  const auto swatch_width = [&](const LegendEntry& entry) {
    return entry.swatch == LegendEntry::Swatch::kBar     ? entry.length_px
           : entry.swatch == LegendEntry::Swatch::kScale ? 3.0 * swatch
           : entry.swatch == LegendEntry::Swatch::kDot   ? 0.8 * letter
                                                         : swatch;
  };
  struct Placed {
    Eigen::Vector2d at;  // middle of the left of its swatch
    const LegendEntry* entry;
  };
  std::vector<Placed> placed;
  Eigen::Vector2d at(margin, margin + 0.5 * row);
  for (const LegendEntry& entry : entries) {
    const double width = swatch_width(entry) + gap + Canvas::TextWidth(entry.text, letter);
    if (at.x() > margin && at.x() + width > picture.width - margin) at = {margin, at.y() + row};
    placed.push_back({at, &entry});
    at.x() += width + between;
  }
  const int height = static_cast<int>(std::lround(at.y() + 0.5 * row + 0.5 * margin));
  Canvas strip(picture.width, height);
  // The canvas measures in thousandths of its diagonal.
  const double per_px = 1000.0 / strip.Diagonal();
  for (const auto& [left, entry] : placed) {
    const double width = swatch_width(*entry);
    const Eigen::Vector2d right = left + Eigen::Vector2d(width, 0.0);
    const auto box = [&](double from, double to, const Rgb& colour) {
      const double half = 0.5 * letter;
      strip.Fill({left + Eigen::Vector2d(from, -half), left + Eigen::Vector2d(to, -half),
                  left + Eigen::Vector2d(to, half), left + Eigen::Vector2d(from, half)},
                 colour);
    };
    switch (entry->swatch) {
      case LegendEntry::Swatch::kLine:
        strip.Line(left, right, entry->colour, 0.26 * letter * per_px);
        break;
      case LegendEntry::Swatch::kDot:
        strip.Dot(left + Eigen::Vector2d(0.4 * letter, 0.0), entry->colour, 0.36 * letter * per_px);
        break;
      case LegendEntry::Swatch::kArea:
        strip.Translucent(0.5, [&] { box(0.0, width, entry->colour); });
        break;
      case LegendEntry::Swatch::kScale:
        for (int i = 0; i < 48; ++i)
          box(width * i / 48.0, width * (i + 1) / 48.0, ScaleColour((i + 0.5) / 48.0));
        break;
      case LegendEntry::Swatch::kBar:
        strip.Line(left, right, kBlack, 0.22 * letter * per_px);
        for (const Eigen::Vector2d& end : {left, right}) {
          strip.Line(end - Eigen::Vector2d(0.0, 0.4 * letter),
                     end + Eigen::Vector2d(0.0, 0.4 * letter), kBlack, 0.15 * letter * per_px);
        }
        break;
    }
    strip.Text(entry->text, right + Eigen::Vector2d(gap, 0.5 * letter), kBlack, letter * per_px);
  }
  const ColourImage below = strip.ToImage();
  ColourImage whole{picture.width, picture.height + height, picture.pixels};
  whole.pixels.insert(whole.pixels.end(), below.pixels.begin(), below.pixels.end());
  return whole;
}

}  // namespace holba
