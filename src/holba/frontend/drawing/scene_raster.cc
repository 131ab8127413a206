// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

constexpr int kBandRows = 16;  // of the picture, drawn at a time by one thread
constexpr Rgb kHalo = {255, 255, 255};
constexpr uint32_t kNoFragment = std::numeric_limits<uint32_t>::max();

bool IsUsable(const RasterPlace& place) {
  // Far outside, where there is nothing to see, positions would overflow.
  return place.pixel.allFinite() && place.pixel.cwiseAbs().maxCoeff() < 1e6 &&
         std::isfinite(place.nearness);
}

}  // namespace

SceneRaster::SceneRaster(const ColourImage& background, double slack_share, double slack)
    : background_(background), slack_share_(slack_share), slack_(slack) {
  HOLBA_CHECK(background.pixels.size() == size_t{3} * background.width * background.height);
}

void SceneRaster::AddDot(const RasterPlace& centre, double radius_px, const Rgb& colour) {
  if (IsUsable(centre)) dots_.push_back({centre, radius_px, colour});
}

void SceneRaster::AddLine(const RasterPlace& a, const RasterPlace& b, double width_px,
                          const Rgb& colour, double halo_px) {
  if (IsUsable(a) && IsUsable(b)) lines_.push_back({a, b, width_px, halo_px, colour});
}

void SceneRaster::AddTriangle(const RasterPlace& a, const RasterPlace& b, const RasterPlace& c,
                              const Rgb& colour, double opacity) {
  if (IsUsable(a) && IsUsable(b) && IsUsable(c)) triangles_.push_back({{a, b, c}, colour, opacity});
}

bool SceneRaster::Rows(double low_px, double high_px, int* first, int* last) const {
  if (!(high_px >= 0.0 && low_px <= background_.height)) return false;
  *first = std::max(static_cast<int>(low_px), 0);
  *last = std::min(static_cast<int>(high_px), background_.height - 1);
  return *first <= *last;
}

// The samples of some rows.
class SceneRaster::Band {
 public:
  Band(const SceneRaster& raster, int first_row, int num_rows)
      : raster_(raster),
        columns_(raster.background_.width * kFineness),
        rows_(num_rows * kFineness),
        top_(first_row * kFineness),
        colours_(static_cast<size_t>(columns_) * rows_),
        nearness_(colours_.size(), -std::numeric_limits<float>::infinity()),
        fragment_of_(colours_.size(), kNoFragment) {
    for (int row = 0; row < rows_; ++row) {
      const uint8_t* source =
          &raster.background_
               .pixels[size_t{3} * ((top_ + row) / kFineness) * raster.background_.width];
      for (int column = 0; column < columns_; ++column) {
        const uint8_t* rgb = source + 3 * (column / kFineness);
        colours_[At(column, row)] = {rgb[0], rgb[1], rgb[2]};
      }
    }
  }

  void Draw(const Dot& dot) {
    const double radius = dot.radius_px * kFineness;
    const Eigen::Vector2d centre = Sample(dot.centre);
    const auto nearness = static_cast<float>(dot.centre.nearness);
    const Eigen::Vector2d reach(radius, radius);
    ForBox(centre - reach, centre + reach, [&](int column, int row) {
      const double dx = column - centre.x(), dy = row - centre.y();
      if (dx * dx + dy * dy <= radius * radius) Put(At(column, row), nearness, dot.colour);
    });
  }

