// SPDX-License-Identifier: BSD-3-Clause
// Incremental structure from motion: images without poses and their matches become posed models of
// points and structure (paper, "Structure-from-Motion Pipeline" and its appendix; Schoenberger and
// Frahm, Structure-from-Motion Revisited, CVPR 2016).
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "holba/sfm/initial_pair.h"
#include "holba/sfm/map_adjustment.h"
#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"
#include "holba/sfm/register_image.h"
#include "holba/sfm/triangulate_lines.h"
#include "holba/sfm/triangulate_points.h"

namespace holba {

// One model.
struct MapReport {
  InitialPair initial_pair;  // not of a model that was continued
  size_t num_registered = 0, num_registered_without_structure = 0;
  size_t num_failed_registrations = 0;
  size_t num_joined = 0;        // images that came with another model
  size_t num_contradicted = 0;  // images that lost their pose because matches are missing
  PointChanges points;          // of triangulation after registrations
  LineChanges lines;
  AdjustmentReport adjustments;
  std::map<std::string, double> seconds;  // by stage
  double total_seconds = 0.0;
};

struct MappedModel {
  Reconstruction model;
  MapReport report;
};

struct MapResult {
  std::vector<MappedModel> models;  // the one with the most images first
  // Of images that are in no model, by id: a phrase.
  std::map<image_t, std::string> left_out;
  InitialPairReport initial_pairs;
};

// What a run tells while it goes on. Called on the mapper's thread between stages.
class MapObserver {
 public:
  virtual ~MapObserver() = default;
  // After the first pair and each registration with what follows it.
  virtual void OnImage(const MapperState&, image_t /*image_id*/, const std::string& /*sentence*/) {}
  // After each adjustment of the whole model: a whole state, for snapshots.
  virtual void OnModel(const MapperState&) {}
  // True: end as soon as may be; what there is is the result.
  virtual bool ShouldStop() { return false; }
};

// `scene`: cameras, rigs, frames and all images (mapper_state.h). With images that have poses the
// model is continued, else begun. Empty result: no pair of images could begin a model.
MapResult MapImages(const MapperOptions& options, const SolverOptions& solver,
                    const MappingInput& input, const Reconstruction& scene, MapObserver* observer);

}  // namespace holba
