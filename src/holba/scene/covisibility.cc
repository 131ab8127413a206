// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/covisibility.h"

#include <algorithm>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr uint32_t kNoPlace = kInvalidId32;

// Sorts by a key below `num_keys`, keeping the order of equal ones; `first`: where each key begins.
template <typename Key>
std::vector<CovisibleSighting> CountingSort(std::span<const CovisibleSighting> sightings,
                                            size_t num_keys, Key key, std::vector<size_t>* first) {
  first->assign(num_keys + 1, 0);
  for (const CovisibleSighting& s : sightings) {
    HOLBA_CHECK(key(s) < num_keys);
    ++(*first)[key(s) + 1];
  }
  for (size_t k = 0; k < num_keys; ++k) (*first)[k + 1] += (*first)[k];
  std::vector<size_t> next(first->begin(), first->end() - 1);
  std::vector<CovisibleSighting> sorted(sightings.size());
  for (const CovisibleSighting& s : sightings) sorted[next[key(s)]++] = s;
  return sorted;
}

std::vector<CovisibleSighting> SightingsOfTracks(const Reconstruction& model) {
  std::vector<CovisibleSighting> sightings;
  uint32_t point_idx = 0;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& o : point.track) {
      sightings.push_back(
          {point_idx, static_cast<uint32_t>(model.images.IndexOf(o.image_id)), o.point2D_idx});
    }
    ++point_idx;
  }
  return sightings;
}

}  // namespace

Covisibility::Covisibility(const Reconstruction& model) {
  Build(model.images.size(), model.points3D.size(), SightingsOfTracks(model));
}

Covisibility::Covisibility(size_t num_images, size_t num_points,
                           std::span<const CovisibleSighting> sightings) {
  Build(num_images, num_points, sightings);
}

void Covisibility::Build(size_t num_images, size_t num_points,
                         std::span<const CovisibleSighting> sightings) {
  by_point_ = CountingSort(
      sightings, num_points, [](const CovisibleSighting& s) { return s.point_idx; },
      &first_of_point_);
  by_image_ = CountingSort(
      by_point_, num_images, [](const CovisibleSighting& s) { return s.image_idx; },
      &first_of_image_);

  num_points_.assign(num_images, 0);
  first_neighbour_.assign(1, 0);
  // For each other image its place among the neighbours of this one, and the last point counted.
  std::vector<uint32_t> place(num_images, kNoPlace), last_point(num_images, kNoPlace);
  for (uint32_t i = 0; i < num_images; ++i) {
    const size_t begin = neighbours_.size();
    uint32_t last_own_point = kNoPlace;
    for (const CovisibleSighting& own : SightingsIn(i)) {
      if (own.point_idx != last_own_point) ++num_points_[i];
      last_own_point = own.point_idx;
      for (const CovisibleSighting& other : SightingsOf(own.point_idx)) {
        const uint32_t j = other.image_idx;
        if (j == i) continue;
        if (place[j] == kNoPlace) {
          place[j] = static_cast<uint32_t>(neighbours_.size() - begin);
          neighbours_.push_back({.image_idx = j});
        }
        Neighbour& neighbour = neighbours_[begin + place[j]];
        if (last_point[j] != own.point_idx) ++neighbour.num_points;
        last_point[j] = own.point_idx;
        ++neighbour.num_sightings;
      }
    }
    for (size_t k = begin; k < neighbours_.size(); ++k) {
      place[neighbours_[k].image_idx] = last_point[neighbours_[k].image_idx] = kNoPlace;
    }
    std::sort(neighbours_.begin() + static_cast<ptrdiff_t>(begin), neighbours_.end(),
              [](const Neighbour& a, const Neighbour& b) { return a.image_idx < b.image_idx; });
    first_neighbour_.push_back(neighbours_.size());
  }
}

Covisibility::Shared Covisibility::SharedWithNeighbours(size_t image_idx) const {
  const std::span<const Neighbour> neighbours = NeighboursOf(image_idx);
  Shared shared;
  shared.begin_.assign(1, 0);
  for (const Neighbour& n : neighbours) {
    shared.begin_.push_back(shared.begin_.back() + n.num_sightings);
  }
  shared.sightings_.resize(shared.begin_.back());
  std::vector<size_t> next(shared.begin_.begin(), shared.begin_.end() - 1);
  for (const CovisibleSighting& own : SightingsIn(image_idx)) {
    for (const CovisibleSighting& other : SightingsOf(own.point_idx)) {
      if (other.image_idx == image_idx) continue;
      const auto it =
          std::lower_bound(neighbours.begin(), neighbours.end(), other.image_idx,
                           [](const Neighbour& n, uint32_t image) { return n.image_idx < image; });
      shared.sightings_[next[static_cast<size_t>(it - neighbours.begin())]++] = {
          own.point_idx, own.point2D_idx, other.point2D_idx};
    }
  }
  return shared;
}

}  // namespace holba
