// SPDX-License-Identifier: BSD-3-Clause
// From a database with matches to models on disk, for the commands map and reconstruct.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "apps/map/report.h"
#include "holba/base/options.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/io/model_format.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/mapping.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/regions.h"
#include "holba/sfm/mapper_options.h"
#include "holba/sfm/refine.h"

namespace holba {

struct MapPaths {
  std::string database_path, image_path, input_path, output_path;  // images and input: may be empty
  bool quiet = false;
};

// Whether the models could be written below a folder. Throws InputError.
void ProbeModels(const std::filesystem::path& folder);
// Whether an entry of the folder ("0/images.bin", "pictures") belongs to them.
bool IsOfModels(std::string_view name);

class MapStages {
 public:
  void Describe(OptionTable* table) const;
  // Reads, maps, refines, writes.
  MapOutput Run(const MapPaths& paths);

 private:
  void Refine(const MapPaths& paths, const MappingData& data, Reconstruction* model,
              MapOutput::OfModel* report) const;

  MapperOptions mapper_;
  RefineOptions refine_;
  DetectionOptions detection_;
  MatchLinesOptions matching_;
  RegionOptions regions_;
  ModelFormat format_ = ModelFormat::kBinary;
  bool refine_models_ = true;
  int num_pictures_ = 4;
};

}  // namespace holba
