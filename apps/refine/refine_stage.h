// SPDX-License-Identifier: BSD-3-Clause
// What the command refine and the end of map do with a posed model and what was found in its
// images.
#pragma once

#include <map>

#include "apps/refine/report.h"
#include "holba/frontend/importers/import_segments.h"
#include "holba/io/database.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/regions.h"
#include "holba/scene/image_features.h"
#include "holba/sfm/refine.h"

namespace holba {

struct RefineStage {
  const DetectionOptions& detection;
  const MatchLinesOptions& matching;
  const RegionOptions& regions;
  const RefineOptions& refine;
};

// Of the images of a model, by its ids.
struct FoundInImages {
  ImageFeatureMap features;
  std::map<image_t, image_t> database_id;
  std::map<image_t, ImportedSegments> imported;
};

// Matches segments on the model's poses, observes labelled regions where there are any, refines;
// says on the log what it does.
void RunRefine(const RefineStage& stage, const FoundInImages& found, Database* database,
               Reconstruction* model, RefineOutput* output);

}  // namespace holba
