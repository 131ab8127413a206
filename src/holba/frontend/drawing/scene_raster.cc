// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"

namespace holba {
namespace {

// Of the picture, drawn at a time by one thread: few, so that their samples stay in its cache.
constexpr int kBandRows = 8;
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

// The samples of some rows. Only pixels that something covers are sampled: the others stay as they
// are in the background.
class SceneRaster::Band {
 public:
  Band(const SceneRaster& raster, int first_row, int num_rows)
      : raster_(raster),
        width_(raster.background_.width),
        columns_(width_ * kFineness),
        rows_(num_rows * kFineness),
        top_(first_row * kFineness),
        is_opaque_(static_cast<size_t>(width_) * num_rows, 0),
        fragment_of_(is_opaque_.size(), kNoFragment),
        opaque_(static_cast<size_t>(columns_) * rows_) {}

  void Draw(const Dot& dot) {
    const double radius = dot.radius_px * kFineness;
    const Eigen::Vector2d centre = Sample(dot.centre);
    const auto nearness = static_cast<float>(dot.centre.nearness);
    const int left = std::max(static_cast<int>(std::ceil(centre.x() - radius)), 0);
    const int right = std::min(static_cast<int>(std::floor(centre.x() + radius)), columns_ - 1);
    const auto [first, last] = RowsWithin(centre.y() - radius, centre.y() + radius);
    for (int row = first; row <= last; ++row) {
      for (int column = left; column <= right; ++column) {
        const double dx = column - centre.x(), dy = row - centre.y();
        if (dx * dx + dy * dy <= radius * radius) Put(column, row, nearness, dot.colour);
      }
    }
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
    const double y2 = a.y() + way.y();
    const auto [first, last] = RowsWithin(std::min(a.y(), y2) - reach, std::max(a.y(), y2) + reach);
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
        const double dx = column - a.x() - t * way.x(), dy = row - a.y() - t * way.y();
        const double square_distance = dx * dx + dy * dy;
        if (square_distance > reach * reach) continue;
        const double nearness = line.a.nearness + t * (line.b.nearness - line.a.nearness);
        if (square_distance <= half * half) {
          Put(column, row, static_cast<float>(nearness), line.colour);
        } else {
          // Behind the line by the slack, so that lines that meet do not cut each other.
          Put(column, row, static_cast<float>(nearness - 2.0 * raster_.Slack(nearness)), kHalo);
        }
      }
    }
  }

