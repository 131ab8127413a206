// SPDX-License-Identifier: BSD-3-Clause
// What new images of a database see of a model, by their matches with images that the model has.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "holba/estimation/pose/sightings.h"
#include "holba/io/database.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct ModelSightings {
  AbsolutePoseMatches matches;
  // Of each sighting: what is seen as what.
  std::vector<std::pair<point2D_t, point3D_t>> points;
  std::vector<std::pair<line2D_t, line3D_t>> lines;
  size_t num_images = 0;  // of the model with a match
};

// Which matches of keypoints are taken: those that the geometry of their pair agrees with, or all.
enum class MatchesTaken { kVerified, kAll };

// Keypoints and segments of a database's images with what they are images of. A model's 2D points
// are its keypoints where they are at the same place; of a model that was made from other
// keypoints, those within a pixel.
class FeaturesOfModel {
 public:
  // `database_id`: of images of the model, where the database has them. The model must outlive it.
  FeaturesOfModel(const Reconstruction& model, const Database& database,
                  const std::map<image_t, image_t>& database_id);

  const Reconstruction& model() const { return model_; }
  // Images of the database whose keypoints or segments are images of something.
  const std::vector<image_t>& images() const { return images_; }
  // Points of the model's images that are at no keypoint, and those that are at one.
  size_t num_points_without_keypoint() const { return num_without_; }
  size_t num_points_with_keypoint() const { return num_with_; }

  // Of an image (by its id in the database). Each pair once.
  ModelSightings Find(const Database& database, image_t image_id, MatchesTaken taken,
                      const LineMatchMap& line_matches) const;

  // Pairs every vanishing point with every vanishing direction of the model: few of both.
  std::vector<DirectionSighting> PairDirections(
      const std::vector<ImageVanishingPoint>& vanishing_points) const;

 private:
  struct OfImage {
    std::vector<point3D_t> point_of_keypoint;  // kNoId: none
    std::vector<line3D_t> line_of_segment;
  };
  void AddPoints(const Image& image, const Keypoints& keypoints, OfImage* features);
  static void AddLines(const Image& image, const std::vector<LineSegment2d>& segments,
                       OfImage* features);

  const Reconstruction& model_;
  std::vector<image_t> images_;
  std::map<image_t, OfImage> features_;
  size_t num_with_ = 0, num_without_ = 0;
};

}  // namespace holba
