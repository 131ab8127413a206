// SPDX-License-Identifier: BSD-3-Clause
// A place, its light, the cameras on their walk and what is true of them: all that photographs
// need.
#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "holba/render/light.h"
#include "holba/render/photographer.h"
#include "holba/render/place.h"
#include "holba/render/ray_caster.h"
#include "holba/render/truth_model.h"
#include "holba/render/walk.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RenderOptions {
  uint64_t seed = 1;
  RenderCameraOptions camera;
  WalkOptions walk;
  PhotoOptions photo;

  void Describe(OptionTable* table) const;  // without the seed
};

class Rendering {
 public:
  // `name` begins the names of the images, `extension` ends them. `progress`: of the light, steps
  // done of all. The same for any number of threads. Throws InputError for cameras that do not
  // exist.
  Rendering(Place place, std::string_view name, std::string_view extension,
            const RenderOptions& options, int num_threads,
            const std::function<void(size_t, size_t)>& progress);

  const Place& place() const { return place_; }
  const RayCaster& caster() const { return *caster_; }
  // Cameras, rigs, images with their poses; after AddTruth all that is true.
  const Reconstruction& model() const { return model_; }
  void AddTruthToModel(const TruthOptions& options = {});

  Photo TakePhoto(image_t image_id) const;
  TruthMaps MakeMaps(image_t image_id) const;

 private:
  void AddImages(std::string_view name, std::string_view extension);

  Place place_;
  RenderOptions options_;
  int num_threads_;
  std::unique_ptr<RayCaster> caster_;
  std::unique_ptr<PlaceLight> light_;
  std::unique_ptr<WalkPath> path_;
  std::unique_ptr<Photographer> photographer_;
  Reconstruction model_;
  Camera camera_;
  std::vector<double> instants_;  // parts of the way, by frame
  std::vector<Rigid3d> sensors_;
};

}  // namespace holba