  // After everything that is opaque.
  void Draw(const Triangle& triangle) {
    const std::array<Eigen::Vector2d, 3> p = {
        Sample(triangle.corners[0]), Sample(triangle.corners[1]), Sample(triangle.corners[2])};
    const double area = Cross(p[1] - p[0], p[2] - p[0]);
    if (std::abs(area) < 1e-9) return;
    // Nearness is linear in the picture.
    Layer layer{.triangle = static_cast<uint32_t>(&triangle - raster_.triangles_.data())};
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d &from = p[(k + 1) % 3], way = p[(k + 2) % 3] - from;
      const double nearness = triangle.corners[k].nearness / area;
      layer.at_origin += nearness * Cross(way, -from);
      layer.by_column += nearness * -way.y();
      layer.by_row += nearness * way.x();
    }
    layers_.push_back(layer);
    const auto [low, high] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    const auto [first, last] = RowsWithin(low, high);
    for (int row = first / kFineness; row <= last / kFineness && first <= last; ++row) {
      // The samples of each of the pixels' rows that lie inside.
      std::array<std::pair<int, int>, kFineness> spans;
      int left = columns_, right = -1;
      for (int i = 0; i < kFineness; ++i) {
        spans[i] = SpanInside(p, area, row * kFineness + i);
        if (spans[i].first > spans[i].second) continue;
        left = std::min(left, spans[i].first);
        right = std::max(right, spans[i].second);
      }
      for (int column = left / kFineness; column <= right / kFineness && left <= right; ++column) {
        uint32_t samples = 0;
        for (int i = 0; i < kFineness; ++i) {
          for (int j = 0; j < kFineness; ++j) {
            const int at = column * kFineness + j;
            if (spans[i].first <= at && at <= spans[i].second) samples |= Bit(i, j);
          }
        }
        if (samples == 0) continue;
        const size_t pixel = static_cast<size_t>(row) * width_ + column;
        constexpr int kMiddle = kFineness / 2;
        fragments_.push_back(
            {static_cast<float>(layer.At(column * kFineness + kMiddle, row * kFineness + kMiddle)),
             static_cast<uint32_t>(layers_.size() - 1), samples, fragment_of_[pixel]});
        fragment_of_[pixel] = static_cast<uint32_t>(fragments_.size() - 1);
      }
    }
  }

  void Resolve(ColourImage* picture) const {
    std::vector<Fragment> fragments;
    uint8_t* target = &picture->pixels[size_t{3} * (top_ / kFineness) * width_];
    for (size_t pixel = 0; pixel < fragment_of_.size(); ++pixel, target += 3) {
      if (fragment_of_[pixel] == kNoFragment && !is_opaque_[pixel]) continue;
      fragments.clear();
      bool is_whole = true;
      for (uint32_t i = fragment_of_[pixel]; i != kNoFragment; i = fragments_[i].next) {
        fragments.push_back(fragments_[i]);
        is_whole = is_whole && fragments_[i].samples == kAllSamples;
      }
      // The farthest first; of equally near ones that of the later triangle is on top.
      std::sort(fragments.begin(), fragments.end(), [](const Fragment& a, const Fragment& b) {
        return a.nearness != b.nearness ? a.nearness < b.nearness : a.layer < b.layer;
      });
      const Colour background(target[0], target[1], target[2]);
      Colour mean = background;
      if (is_whole && !is_opaque_[pixel]) {
        for (const Fragment& fragment : fragments) Blend(fragment, &mean);
      } else {
        mean.setZero();
        for (int i = 0; i < kFineness; ++i) {
          for (int j = 0; j < kFineness; ++j) {
            mean += SampleColour(static_cast<int>(pixel % width_) * kFineness + j,
                                 static_cast<int>(pixel / width_) * kFineness + i, Bit(i, j),
                                 background, fragments);
          }
        }
        mean /= kFineness * kFineness;
      }
      for (int k = 0; k < 3; ++k) target[k] = static_cast<uint8_t>(mean[k] + 0.5f);
    }
  }

 private:
  using Colour = Eigen::Array3f;
  struct Opaque {
    float nearness = -std::numeric_limits<float>::infinity();
    Rgb colour = {};
  };
  // A triangle, with its nearness over the samples of this band.
  struct Layer {
    uint32_t triangle;
    double at_origin = 0.0, by_column = 0.0, by_row = 0.0;
    double At(int column, int row) const { return at_origin + column * by_column + row * by_row; }
  };
  // What a layer covers of a pixel.
  struct Fragment {
    float nearness;  // in the middle
    uint32_t layer, samples, next;
  };
  static constexpr uint32_t kAllSamples = (uint32_t{1} << (kFineness * kFineness)) - 1;
  static constexpr uint32_t Bit(int i, int j) { return uint32_t{1} << (i * kFineness + j); }

  // First and last of the samples of a row inside a triangle; first > last: none.
  std::pair<int, int> SpanInside(const std::array<Eigen::Vector2d, 3>& p, double area,
                                 int row) const {
    const auto is_inside = [&](int column) {
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector2d &from = p[(k + 1) % 3], &to = p[(k + 2) % 3];
        const double weight = Cross(to - from, Eigen::Vector2d(column, row) - from) / area;
        // Of two triangles that share an edge one has its samples: the edge is on one side of the
        // sample for both of them, by the same numbers.
        if (weight < 0.0 || (weight == 0.0 && !OwnsEdge(from, to, area))) return false;
      }
      return true;
    };
    double from = columns_, to = -1.0;  // where edges cross this row
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d &a = p[k], &b = p[(k + 1) % 3];
      if (std::min(a.y(), b.y()) > row || std::max(a.y(), b.y()) < row) continue;
      const bool is_level = std::abs(b.y() - a.y()) < 1e-9;
      const double x = is_level ? b.x() : a.x() + (row - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      from = std::min({from, x, is_level ? a.x() : x});
      to = std::max({to, x, is_level ? a.x() : x});
    }
    // Rounding moves a crossing by much less than a sample: only the outermost need the test.
    int left = static_cast<int>(std::clamp(from - 1.0, 0.0, static_cast<double>(columns_)));
    int right = static_cast<int>(std::clamp(to + 1.0, -1.0, columns_ - 1.0));
    while (left <= right && !is_inside(left)) ++left;
    while (left <= right && !is_inside(right)) --right;
    return {left, right};
  }

  size_t At(int column, int row) const { return static_cast<size_t>(row) * columns_ + column; }
  size_t Pixel(int column, int row) const {
    return static_cast<size_t>(row / kFineness) * width_ + column / kFineness;
  }
  // In samples of this band: the centre of the first is 0.
  Eigen::Vector2d Sample(const RasterPlace& place) const {
    return {place.pixel.x() * kFineness - 0.5, place.pixel.y() * kFineness - 0.5 - top_};
  }
  // The first and the last one.
  std::pair<int, int> RowsWithin(double low, double high) const {
    return {std::max(static_cast<int>(std::ceil(low)), 0),
            std::min(static_cast<int>(std::floor(high)), rows_ - 1)};
  }
  static double Cross(const Eigen::Vector2d& u, const Eigen::Vector2d& v) {
    return u.x() * v.y() - u.y() * v.x();
  }
  // Of an edge from p to q of a triangle that turns as the sign of its area says: the same edge of
  // the neighbour runs the other way with the same sign, or the same way with the other.
  static bool OwnsEdge(const Eigen::Vector2d& p, const Eigen::Vector2d& q, double area) {
    const Eigen::Vector2d way = area > 0.0 ? Eigen::Vector2d(q - p) : Eigen::Vector2d(p - q);
    return way.y() > 0.0 || (way.y() == 0.0 && way.x() < 0.0);
  }

  void Put(int column, int row, float nearness, const Rgb& colour) {
    Opaque& opaque = opaque_[At(column, row)];
    if (nearness < opaque.nearness) return;
    opaque = {nearness, colour};
    is_opaque_[Pixel(column, row)] = 1;
  }

  void Blend(const Fragment& fragment, Colour* colour) const {
    const Triangle& triangle = raster_.triangles_[layers_[fragment.layer].triangle];
    const Colour above(triangle.colour[0], triangle.colour[1], triangle.colour[2]);
    *colour += static_cast<float>(triangle.opacity) * (above - *colour);
  }

  // What is opaque there, or the background, under the fragments in front of it.
  Colour SampleColour(int column, int row, uint32_t bit, const Colour& background,
                      const std::vector<Fragment>& fragments) const {
    const Opaque& opaque = opaque_[At(column, row)];
    Colour colour = background;
    if (std::isfinite(opaque.nearness))
      colour = Colour(opaque.colour[0], opaque.colour[1], opaque.colour[2]);
    for (const Fragment& fragment : fragments) {
      if ((fragment.samples & bit) == 0) continue;
      const double nearness = layers_[fragment.layer].At(column, row);
      if (nearness > opaque.nearness + raster_.Slack(nearness)) Blend(fragment, &colour);
    }
    return colour;
  }

  const SceneRaster& raster_;
  int width_, columns_, rows_, top_;  // the width in pixels, else in samples
  // By pixel: whether something opaque is there, and the first of the list of its fragments.
  std::vector<uint8_t> is_opaque_;
  std::vector<uint32_t> fragment_of_;
  std::vector<Opaque> opaque_;  // by sample
  std::vector<Layer> layers_;
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
  const auto put = [&](double low, double high, std::vector<uint32_t> Content::* list, size_t i) {
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
