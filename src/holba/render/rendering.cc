// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/rendering.h"

#include <fmt/format.h>

namespace holba {

void RenderOptions::Describe(OptionTable* table) const {
  camera.Describe(table);
  walk.Describe(table);
  photo.Describe(table);
}

Rendering::Rendering(Place place, std::string_view name, std::string_view extension,
                     const RenderOptions& options, int num_threads,
                     const std::function<void(size_t, size_t)>& progress)
    : place_(std::move(place)), options_(options), num_threads_(num_threads) {
  camera_ = MakeCamera(options_.camera, place_.field_of_view_deg);
  caster_ = std::make_unique<RayCaster>(place_.surfaces);
  path_ = std::make_unique<WalkPath>(place_.walk, options_.walk.unsteadiness, options_.seed + 77);
  AddImages(name, extension);
  light_ = std::make_unique<PlaceLight>(place_, *caster_, options_.seed, num_threads_, progress);
  photographer_ = std::make_unique<Photographer>(place_, *caster_, *light_, camera_, options_.photo,
                                                 num_threads_);
  std::vector<Rigid3d> views;
  for (const auto& [id, image] : model_.images) views.push_back(image.cam_from_world);
  photographer_->MeasureLight(views);
}

void Rendering::AddImages(std::string_view name, std::string_view extension) {
  const int num_frames =
      options_.walk.num_images >= 0 ? options_.walk.num_images : place_.num_images;
  instants_ = Instants(place_.walk, num_frames);
  sensors_ = SensorsOf(options_.walk.rig);
  const auto num_sensors = static_cast<uint32_t>(sensors_.size());
  // Sensors of a rig are cameras of their own, alike.
  for (uint32_t s = 0; s < num_sensors; ++s) model_.cameras.Add(s + 1, camera_);
  if (num_sensors > 1) {
    Rig rig{.ref_sensor = SensorId{SensorType::kCamera, 1}};
    for (uint32_t s = 1; s < num_sensors; ++s)
      rig.sensors.push_back({{SensorType::kCamera, s + 1}, sensors_[s]});
    model_.rigs.Add(1, std::move(rig));
    model_.has_rig_files = true;
  }
  for (uint32_t f = 0; f < instants_.size(); ++f) {
    const Rigid3d rig_from_world = path_->CamFromWorld(instants_[f]);
    if (num_sensors > 1) {
      Frame frame{.rig_id = 1, .rig_from_world = rig_from_world};
      for (uint32_t s = 0; s < num_sensors; ++s) {
        frame.data.push_back({{SensorType::kCamera, s + 1}, f * num_sensors + s + 1});
      }
      model_.frames.Add(f + 1, std::move(frame));
    }
    for (uint32_t s = 0; s < num_sensors; ++s) {
      Image image{.camera_id = s + 1};
      image.name = num_sensors > 1
                       ? fmt::format("camera{}/{}_{:04}.{}", s + 1, name, f + 1, extension)
                       : fmt::format("{}_{:04}.{}", name, f + 1, extension);
      image.cam_from_world = sensors_[s] * rig_from_world;
      if (num_sensors > 1) image.frame_id = f + 1;
      model_.images.Add(f * num_sensors + s + 1, std::move(image));
    }
  }
  if (num_sensors == 1) model_.AddTrivialRigsAndFrames();
}

void Rendering::AddTruthToModel(const TruthOptions& options) {
  AddTruth(place_, *caster_, options, options_.seed, num_threads_, &model_);
}

Photo Rendering::TakePhoto(image_t image_id) const {
  const auto num_sensors = static_cast<uint32_t>(sensors_.size());
  const size_t frame = (image_id - 1) / num_sensors, sensor = (image_id - 1) % num_sensors;
  const uint64_t seed = options_.seed * 4099 + image_id;
  if (options_.walk.readout_ms == 0.0) {
    const Rigid3d& pose = model_.images.at(image_id).cam_from_world;
    return photographer_->Take([&](double) { return pose; }, seed);
  }
  // How much of the way the person walks from the first row to the last.
  const double part = options_.walk.speed * 1e-3 * options_.walk.readout_ms / path_->length();
  return photographer_->Take(
      [&](double time) {
        return sensors_[sensor] * path_->CamFromWorld(instants_[frame] + time * part);
      },
      seed);
}

TruthMaps Rendering::MakeMaps(image_t image_id) const {
  return photographer_->Maps(model_.images.at(image_id).cam_from_world);
}

}  // namespace holba