  void Draw(const Line& line) {
    const Eigen::Vector2d a = Sample(line.a), way = Sample(line.b) - a;
    const double square = way.squaredNorm();
    const double half = 0.5 * kFineness * std::max(line.width_px, 1.0 / kFineness);
    const double reach = half + kFineness * line.halo_px;
    const auto along = [&](double x, double y) {
      return square > 0.0
                 ? std::clamp((way.x() * (x - a.x()) + way.y() * (y - a.y())) / square, 0.0, 1.0)
                 : 0.0;
    };
    const Eigen::Vector2d b = a + way;
    const int first = std::max(static_cast<int>(std::ceil(std::min(a.y(), b.y()) - reach)), 0);
    const int last =
        std::min(static_cast<int>(std::floor(std::max(a.y(), b.y()) + reach)), rows_ - 1);
    for (int row = first; row <= last; ++row) {
      // Columns that the line passes while it is within reach of this row.
      double t1 = 0.0, t2 = 1.0;
      if (std::abs(way.y()) > 1e-9) {
        t1 = std::clamp((row - reach - a.y()) / way.y(), 0.0, 1.0);
        t2 = std::clamp((row + reach - a.y()) / way.y(), 0.0, 1.0);
      }
      const double x1 = a.x() + t1 * way.x(), x2 = a.x() + t2 * way.x();
      const int left = std::max(static_cast<int>(std::ceil(std::min(x1, x2) - reach)), 0);
      const int right =
          std::min(static_cast<int>(std::floor(std::max(x1, x2) + reach)), columns_ - 1);
      for (int column = left; column <= right; ++column) {
        const double t = along(column, row);
        const double distance = std::hypot(column - a.x() - t * way.x(), row - a.y() - t * way.y());
        if (distance > reach) continue;
        const double nearness = line.a.nearness + t * (line.b.nearness - line.a.nearness);
        if (distance <= half) {
          Put(At(column, row), static_cast<float>(nearness), line.colour);
        } else {
          // Behind the line by the slack, so that lines that meet do not cut each other.
          Put(At(column, row), static_cast<float>(nearness - 2.0 * raster_.Slack(nearness)), kHalo);
        }
      }
    }
  }

  void Draw(const Triangle& triangle) {
    const std::array<Eigen::Vector2d, 3> p = {
        Sample(triangle.corners[0]), Sample(triangle.corners[1]), Sample(triangle.corners[2])};
    const auto cross = [](const Eigen::Vector2d& u, const Eigen::Vector2d& v) {
      return u.x() * v.y() - u.y() * v.x();
    };
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (std::abs(area) < 1e-9) return;
    ForBox(p[0].cwiseMin(p[1]).cwiseMin(p[2]), p[0].cwiseMax(p[1]).cwiseMax(p[2]),
           [&](int column, int row) {
             const Eigen::Vector2d at(column, row);
             double weights[3], nearness = 0.0;
             for (int k = 0; k < 3; ++k) {
               const int i = (k + 1) % 3, j = (k + 2) % 3;
               weights[k] = cross(p[j] - p[i], at - p[i]) / area;
               // Of two triangles that share an edge one has its samples: the edge is on one side
               // of the sample for both of them, by the same numbers.
               if (weights[k] < 0.0) return;
               if (weights[k] == 0.0 && !OwnsEdge(p[i], p[j], area)) return;
               nearness += weights[k] * triangle.corners[k].nearness;
             }
             AddFragment(At(column, row), static_cast<float>(nearness), triangle);
           });
  }

  void Resolve(ColourImage* picture) {
    std::vector<Fragment> layers;
    for (size_t at = 0; at < colours_.size(); ++at) {
      if (fragment_of_[at] == kNoFragment) continue;
      layers.clear();
      for (uint32_t i = fragment_of_[at]; i != kNoFragment; i = fragments_[i].next) {
        const double nearness = fragments_[i].nearness;
        if (nearness > nearness_[at] + raster_.Slack(nearness)) layers.push_back(fragments_[i]);
      }
      // The farthest first; of equally near ones that of the later triangle is on top.
      std::sort(layers.begin(), layers.end(), [](const Fragment& a, const Fragment& b) {
        return a.nearness != b.nearness ? a.nearness < b.nearness : a.triangle < b.triangle;
      });
      for (const Fragment& layer : layers) {
        for (int k = 0; k < 3; ++k) {
          colours_[at][k] += layer.opacity * (layer.colour[k] - colours_[at][k]);
        }
      }
    }
    for (int row = 0; row < rows_ / kFineness; ++row) {
      uint8_t* target = &picture->pixels[size_t{3} * (top_ / kFineness + row) * picture->width];
      for (int column = 0; column < picture->width; ++column) {
        for (int k = 0; k < 3; ++k) {
          float sum = 0.0f;
          for (int i = 0; i < kFineness; ++i) {
            for (int j = 0; j < kFineness; ++j)
              sum += colours_[At(column * kFineness + j, row * kFineness + i)][k];
          }
          *target++ = static_cast<uint8_t>(std::lround(sum / (kFineness * kFineness)));
        }
      }
    }
  }

 private:
  struct Fragment {
    float nearness, opacity;
    Rgb colour;
    uint32_t next, triangle;
  };

