// SPDX-License-Identifier: BSD-3-Clause
#include "apps/refine/refine_stage.h"

#include <string>

#include "holba/base/log.h"

namespace holba {

void RunRefine(const RefineStage& stage, const FoundInImages& found, Database* database,
               Reconstruction* model, RefineOutput* output) {
  const ImportPaths& imports = stage.detection.imports;
  LineMatchMap matches;
  const auto match_lines = [&](const Reconstruction& posed) {
    if (found.features.empty()) return matches;
    matches = MatchLines(stage.matching, imports.line_matches, posed, found.features,
                         found.database_id, found.imported, database, &output->matching);
    LogInfo("{}", MatchingText(output->matching));
    return matches;
  };
  RegionObserver observe_regions;
  if (!imports.labels.empty()) {
    observe_regions = [&](Reconstruction* with_lines) {
      return ObserveRegions(stage.regions, imports.correspondences, found.features, matches,
                            with_lines, &output->regions);
    };
  }
  output->refine = RefineModel(stage.refine, found.features, match_lines, observe_regions, model,
                               [](const std::string& text) { LogInfo("{}", text); });
}

}  // namespace holba
