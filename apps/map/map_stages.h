// SPDX-License-Identifier: BSD-3-Clause
// From a database with matches to models on disk, for the commands map and reconstruct.
#pragma once

#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apps/map/report.h"
#include "holba/base/options.h"
#include "holba/frontend/matching/line_matching.h"
#include "holba/io/model_format.h"
#include "holba/pipeline/detection.h"
#include "holba/pipeline/mapping.h"
#include "holba/pipeline/match_lines.h"
#include "holba/pipeline/regions.h"
#include "holba/pipeline/view_output.h"
#include "holba/sfm/mapper_options.h"
#include "holba/sfm/refine.h"

namespace holba {

struct MapPaths {
  std::string database_path, image_path, input_path, output_path;  // images and input: may be empty
};

// Whether the models could be written below a folder. Throws InputError.
void ProbeModels(const std::filesystem::path& folder);
// Whether an entry of the folder ("0/images.bin", "pictures") belongs to them.
bool IsOfModels(std::string_view name);

// What lies beside the models as report.txt and report.json.
struct MapReports {
  std::string text;
  nlohmann::json json;
};
MapReports ReportsOf(const MapOutput& output);

class SnapshotFile;

class MapStages {
 public:
  void Describe(OptionTable* table) const;
  // For a command that has options of photographs from elsewhere (SetPhotographs): all but those.
  void DescribeWithoutPhotographs(OptionTable* table) const;
  void SetPhotographs(const std::string& mask_path, const std::string& camera_mask_path,
                      bool strict);

  const DetectionOptions& detection() const { return detection_; }
  // Of images without poses.
  LineMatchingOptions SegmentMatching() const;
  MapperStructure structure() const { return mapper_.structure; }
  int num_threads() const { return refine_.solver.num_threads; }

  // Throws InputError for options that name what is not there.
  void Check() const;
  // Reads, maps, refines, writes. `reports`: made when all but the writing is done.
  MapOutput Run(const MapPaths& paths,
                const std::function<MapReports(const MapOutput&)>& reports = ReportsOf);

 private:
  // Of all options that the mapper's result depends on, a line each.
  std::string OptionsText() const;
  // Bytes that the mapper goes on from; empty: none.
  std::string Start(const SnapshotFile& snapshot) const;
  ContinueReport Continue(const std::filesystem::path& input_path, Reconstruction* scene) const;
  MappingData Read(const MapPaths& paths, Database* database) const;
  void Write(const MapPaths& paths, const MapReports& reports,
             const std::set<image_t>& without_photograph,
             const std::vector<Reconstruction>& models) const;
  void Refine(const MapPaths& paths, const MappingData& data, Database* database,
              Reconstruction* model, MapOutput::OfModel* report) const;

  MapperOptions mapper_;
  RefineOptions refine_;
  DetectionOptions detection_;
  MatchLinesOptions matching_;
  RegionOptions regions_;
  ModelFormat format_ = ModelFormat::kBinary;
  bool refine_models_ = true;
  int num_pictures_ = 4;
  bool view_ = true;
  ViewPhotographOptions photographs_in_view_;
  bool resume_ = false;
  bool align_to_positions_ = true;
  double snapshot_seconds_ = 10.0;
};

}  // namespace holba
