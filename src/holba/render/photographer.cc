// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/photographer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"
#include "holba/base/threads.h"

namespace holba {

using Eigen::Vector2d;
using Eigen::Vector3d;

void PhotoOptions::Describe(OptionTable* table) const {
  table->Section("Photo");
  table->Field("samples", &samples, Between(1, 256), "Rays per pixel.");
  table->Field("light_samples", &light_samples, Between(1, 256),
               "Rays to lamps and windows for each of them.");
  table
      ->Field("noise", &noise, AtLeast(0),
              "Standard deviation of the noise at middle grey, of 255.")
      .Basic();
  table->Field("blur_px", &blur_px, Between(0, 20),
               "Standard deviation of the blur of lens and sensor in pixels.");
  table->Field("vignetting", &vignetting, Between(0, 1),
               "Share of the light that is lost in the corners.");
  table->Field("exposure_stops", &exposure_stops, Between(0, 4),
               "Largest change of the exposure of an image from that of all, in stops.");
  table->Section("");
}

Photographer::Photographer(const Place& place, const RayCaster& caster, const PlaceLight& light,
                           const Camera& camera, const PhotoOptions& options, int num_threads)
    : place_(place),
      caster_(caster),
      light_(light),
      camera_(camera),
      options_(options),
      num_threads_(num_threads),
      width_(static_cast<int>(camera.width)),
      height_(static_cast<int>(camera.height)) {
  corner_rays_.assign(static_cast<size_t>(width_ + 1) * static_cast<size_t>(height_ + 1),
                      Vector3d::Zero());
  ParallelTasks(num_threads_, static_cast<size_t>(height_ + 1), [&](size_t row) {
    for (int column = 0; column <= width_; ++column) {
      const auto ray = camera_.model->unproject(camera_.params.data(),
                                                Vector2d(column, static_cast<double>(row)));
      if (ray)
        corner_rays_[row * static_cast<size_t>(width_ + 1) + static_cast<size_t>(column)] = *ray;
    }
  });
  const Vector2d centre(0.5 * width_, 0.5 * height_);
  const auto a = camera_.model->unproject(camera_.params.data(), centre);
  const auto b = camera_.model->unproject(camera_.params.data(), centre + Vector2d(1, 0));
  if (a && b) pixel_rad_ = (*a - *b).norm();
}

// Between the corners of a pixel, where the four exist; lenses are smooth.
std::optional<Vector3d> Photographer::RayOf(const Vector2d& pixel) const {
  const int column = std::clamp(static_cast<int>(pixel.x()), 0, width_ - 1);
  const int row = std::clamp(static_cast<int>(pixel.y()), 0, height_ - 1);
  const Vector3d* upper = &corner_rays_[static_cast<size_t>(row) * static_cast<size_t>(width_ + 1) +
                                        static_cast<size_t>(column)];
  const Vector3d* lower = upper + width_ + 1;
  if (upper[0].isZero() || upper[1].isZero() || lower[0].isZero() || lower[1].isZero() ||
      upper[0].dot(lower[1]) < 0.5) {
    return camera_.model->unproject(camera_.params.data(), pixel);
  }
  const double s = pixel.x() - column, t = pixel.y() - row;
  return ((1 - t) * ((1 - s) * upper[0] + s * upper[1]) + t * ((1 - s) * lower[0] + s * lower[1]))
      .normalized();
}

LightSample Photographer::Sample(const Vector3d& from, const Vector3d& ray, int num_light_samples,
                                 EvenSequence* sequence) const {
  LightSample sample;
  const auto hit = caster_.Cast(from, ray);
  if (!hit || !hit->from_outside) {
    if (!hit) sample.rest = place_.sky.At(ray);
    return sample;
  }
  const Surface& surface = place_.surfaces[static_cast<size_t>(hit->surface)];
  const Material& material = place_.materials[static_cast<size_t>(surface.material)];
  sample.surface = hit->surface;
  if (!material.emission.isZero()) {
    sample.rest = material.emission;
    return sample;
  }
  const double cosine = std::max(-hit->normal.dot(ray), 1e-3);
  const Vector2d chart = ChartOf(surface, hit->point);
  Vector2d at(chart.x(), ChartSize(surface).y() - chart.y());
  if (surface.turn_texture) std::swap(at.x(), at.y());
  at += surface.texture_origin;
  // Of a slanted surface a pixel sees more; half way, as the rays of a pixel are several.
  const double footprint = hit->distance * pixel_rad_ / std::sqrt(cosine) /
                           std::sqrt(static_cast<double>(options_.samples));
  sample.albedo = material.tint.cwiseProduct(
      place_.textures[static_cast<size_t>(material.texture)].At(at.x(), at.y(), footprint));

  const Vector3d above = hit->point + 2.0 * RayCaster::kNear * hit->normal;
  if (material.gloss > 0.0f) {
    // Schlick's form of Fresnel's law; a rough polish mirrors less where the view is flat.
    const auto flat = static_cast<float>(std::pow(1.0 - cosine, 5.0));
    const float mirrored = material.gloss + (1.0f - material.gloss) * flat *
                                                std::max(0.0f, 1.0f - 5.0f * material.roughness);
    const Vector3d mirror = ray - 2.0 * hit->normal.dot(ray) * hit->normal;
    const Vector2d u = sequence->Next();
    const double spread = material.roughness * std::sqrt(-2.0 * std::log(1.0 - 0.98 * u.x()));
    const double turn = 2.0 * std::numbers::pi * u.y();
    const Eigen::Matrix3d frame = FrameAround(mirror);
    const Vector3d second_ray =
        (mirror + spread * (std::cos(turn) * frame.col(0) + std::sin(turn) * frame.col(1)))
            .normalized();
    if (second_ray.dot(hit->normal) > 0.0) {
      const auto second = caster_.Cast(above, second_ray);
      sample.mirrored = mirrored * (second ? light_.Coarse(*second, /*without_lamps=*/false)
                                           : place_.sky.At(second_ray));
    }
    sample.albedo *= 1.0f - mirrored;
  }
  sample.lamps = light_.OfLamps(above, hit->normal, num_light_samples, sequence);
  sample.rest = sample.albedo.cwiseProduct(light_.OfSun(above, hit->normal, sequence) +
                                           light_.Indirect(hit->surface, hit->point));
  return sample;
}

void Photographer::MeasureLight(const std::vector<Rigid3d>& views) {
  // The middle of the logarithms of a coarse grid.
  constexpr int kColumns = 16, kRows = 12;
  std::vector<float> logarithms(views.size() * kColumns * kRows);
  ParallelTasks(num_threads_, views.size(), [&](size_t view) {
    const Rigid3d world_from_cam = views[view].Inverse();
    for (int i = 0; i < kColumns * kRows; ++i) {
      const Vector2d pixel((i % kColumns + 0.5) * width_ / kColumns,
                           (i / kColumns + 0.5) * height_ / kRows);
      EvenSequence sequence(view * 1000 + static_cast<size_t>(i));
      const auto ray = RayOf(pixel);
      const float grey =
          ray ? Sample(world_from_cam.translation, world_from_cam.rotation * *ray, 8, &sequence)
                    .Radiance()
                    .mean()
              : 0.0f;
      logarithms[view * kColumns * kRows + static_cast<size_t>(i)] =
          std::log(std::max(grey, 1e-4f));
    }
  });
  std::nth_element(logarithms.begin(),
                   logarithms.begin() + static_cast<long>(logarithms.size() / 2), logarithms.end());
  exposure_ = 0.27 / std::exp(static_cast<double>(logarithms[logarithms.size() / 2]));
}

Photo Photographer::Take(const PoseOfRow& pose, uint64_t seed) const {
  LightBuffer buffer(width_, height_);
  const int side = std::max(1, static_cast<int>(std::lround(std::sqrt(options_.samples))));
  ParallelTasks(num_threads_, static_cast<size_t>(height_), [&](size_t row) {
    const Rigid3d world_from_cam = pose((static_cast<double>(row) + 0.5) / height_ - 0.5).Inverse();
    Random random(seed * 1000003 + row);
    std::vector<LightSample> samples(static_cast<size_t>(options_.samples));
    for (int column = 0; column < width_; ++column) {
      EvenSequence sequence(random.Bits());
      for (int i = 0; i < options_.samples; ++i) {
        const Vector2d pixel(
            column + (i % side + random.Uniform()) / side,
            static_cast<double>(row) + (i / side % side + random.Uniform()) / side);
        const auto ray = RayOf(pixel);
        LightSample& sample = samples[static_cast<size_t>(i)];
        sample = ray ? Sample(world_from_cam.translation, world_from_cam.rotation * *ray,
                              options_.light_samples, &sequence)
                     : LightSample();
        // No light of one ray is worth more than a pixel that is burnt out several times.
        sample.rest = sample.rest.cwiseMin(static_cast<float>(6.0 / exposure_));
        sample.lamps = sample.lamps.cwiseMin(static_cast<float>(20.0 / exposure_));
        sample.mirrored = sample.mirrored.cwiseMin(static_cast<float>(2.0 / exposure_));
      }
      buffer.Put(column, static_cast<int>(row), samples);
    }
  });
  std::vector<Colour> image = buffer.Resolve(num_threads_);
  Blur(&image);
  Random random(seed ^ 0x5bd1e995u);
  const double stops = options_.exposure_stops * random.Uniform(-1, 1);
  return Develop(image, exposure_ * std::exp2(stops), seed);
}

void Photographer::Blur(std::vector<Colour>* image) const {
  if (options_.blur_px <= 0.0) return;
  const int radius = static_cast<int>(std::ceil(3.0 * options_.blur_px));
  std::vector<float> kernel;
  float total = 0.0f;
  for (int i = -radius; i <= radius; ++i) {
    kernel.push_back(
        static_cast<float>(std::exp(-0.5 * i * i / (options_.blur_px * options_.blur_px))));
    total += kernel.back();
  }
  for (float& weight : kernel) weight /= total;
  std::vector<Colour> across(image->size());
  const auto pass = [&](const std::vector<Colour>& in, bool along_rows, std::vector<Colour>* out) {
    ParallelTasks(num_threads_, static_cast<size_t>(height_), [&](size_t task) {
      const int row = static_cast<int>(task);
      for (int column = 0; column < width_; ++column) {
        Colour sum = Colour::Zero();
        for (int i = -radius; i <= radius; ++i) {
          const int c = along_rows ? std::clamp(column + i, 0, width_ - 1) : column;
          const int r = along_rows ? row : std::clamp(row + i, 0, height_ - 1);
          sum += kernel[static_cast<size_t>(i + radius)] *
                 in[static_cast<size_t>(r) * static_cast<size_t>(width_) + static_cast<size_t>(c)];
        }
        (*out)[task * static_cast<size_t>(width_) + static_cast<size_t>(column)] = sum;
      }
    });
  };
  pass(*image, true, &across);
  pass(across, false, image);
}

Photo Photographer::Develop(const std::vector<Colour>& image, double exposure,
                            uint64_t seed) const {
  Photo photo{width_, height_, std::vector<uint8_t>(3 * image.size())};
  const double half_diagonal2 = 0.25 * (width_ * width_ + height_ * height_);
  ParallelTasks(num_threads_, static_cast<size_t>(height_), [&](size_t row) {
    Random random(seed * 7368787 + row);
    for (int column = 0; column < width_; ++column) {
      const double dx = column + 0.5 - 0.5 * width_,
                   dy = static_cast<double>(row) + 0.5 - 0.5 * height_;
      const double light =
          exposure * (1.0 - options_.vignetting * (dx * dx + dy * dy) / half_diagonal2);
      const size_t at = row * static_cast<size_t>(width_) + static_cast<size_t>(column);
      for (int channel = 0; channel < 3; ++channel) {
        double value = light * static_cast<double>(image[at][channel]);
        // Of photons and of the amplifier; at 0.2, middle grey, a step of one grey value is 1.12
        // times its share.
        const double sigma = options_.noise / 255.0 / 1.12 * std::sqrt(0.25 + 0.75 * value / 0.2);
        if (sigma > 0.0) value += random.Normal(sigma);
        // Highlights run out softly.
        constexpr double kKnee = 0.6;
        if (value > kKnee)
          value = kKnee + (1 - kKnee) * (1 - std::exp(-(value - kKnee) / (1 - kKnee)));
        const float shown = SrgbFromLinear(static_cast<float>(std::clamp(value, 0.0, 1.0)));
        photo.rgb[3 * at + static_cast<size_t>(channel)] =
            static_cast<uint8_t>(std::lround(255.0f * shown));
      }
    }
  });
  return photo;
}

TruthMaps Photographer::Maps(const Rigid3d& cam_from_world) const {
  const size_t num = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  TruthMaps maps{width_, height_, std::vector<double>(num, 0.0),
                 std::vector<Vector3d>(num, Vector3d::Zero()), std::vector<int>(num, -1)};
  const Rigid3d world_from_cam = cam_from_world.Inverse();
  ParallelTasks(num_threads_, static_cast<size_t>(height_), [&](size_t row) {
    for (int column = 0; column < width_; ++column) {
      const auto ray = camera_.model->unproject(
          camera_.params.data(), Vector2d(column + 0.5, static_cast<double>(row) + 0.5));
      if (!ray) continue;
      const auto hit = caster_.Cast(world_from_cam.translation, world_from_cam.rotation * *ray);
      if (!hit) continue;
      const size_t at = row * static_cast<size_t>(width_) + static_cast<size_t>(column);
      maps.depth_m[at] = hit->distance * ray->z();
      maps.normals[at] =
          cam_from_world.rotation * (hit->from_outside ? hit->normal : Vector3d(-hit->normal));
      maps.entities[at] = place_.surfaces[static_cast<size_t>(hit->surface)].entity;
    }
  });
  return maps;
}

}  // namespace holba
