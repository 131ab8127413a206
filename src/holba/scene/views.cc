// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/views.h"

namespace holba {

ViewMap::ViewMap(const Reconstruction& model) {
  const size_t num_images = model.images.size();
  image_ids_.reserve(num_images);
  views_.reserve(num_images);
  idx_.reserve(num_images);
  for (const auto& [image_id, image] : model.images) {
    idx_.emplace(image_id, static_cast<uint32_t>(views_.size()));
    image_ids_.push_back(image_id);
    views_.emplace_back(model, image_id);
  }
}

}  // namespace holba
