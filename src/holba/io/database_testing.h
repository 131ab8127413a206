// SPDX-License-Identifier: BSD-3-Clause
// Features of an image for the tests of the database.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "holba/base/random.h"
#include "holba/io/database.h"

namespace holba {

inline Eigen::Vector3d RandomUnit(Random* random) {
  return Eigen::Vector3d(random->Normal(), random->Normal(), random->Normal()).normalized();
}

// All parts of ImageFeatures, as the database takes them.
inline ImageFeatures RandomFeatures(uint64_t seed, size_t num_segments) {
  Random random(seed);
  ImageFeatures features;
  const auto pixel = [&] {
    return Eigen::Vector2d(random.Uniform(0, 640), random.Uniform(0, 480));
  };
  for (size_t i = 0; i < num_segments; ++i) {
    features.segments.push_back({pixel(), pixel()});
    for (int k = 0; k < kSegmentDescriptorSize; ++k) {
      features.segment_descriptors.push_back(static_cast<float>(random.Normal()));
    }
    features.vp_of_segment.push_back(static_cast<int32_t>(random.Index(4)) - 1);
  }
  for (int i = 0; i < 5; ++i) {
    features.corners.push_back(pixel());
    for (int k = 0; k < kCornerDescriptorSize; ++k) {
      features.corner_descriptors.push_back(static_cast<uint8_t>(random.Index(256)));
    }
  }
  for (uint32_t i = 0; i < 3; ++i) features.vanishing_points.push_back({RandomUnit(&random), i});
  LabelMap& map = features.label_map;
  map.width = 40;
  map.height = 30;
  while (map.labels.size() < 1200) {
    const size_t run = std::min<size_t>(1 + random.Index(300), 1200 - map.labels.size());
    map.labels.insert(map.labels.end(), run, static_cast<uint16_t>(random.Index(65536)));
  }
  map.types = {{1, FindGroupType("PLANE")}, {65535, FindGroupType("SPHERE")}};
  features.normals = {{1, {RandomUnit(&random), 2.5}}, {7, {RandomUnit(&random), 0.0}}};
  return features;
}

inline ImageVanishingPoints VanishingPoints(const ImageFeatures& features) {
  return {features.vanishing_points, features.vp_of_segment};
}

inline void WriteAll(image_t image_id, const std::string& settings, const ImageFeatures& features,
                     Database* database) {
  database->WriteSegments(image_id, settings, features.segments);
  database->WriteSegmentDescriptors(image_id, settings, features.segment_descriptors);
  database->WriteCorners(image_id, settings, {features.corners, features.corner_descriptors});
  database->WriteVanishingPoints(image_id, settings, VanishingPoints(features));
  database->WriteLabelMap(image_id, settings, features.label_map);
  database->WriteNormals(image_id, settings, features.normals);
}

// How many of the parts are there, of six.
inline int CountParts(const Database& database, image_t image_id, const std::string& settings) {
  return database.ReadSegments(image_id, settings).has_value() +
         database.ReadSegmentDescriptors(image_id, settings).has_value() +
         database.ReadCorners(image_id, settings).has_value() +
         database.ReadVanishingPoints(image_id, settings).has_value() +
         database.ReadLabelMap(image_id, settings).has_value() +
         database.ReadNormals(image_id, settings).has_value();
}

// Images 1 to `num_images` of camera 1.
inline void AddImages(int num_images, Database* database) {
  const Camera camera{FindCameraModel("PINHOLE"), 640, 480, {500, 501, 320, 240}};
  database->AddCamera(1, {camera, true});
  for (int i = 1; i <= num_images; ++i) {
    database->AddImage(i, {std::to_string(i) + ".jpg", 1});
  }
}

}  // namespace holba
