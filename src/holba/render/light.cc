// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/light.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/base/threads.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kNumBounces = 4;
constexpr size_t kTexelsOfTask = 512;

// About the normal, as often as a matt surface would send it there.
Vector3d CosineRay(const Eigen::Matrix3d& frame, const Vector2d& sample) {
  const double radius = std::sqrt(sample.x()), angle = 2.0 * std::numbers::pi * sample.y();
  return frame *
         Vector3d(radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1.0 - sample.x()));
}

}  // namespace

EvenSequence::EvenSequence(uint64_t seed) {
  uint64_t z = seed + 0x9e3779b97f4a7c15ULL;
  const auto next = [&z] {
    z += 0x9e3779b97f4a7c15ULL;
    uint64_t w = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    w = (w ^ (w >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<double>((w ^ (w >> 31)) >> 11) * 0x1.0p-53;
  };
  x_ = next();
  y_ = next();
}

Vector2d EvenSequence::Next() {
  // Powers of the plastic number.
  x_ += 0.7548776662466927;
  y_ += 0.5698402909980532;
  if (x_ >= 1.0) x_ -= 1.0;
  if (y_ >= 1.0) y_ -= 1.0;
  return {x_, y_};
}

PlaceLight::PlaceLight(const Place& place, const RayCaster& caster, uint64_t seed, int num_threads,
                       const std::function<void(size_t, size_t)>& progress)
    : place_(place), caster_(caster) {
  for (const Material& material : place.materials) {
    mean_colours_.push_back(material.tint.cwiseProduct(
        place.textures[static_cast<size_t>(material.texture)].At(0.0, 0.0, 1e6)));
  }
  for (size_t i = 0; i < place.surfaces.size(); ++i) {
    const Surface& surface = place.surfaces[i];
    if (!IsLamp(surface)) continue;
    const double area = surface.size[0] * surface.size[1];
    const Material& material = place.materials[static_cast<size_t>(surface.material)];
    lamps_.push_back(
        {static_cast<int>(i), area, static_cast<float>(area) * material.emission.mean()});
  }
  MakeCharts();
  FindHidden(num_threads);
  Bake(seed, num_threads, progress);
}

bool PlaceLight::IsLamp(const Surface& surface) const {
  return surface.shape == Shape::kRectangle &&
         !place_.materials[static_cast<size_t>(surface.material)].emission.isZero();
}

void PlaceLight::MakeCharts() {
  for (size_t i = 0; i < place_.surfaces.size(); ++i) {
    const Surface& surface = place_.surfaces[i];
    Chart chart;
    chart.begin = texels_.size();
    chart.size = ChartSize(surface);
    chart.closes = ChartCloses(surface);
    const auto number = [&](double length) {
      return std::clamp(static_cast<int>(std::ceil(length / place_.texel_m)), chart.closes ? 6 : 2,
                        2000);
    };
    chart.columns = number(chart.size.x());
    chart.rows = number(chart.size.y());
    for (int row = 0; row < chart.rows; ++row) {
      for (int column = 0; column < chart.columns; ++column) {
        const Vector2d at((column + 0.5) * chart.size.x() / chart.columns,
                          (row + 0.5) * chart.size.y() / chart.rows);
        const Vector3d point = PointOfChart(surface, at);
        const Vector3d normal = NormalAt(surface, point);
        texels_.push_back({static_cast<int>(i), point + 2.0 * RayCaster::kNear * normal, normal});
      }
    }
    charts_.push_back(chart);
  }
  direct_.assign(texels_.size(), Colour::Zero());
  indirect_.assign(texels_.size(), Colour::Zero());
  is_hidden_.assign(texels_.size(), 0);
}

void PlaceLight::FindHidden(int num_threads) {
  const size_t num_tasks = (texels_.size() + kTexelsOfTask - 1) / kTexelsOfTask;
  ParallelTasks(num_threads, num_tasks, [&](size_t task) {
    for (size_t i = task * kTexelsOfTask; i < std::min(texels_.size(), (task + 1) * kTexelsOfTask);
         ++i) {
      // Where most rays meet the inside of something.
      EvenSequence sequence(17);
      const Eigen::Matrix3d frame = FrameAround(texels_[i].normal);
      int num_inside = 0;
      for (int k = 0; k < 8; ++k) {
        const auto hit = caster_.Cast(texels_[i].point, CosineRay(frame, sequence.Next()));
        if (hit && !hit->from_outside) ++num_inside;
      }
      is_hidden_[i] = num_inside >= 4 ? 1 : 0;
    }
  });
}

Colour PlaceLight::OfLamps(const Vector3d& point, const Vector3d& normal, int num_samples,
                           EvenSequence* sequence) const {
  Colour sum = Colour::Zero();
  if (lamps_.empty()) return sum;
  // Lamps are chosen by what they would give if nothing were in between, about.
  constexpr size_t kMaxLamps = 64;
  float weights[kMaxLamps];
  float total = 0.0f;
  const size_t num = std::min(lamps_.size(), kMaxLamps);
  for (size_t i = 0; i < num; ++i) {
    const Surface& surface = place_.surfaces[static_cast<size_t>(lamps_[i].surface)];
    const Vector3d centre = surface.origin + 0.5 * (surface.size[0] * surface.axes.col(0) +
                                                    surface.size[1] * surface.axes.col(1));
    const Vector3d way = centre - point;
    const double distance2 = way.squaredNorm() + 0.1 * lamps_[i].area;
    const double distance = std::sqrt(distance2), reach = std::sqrt(lamps_[i].area);
    const double behind = -surface.axes.col(2).dot(way);
    // Above the horizon of the point, and before the lamp, with all of its extent.
    weights[i] = 0.0f;
    if (behind > 0.0 && normal.dot(way) > -reach) {
      const double cosines =
          std::max(behind / distance, 0.05) * std::max(normal.dot(way) / distance, 0.1);
      weights[i] = lamps_[i].power * static_cast<float>(cosines / distance2);
    }
    total += weights[i];
  }
  for (int k = 0; k < num_samples && total > 0.0f; ++k) {
    const Vector2d first = sequence->Next(), at = sequence->Next();
    float wanted = static_cast<float>((k + first.x()) / num_samples) * total;
    size_t chosen = 0;
    while (chosen + 1 < num && (wanted >= weights[chosen] || weights[chosen] == 0.0f)) {
      wanted -= weights[chosen];
      ++chosen;
    }
    if (weights[chosen] == 0.0f) continue;
    const Surface& surface = place_.surfaces[static_cast<size_t>(lamps_[chosen].surface)];
    const Vector3d to = surface.origin + at.x() * surface.size[0] * surface.axes.col(0) +
                        at.y() * surface.size[1] * surface.axes.col(1);
    const Vector3d way = to - point;
    const double distance2 = way.squaredNorm();
    const double here = normal.dot(way), there = -surface.axes.col(2).dot(way);
    if (!(here > 0.0 && there > 0.0)) continue;
    if (caster_.IsBlocked(point, to)) continue;
    const double factor = here * there / (distance2 * distance2) * lamps_[chosen].area /
                          std::numbers::pi * static_cast<double>(total / weights[chosen]) /
                          num_samples;
    sum += static_cast<float>(factor) *
           place_.materials[static_cast<size_t>(surface.material)].emission;
  }
  return sum;
}

Colour PlaceLight::OfSun(const Vector3d& point, const Vector3d& normal,
                         EvenSequence* sequence) const {
  if (place_.sun.irradiance.isZero()) return Colour::Zero();
  const Vector2d at = sequence->Next();
  const double radius = place_.sun.radius_rad * std::sqrt(at.x()),
               angle = 2.0 * std::numbers::pi * at.y();
  const Eigen::Matrix3d frame = FrameAround(place_.sun.direction);
  const Vector3d ray =
      (frame * Vector3d(radius * std::cos(angle), radius * std::sin(angle), 1.0)).normalized();
  const double here = normal.dot(ray);
  if (!(here > 0.0) || caster_.IsCovered(point, ray)) return Colour::Zero();
  return static_cast<float>(here) * place_.sun.irradiance;
}

Colour PlaceLight::At(const std::vector<Colour>& texels, int surface, const Vector3d& point) const {
  const Chart& chart = charts_[static_cast<size_t>(surface)];
  const Vector2d at = ChartOf(place_.surfaces[static_cast<size_t>(surface)], point);
  const double column = at.x() / chart.size.x() * chart.columns - 0.5;
  const double row = std::clamp(at.y() / chart.size.y() * chart.rows - 0.5, 0.0, chart.rows - 1.0);
  int c0 = static_cast<int>(std::floor(column)), c1 = c0 + 1;
  const auto s = static_cast<float>(column - c0);
  if (chart.closes) {
    c0 = (c0 + chart.columns) % chart.columns;
    c1 = c1 % chart.columns;
  } else {
    c0 = std::clamp(c0, 0, chart.columns - 1);
    c1 = std::clamp(c1, 0, chart.columns - 1);
  }
  const int r0 = std::min(static_cast<int>(row), chart.rows - 1),
            r1 = std::min(r0 + 1, chart.rows - 1);
  const auto t = static_cast<float>(row - r0);
  const auto of = [&](int c, int r) -> const Colour& {
    return texels[chart.begin + static_cast<size_t>(r) * static_cast<size_t>(chart.columns) +
                  static_cast<size_t>(c)];
  };
  return (1 - t) * ((1 - s) * of(c0, r0) + s * of(c1, r0)) +
         t * ((1 - s) * of(c0, r1) + s * of(c1, r1));
}

Colour PlaceLight::Indirect(int surface, const Vector3d& point) const {
  return At(indirect_, surface, point);
}

Colour PlaceLight::Coarse(const RayCaster::Hit& hit, bool without_lamps) const {
  if (!hit.from_outside) return Colour::Zero();
  const Surface& surface = place_.surfaces[static_cast<size_t>(hit.surface)];
  const auto material = static_cast<size_t>(surface.material);
  Colour radiance = mean_colours_[material].cwiseProduct(At(direct_, hit.surface, hit.point) +
                                                         At(indirect_, hit.surface, hit.point));
  if (!(without_lamps && IsLamp(surface))) radiance += place_.materials[material].emission;
  return radiance;
}

Colour PlaceLight::Gather(const Vector3d& point, const Vector3d& normal, int num_rays,
                          EvenSequence* sequence) const {
  const Eigen::Matrix3d frame = FrameAround(normal);
  Colour sum = Colour::Zero();
  for (int i = 0; i < num_rays; ++i) {
    const Vector3d ray = CosineRay(frame, sequence->Next());
    const auto hit = caster_.Cast(point, ray);
    sum += hit ? Coarse(*hit, /*without_lamps=*/true) : place_.sky.At(ray);
  }
  return sum / static_cast<float>(num_rays);
}

void PlaceLight::FillHidden(std::vector<Colour>* texels) const {
  // From the rim of what is seen inwards, as far as a lookup between texels may reach.
  std::vector<uint8_t> is_open = is_hidden_;
  for (int step = 0; step < 3; ++step) {
    const std::vector<uint8_t> before = is_open;
    for (const Chart& chart : charts_) {
      for (int row = 0; row < chart.rows; ++row) {
        for (int column = 0; column < chart.columns; ++column) {
          const auto index = [&](int c, int r) {
            return chart.begin + static_cast<size_t>(r) * static_cast<size_t>(chart.columns) +
                   static_cast<size_t>(c);
          };
          if (before[index(column, row)] == 0) continue;
          Colour sum = Colour::Zero();
          int num = 0;
          for (int r = std::max(0, row - 1); r <= std::min(chart.rows - 1, row + 1); ++r) {
            for (int c = std::max(0, column - 1); c <= std::min(chart.columns - 1, column + 1);
                 ++c) {
              if (before[index(c, r)] != 0) continue;
              sum += (*texels)[index(c, r)];
              ++num;
            }
          }
          if (num == 0) continue;
          (*texels)[index(column, row)] = sum / static_cast<float>(num);
          is_open[index(column, row)] = 0;
        }
      }
    }
  }
}

void PlaceLight::Smooth(std::vector<Colour>* texels) const {
  const std::vector<Colour> before = *texels;
  for (const Chart& chart : charts_) {
    for (int row = 0; row < chart.rows; ++row) {
      for (int column = 0; column < chart.columns; ++column) {
        Colour sum = Colour::Zero();
        float weight = 0.0f;
        for (int r = std::max(0, row - 1); r <= std::min(chart.rows - 1, row + 1); ++r) {
          for (int c = column - 1; c <= column + 1; ++c) {
            const int wrapped = chart.closes ? (c + chart.columns) % chart.columns : c;
            if (wrapped < 0 || wrapped >= chart.columns) continue;
            const float w = (r == row ? 2.0f : 1.0f) * (c == column ? 2.0f : 1.0f);
            sum +=
                w *
                before[chart.begin + static_cast<size_t>(r) * static_cast<size_t>(chart.columns) +
                       static_cast<size_t>(wrapped)];
            weight += w;
          }
        }
        (*texels)[chart.begin + static_cast<size_t>(row) * static_cast<size_t>(chart.columns) +
                  static_cast<size_t>(column)] = sum / weight;
      }
    }
  }
}

void PlaceLight::Bake(uint64_t seed, int num_threads,
                      const std::function<void(size_t, size_t)>& progress) {
  const size_t num_tasks = (texels_.size() + kTexelsOfTask - 1) / kTexelsOfTask;
  const auto for_texels = [&](std::vector<Colour>* result, const auto& value) {
    ParallelTasks(num_threads, num_tasks, [&](size_t task) {
      for (size_t i = task * kTexelsOfTask;
           i < std::min(texels_.size(), (task + 1) * kTexelsOfTask); ++i) {
        if (is_hidden_[i] == 0) (*result)[i] = value(i);
      }
    });
    FillHidden(result);
  };
  for_texels(&direct_, [&](size_t i) {
    EvenSequence sequence(seed + i);
    return Colour(OfLamps(texels_[i].point, texels_[i].normal, 24, &sequence) +
                  OfSun(texels_[i].point, texels_[i].normal, &sequence));
  });
  progress(1, kNumBounces + 1);
  for (int bounce = 1; bounce <= kNumBounces; ++bounce) {
    // The last one is what is seen: with little noise.
    const int num_rays = bounce == kNumBounces ? 384 : 64;
    std::vector<Colour> next(texels_.size(), Colour::Zero());
    for_texels(&next, [&](size_t i) {
      EvenSequence sequence(seed + i + static_cast<uint64_t>(bounce) * texels_.size());
      return Gather(texels_[i].point, texels_[i].normal, num_rays, &sequence);
    });
    Smooth(&next);
    indirect_ = std::move(next);
    progress(static_cast<size_t>(bounce) + 1, kNumBounces + 1);
  }
}

}  // namespace holba
