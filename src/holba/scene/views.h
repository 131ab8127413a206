// SPDX-License-Identifier: BSD-3-Clause
// The ideal view of every image of a model: the one set of views that stages work with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "holba/base/check.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Views by position (in the order of the model's images) and by image id. They hold the poses as
// they were when the map was made, and reference the model's cameras.
class ViewMap {
 public:
  ViewMap() = default;
  explicit ViewMap(const Reconstruction& model);

  size_t size() const { return views_.size(); }
  bool contains(image_t image_id) const { return idx_.contains(image_id); }
  // The id must be there.
  uint32_t IndexOf(image_t image_id) const {
    const auto it = idx_.find(image_id);
    HOLBA_CHECK_MSG(it != idx_.end(), "no view of image " + std::to_string(image_id));
    return it->second;
  }
  image_t ImageId(size_t idx) const { return image_ids_[idx]; }
  const IdealView& operator[](size_t idx) const { return views_[idx]; }
  const IdealView& at(image_t image_id) const { return views_[IndexOf(image_id)]; }
  auto begin() const { return views_.begin(); }
  auto end() const { return views_.end(); }

 private:
  std::vector<image_t> image_ids_;
  std::vector<IdealView> views_;
  std::unordered_map<image_t, uint32_t> idx_;
};

}  // namespace holba
