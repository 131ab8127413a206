// SPDX-License-Identifier: BSD-3-Clause
// What `holba map` did, as a JSON object and as text: the paper's table of runtime and
// reconstruction, and why images were left out.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/map/position_alignment.h"
#include "apps/refine/report.h"
#include "holba/pipeline/continue_model.h"
#include "holba/sfm/mapper.h"

namespace holba {

struct MapOutput {
  struct OfModel {
    MapReport map;
    std::optional<PositionAlignment> alignment;  // empty: there are no positions
    std::optional<RefineOutput> refine;          // empty: the model was left as the mapper had it
    size_t num_images = 0, num_points = 0, num_observations = 0, num_lines = 0, num_groups = 0;
    double mean_error_px = 0.0;  // of points' observations
  };
  size_t num_images = 0;                    // of the database
  std::optional<ContinueReport> continued;  // of --input_path
  std::vector<OfModel> models;
  std::vector<std::pair<std::string, std::string>> left_out;  // name of the image, why
  InitialPairReport initial_pairs;
  double read_seconds = 0.0, map_seconds = 0.0, refine_seconds = 0.0, total_seconds = 0.0;
};

// The figures of a model that are counted in it.
void CountModel(const Reconstruction& model, MapOutput::OfModel* counts);

nlohmann::json MapToJson(const MapOutput& output);
std::string MapToText(const MapOutput& output);

}  // namespace holba
