// SPDX-License-Identifier: BSD-3-Clause
// What a mapper begins with, made from a posed model: its images without poses, and matches by its
// tracks.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/scene/mapping_input.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct MappingProblem {
  Reconstruction scene;  // without poses
  MappingInput input;
  std::map<std::pair<image_t, point2D_t>, point3D_t> true_point;  // of each keypoint of a track
};

struct MappingProblemOptions {
  double share_of_wrong_matches = 0.0;  // beside the right ones of each pair
  bool focal_length_is_known = true;
  // Pairs that have no matches.
  std::set<std::pair<image_t, image_t>> unmatched;
  // Pairs that have so many matches at most.
  std::map<std::pair<image_t, image_t>, size_t> max_num_matches;
  // Images of few matches of points with each other image.
  std::set<image_t> poor;
  size_t num_matches_of_poor = 0;
};

// `features` and `line_matches`: segments (empty: none).
inline MappingProblem MakeMappingProblem(const Reconstruction& truth,
                                         const MappingProblemOptions& options = {},
                                         const ImageFeatureMap& features = {},
                                         const LineMatchMap& line_matches = {}) {
  MappingProblem problem;
  Random random(3);
  for (const auto& [id, camera] : truth.cameras) {
    problem.scene.cameras.Add(id, camera);
    if (options.focal_length_is_known) problem.input.cameras_of_known_focal_length.insert(id);
  }
  CorrespondenceGraphBuilder builder;
  for (const auto& [id, image] : truth.images) {
    Image waiting{.name = image.name, .camera_id = image.camera_id};
    for (point2D_t idx = 0; idx < image.points2D.size(); ++idx) {
      waiting.points2D.push_back({image.points2D[idx].xy, kNoId});
      if (image.points2D[idx].point3D_id != kNoId)
        problem.true_point[{id, idx}] = image.points2D[idx].point3D_id;
    }
    size_t num_segments = 0;
    if (const auto found = features.find(id); found != features.end()) {
      for (const LineSegment2d& segment : found->second.segments)
        waiting.lines2D.push_back({segment, kNoId});
      num_segments = found->second.segments.size();
    }
    builder.AddImage(id, image.points2D.size(), num_segments);
    problem.scene.AddUnregisteredImage(id, std::move(waiting));
  }
  std::map<ImagePair, PointMatches> matches;
  for (const auto& [id, point] : truth.points3D) {
    for (const PointObservation& a : point.track) {
      for (const PointObservation& b : point.track) {
        if (a.image_id < b.image_id && !options.unmatched.contains({a.image_id, b.image_id}))
          matches[{a.image_id, b.image_id}].push_back({a.point2D_idx, b.point2D_idx});
      }
    }
  }
  for (const auto& [pair, of_pair] : line_matches)
    builder.AddLineMatches(pair.first, pair.second, of_pair);
  problem.input.features = features;
  for (auto& [pair, of_pair] : matches) {
    if ((options.poor.contains(pair.first) || options.poor.contains(pair.second)) &&
        of_pair.size() > options.num_matches_of_poor)
      of_pair.resize(options.num_matches_of_poor);
    const auto most = options.max_num_matches.find(pair);
    if (most != options.max_num_matches.end() && of_pair.size() > most->second) {
      // Each pair of others.
      const size_t shift = pair.second * most->second % of_pair.size();
      std::rotate(of_pair.begin(), of_pair.begin() + static_cast<std::ptrdiff_t>(shift),
                  of_pair.end());
      of_pair.resize(most->second);
    }
    if (of_pair.empty()) continue;
    const size_t num1 = truth.images.at(pair.first).points2D.size(),
                 num2 = truth.images.at(pair.second).points2D.size();
    const auto num_wrong =
        static_cast<size_t>(options.share_of_wrong_matches * static_cast<double>(of_pair.size()));
    for (size_t i = 0; i < num_wrong; ++i) {
      of_pair.push_back(
          {static_cast<point2D_t>(random.Index(num1)), static_cast<point2D_t>(random.Index(num2))});
    }
    builder.AddTwoViewGeometry(pair.first, pair.second,
                               {.config = TwoViewConfig::kCalibrated, .inlier_matches = of_pair});
  }
  problem.input.graph = builder.Build();
  return problem;
}

// Each image with a camera of its own, whose focal length is 1.2 times the width of the image, as
// COLMAP has photographs without EXIF; the model's own rigs and frames no longer fit.
inline Reconstruction WithOwnCameras(Reconstruction model) {
  const Camera shared = model.cameras.begin()->second;
  for (auto& [id, image] : model.images) {
    Camera camera = shared;
    for (const int idx : camera.model->focal_idxs)
      camera.params[idx] = 1.2 * static_cast<double>(camera.width);
    for (const int idx : camera.model->extra_idxs) camera.params[idx] = 0.0;
    model.cameras.Remove(id);
    model.cameras.Add(id, camera);
    image.camera_id = id;
  }
  return model;
}

}  // namespace holba