  size_t At(int column, int row) const { return static_cast<size_t>(row) * columns_ + column; }
  // In samples of this band: the centre of the first is 0.
  Eigen::Vector2d Sample(const RasterPlace& place) const {
    return {place.pixel.x() * kFineness - 0.5, place.pixel.y() * kFineness - 0.5 - top_};
  }
  template <typename Body>
  void ForBox(const Eigen::Vector2d& low, const Eigen::Vector2d& high, Body body) const {
    const int left = std::max(static_cast<int>(std::ceil(low.x())), 0);
    const int right = std::min(static_cast<int>(std::floor(high.x())), columns_ - 1);
    const int first = std::max(static_cast<int>(std::ceil(low.y())), 0);
    const int last = std::min(static_cast<int>(std::floor(high.y())), rows_ - 1);
    for (int row = first; row <= last; ++row) {
      for (int column = left; column <= right; ++column) body(column, row);
    }
  }
  // Of an edge from p to q of a triangle that turns as the sign of its area says: the same edge of
  // the neighbour runs the other way with the same sign, or the same way with the other.
  static bool OwnsEdge(const Eigen::Vector2d& p, const Eigen::Vector2d& q, double area) {
    const Eigen::Vector2d way = area > 0.0 ? Eigen::Vector2d(q - p) : Eigen::Vector2d(p - q);
    return way.y() > 0.0 || (way.y() == 0.0 && way.x() < 0.0);
  }

  void Put(size_t at, float nearness, const Rgb& colour) {
    if (nearness < nearness_[at]) return;
    nearness_[at] = nearness;
    colours_[at] = {float(colour[0]), float(colour[1]), float(colour[2])};
  }

  void AddFragment(size_t at, float nearness, const Triangle& triangle) {
    const auto index = static_cast<uint32_t>(&triangle - raster_.triangles_.data());
    fragments_.push_back(
        {nearness, static_cast<float>(triangle.opacity), triangle.colour, fragment_of_[at], index});
    fragment_of_[at] = static_cast<uint32_t>(fragments_.size() - 1);
  }

  const SceneRaster& raster_;
  int columns_, rows_, top_;  // in samples
  std::vector<std::array<float, 3>> colours_;
  std::vector<float> nearness_;
  std::vector<uint32_t> fragment_of_;  // the first of the list of a sample
  std::vector<Fragment> fragments_;
};

ColourImage SceneRaster::Render(int num_threads) const {
  ColourImage picture = background_;
  const int height = background_.height;
  const int num_bands = (height + kBandRows - 1) / kBandRows;
  struct Content {
    std::vector<uint32_t> dots, lines, triangles;
  };
  std::vector<Content> contents(num_bands);
  const auto put = [&](double low, double high, std::vector<uint32_t> Content::*list, size_t i) {
    int first = 0, last = 0;
    if (!Rows(low, high, &first, &last)) return;
    for (int band = first / kBandRows; band <= last / kBandRows; ++band)
      (contents[band].*list).push_back(static_cast<uint32_t>(i));
  };
  for (size_t i = 0; i < dots_.size(); ++i) {
    const double y = dots_[i].centre.pixel.y(), r = dots_[i].radius_px + 1.0;
    put(y - r, y + r, &Content::dots, i);
  }
  for (size_t i = 0; i < lines_.size(); ++i) {
    const Line& line = lines_[i];
    const double r = 0.5 * line.width_px + line.halo_px + 1.0;
    put(std::min(line.a.pixel.y(), line.b.pixel.y()) - r,
        std::max(line.a.pixel.y(), line.b.pixel.y()) + r, &Content::lines, i);
  }
  for (size_t i = 0; i < triangles_.size(); ++i) {
    const auto [low, high] =
        std::minmax({triangles_[i].corners[0].pixel.y(), triangles_[i].corners[1].pixel.y(),
                     triangles_[i].corners[2].pixel.y()});
    put(low - 1.0, high + 1.0, &Content::triangles, i);
  }
  ParallelTasks(num_threads, num_bands, [&](size_t i) {
    const int first_row = static_cast<int>(i) * kBandRows;
    Band band(*this, first_row, std::min(kBandRows, height - first_row));
    for (const uint32_t k : contents[i].dots) band.Draw(dots_[k]);
    for (const uint32_t k : contents[i].lines) band.Draw(lines_[k]);
    for (const uint32_t k : contents[i].triangles) band.Draw(triangles_[k]);
    band.Resolve(&picture);
  });
  return picture;
}

}  // namespace holba
