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

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(initial_pair, num_registered, num_registered_without_structure,
               num_failed_registrations, num_joined, num_contradicted, points, lines, adjustments,
               seconds, total_seconds);
  }
};

struct MappedModel {
  Reconstruction model;
  MapReport report;

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(model, report);
  }
};

struct MapResult {
  std::vector<MappedModel> models;  // the one with the most images first
  // Of images that are in no model, by id: a phrase.
  std::map<image_t, std::string> left_out;
  InitialPairReport initial_pairs;

  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(models, left_out, initial_pairs);
  }
};

// What a run tells while it goes on. Called on the mapper's thread between stages.
class MapObserver {
 public:
  virtual ~MapObserver() = default;
  // After the first pair and each registration with what follows it.
  virtual void OnImage(const MapperState&, image_t /*image_id*/, const std::string& /*sentence*/) {}
  // After adjustments of the whole model, and at the end: whether all that the run has come to is
  // wanted as bytes, which a run with the same options, input and scene can begin with.
  virtual bool WantsSnapshot() { return false; }
  virtual void OnSnapshot(const std::string& /*bytes*/) {}
  // True: end as soon as may be; what there is is the result.
  virtual bool ShouldStop() { return false; }
};

// `scene`: cameras, rigs, frames and all images (mapper_state.h). With images that have poses the
// model is continued, else begun. `snapshot` (empty: none): of a run with the same arguments, which
// is gone on with to the same result, bit for bit. Empty result: no pair of images could begin a
// model.
MapResult MapImages(const MapperOptions& options, const SolverOptions& solver,
                    const MappingInput& input, const Reconstruction& scene, MapObserver* observer,
                    const std::string& snapshot = "");

}  // namespace holba
