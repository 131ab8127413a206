// SPDX-License-Identifier: BSD-3-Clause
// Which images see the same 3D points: for each image its neighbours, and which points it shares
// with them. Images and points are counted in the order of the model. Time and memory grow with the
// pairs of observations of the tracks, never with the square of the number of images.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

// An observation of a point. Indices count from 0.
struct CovisibleSighting {
  uint32_t point_idx = 0;
  uint32_t image_idx = 0;
  point2D_t point2D_idx = kInvalidId32;  // in the image
};

// Two observations of one point, in an image and in its neighbour.
struct SharedSighting {
  uint32_t point_idx = 0;
  point2D_t point2D_idx1 = kInvalidId32;  // in the image
  point2D_t point2D_idx2 = kInvalidId32;  // in the neighbour
};

class Covisibility {
 public:
  struct Neighbour {
    uint32_t image_idx = 0;
    uint32_t num_points = 0;     // different points that both images see
    uint32_t num_sightings = 0;  // greater where an image observes a point twice
  };

  // What one image shares with each of its neighbours.
  class Shared {
   public:
    size_t size() const { return begin_.size() - 1; }  // as NeighboursOf the image
    // By point, then in the order of the sightings that were given.
    std::span<const SharedSighting> operator[](size_t neighbour) const {
      return {sightings_.data() + begin_[neighbour], begin_[neighbour + 1] - begin_[neighbour]};
    }

   private:
    friend class Covisibility;
    std::vector<size_t> begin_;  // of each neighbour, and the end
    std::vector<SharedSighting> sightings_;
  };

  // Of all observations of the tracks.
  explicit Covisibility(const Reconstruction& model);
  // Of these, in any order.
  Covisibility(size_t num_images, size_t num_points, std::span<const CovisibleSighting> sightings);

  size_t num_images() const { return num_points_.size(); }
  // Number of different points that an image sees.
  uint32_t NumPoints(size_t image_idx) const { return num_points_[image_idx]; }
  // Images that share points with an image, ascending.
  std::span<const Neighbour> NeighboursOf(size_t image_idx) const {
    return {neighbours_.data() + first_neighbour_[image_idx],
            first_neighbour_[image_idx + 1] - first_neighbour_[image_idx]};
  }
  // Gathered anew by each call. For several threads.
  Shared SharedWithNeighbours(size_t image_idx) const;

 private:
  void Build(size_t num_images, size_t num_points, std::span<const CovisibleSighting> sightings);
  std::span<const CovisibleSighting> SightingsOf(size_t point_idx) const {
    return {by_point_.data() + first_of_point_[point_idx],
            first_of_point_[point_idx + 1] - first_of_point_[point_idx]};
  }
  // Sightings of an image, by point.
  std::span<const CovisibleSighting> SightingsIn(size_t image_idx) const {
    return {by_image_.data() + first_of_image_[image_idx],
            first_of_image_[image_idx + 1] - first_of_image_[image_idx]};
  }

  std::vector<CovisibleSighting> by_point_, by_image_;
  std::vector<size_t> first_of_point_, first_of_image_, first_neighbour_;  // and the end
  std::vector<uint32_t> num_points_;                                       // of each image
  std::vector<Neighbour> neighbours_;
};

}  // namespace holba
