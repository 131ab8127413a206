// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/rendered_set.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "apps/extract/extract_stage.h"
#include "apps/map/map_stages.h"
#include "apps/match/match_stage.h"
#include "apps/refine/refine_stage.h"
#include "apps/render/place_set.h"
#include "holba/base/check.h"
#include "holba/frontend/photographs/opencv_threads.h"
#include "holba/io/database.h"
#include "holba/io/files.h"
#include "holba/io/model_io.h"
#include "holba/io/ply_reader.h"
#include "holba/pipeline/mapping.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/sfm/mapper.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

constexpr int kNumRooms = 8;

struct RenderedSize {
  int width, height, num_images;
};

RenderedSize SizeOf(const PaperBenchOptions& options) {
  const int num_images = options.NumImages(10, 16, 100);
  if (options.size == BenchSize::kSmall) return {320, 240, num_images};
  if (options.size == BenchSize::kMedium) return {640, 480, num_images};
  return {1024, 768, num_images};
}

// The parts of `holba refine` with an option table.
struct RefineSettings {
  DetectionOptions detection;
  MatchLinesOptions matching;
  RegionOptions regions;
  RefineOptions refine;

  void Describe(OptionTable* table) const {
    detection.Describe(table);
    matching.Describe(table);
    regions.Describe(table);
    refine.Describe(table);
  }
};

// What is known exactly is not adjusted.
const OptionTexts kKnownIntrinsics = {{"Bundle.refine_focal_length", "0"},
                                      {"Bundle.refine_extra_params", "0"},
                                      {"Bundle.refine_principal_point", "0"}};

// Runs once: what an image has in the database is kept, and pairs that are matched are.
void FillDatabase(const RenderedSet& set) {
  HOLBA_CHECK(set.truth.cameras.size() == 1);
  const Camera& camera = set.truth.cameras.begin()->second;
  ExtractOptions extract;
  extract.reader.single_camera = true;
  extract.reader.camera_model = camera.model->name;
  for (const double param : camera.params)
    extract.reader.camera_params +=
        fmt::format("{}{}", extract.reader.camera_params.empty() ? "" : ",", param);
  extract.num_threads = set.num_threads;
  RunExtract(extract, set.Images(), set.DatabasePath());
  MatchStageOptions match;
  match.matching.num_threads = set.num_threads;
  RunMatch(match, set.DatabasePath());
}

}  // namespace

RenderedSets::RenderedSets(const PaperBenchOptions& options) : options_(options) {
  if (options_.work_path.empty()) {
    temporary_.emplace(fs::temp_directory_path() / fmt::format("holba-rendered-{}", getpid()));
  }
}

fs::path RenderedSets::Folder() const {
  return temporary_ ? temporary_->path() : fs::path(options_.work_path);
}

RenderedSet RenderedSets::Room(int case_idx) const {
  const uint64_t number = options_.seed + static_cast<uint64_t>(case_idx);
  return Make(fmt::format("room_{}", number % kNumRooms + 1), 1 + number / kNumRooms, false);
}

RenderedSet RenderedSets::Table(int case_idx) const {
  return Make("table", options_.seed + static_cast<uint64_t>(case_idx) + 1, true);
}

std::vector<std::string> RenderedSets::RoomNames() const {
  std::vector<std::string> names;
  for (int i = 0; i < options_.NumSeeds(); ++i) {
    const uint64_t number = options_.seed + static_cast<uint64_t>(i);
    names.push_back(fmt::format("room_{}", number % kNumRooms + 1));
    if (number >= kNumRooms) names.back() += fmt::format(", seed {}", 1 + number / kNumRooms);
  }
  return names;
}

RenderedSet RenderedSets::Make(const std::string& preset, uint64_t seed, bool maps) const {
  const RenderedSize size = SizeOf(options_);
  RenderedSet set;
  // All that the photographs depend on.
  set.folder = Folder() / fmt::format("{}-{}-{}x{}-{}", preset, seed, size.width, size.height,
                                      size.num_images);
  set.num_threads = options_.num_threads;
  if (!fs::exists(set.folder / "truth")) {
    PlaceSetOptions place;
    place.maps = maps;
#if defined(HOLBA_WITH_EMBREE)
    place.render.camera.width = size.width;
    place.render.camera.height = size.height;
    place.render.walk.num_images = size.num_images;
#endif
    StagedFolder stage(set.folder);
    RenderPlaceSet(preset, seed, place, options_.num_threads, &stage);
    stage.Commit(IsPlaceSetFile);
  }
  set.truth = ReadModel(set.folder / "truth");
  FillDatabase(set);
  return set;
}

Reconstruction TriangulateOnTruth(const RenderedSet& set) {
  Database database(set.DatabasePath());
  const MappingDataOptions data_options{.structure = false, .num_threads = set.num_threads};
  MappingData data = ReadMappingData(data_options, {}, {}, nullptr, &database);
  std::map<std::string, const Image*> by_name;
  for (const auto& [id, image] : set.truth.images) by_name[image.name] = &image;
  std::vector<image_t> image_ids;
  for (const auto& [id, image] : data.scene.unregistered_images) image_ids.push_back(id);
  for (const image_t id : image_ids)
    data.scene.RegisterImage(id, by_name.at(data.scene.FindImage(id)->name)->cam_from_world);

  MapperOptions mapper;
  SetOptions({{"Mapper.structure", "none"},
              {"Mapper.fix_existing_frames", "1"},
              {"Mapper.ba_refine_focal_length", "0"},
              {"Mapper.ba_refine_extra_params", "0"}},
             &mapper);
  SolverOptions solver;
  solver.num_threads = set.num_threads;
  MapObserver observer;
  MapResult result = MapImages(mapper, solver, data.input, data.scene, &observer);
  HOLBA_CHECK(!result.models.empty());
  return std::move(result.models.front().model);
}

Reconstruction MapSet(const RenderedSet& set, const std::string& structure,
                      const OptionTexts& others) {
  OptionTexts texts = kKnownIntrinsics;
  texts.insert(texts.end(), {{"Mapper.structure", structure},
                             {"Mapper.ba_refine_focal_length", "0"},
                             {"Mapper.ba_refine_extra_params", "0"},
                             {"Solver.num_threads", std::to_string(set.num_threads)},
                             {"view", "0"}});
  texts.insert(texts.end(), others.begin(), others.end());
  MapStages stages;
  SetOptions(texts, &stages);
  const TemporaryPath output(fs::temp_directory_path() / fmt::format("holba-map-{}", getpid()));
  // Pictures are not wanted: the database has all that was found in the photographs.
  stages.Run({.database_path = set.DatabasePath().string(),
              .image_path = "",
              .input_path = "",
              .output_path = output.path().string()});
  return ReadModel(output.path() / "0");
}

Reconstruction RefineOnSet(const RenderedSet& set, const Reconstruction& posed,
                           const OptionTexts& options) {
  OptionTexts texts = kKnownIntrinsics;
  texts.insert(texts.end(), options.begin(), options.end());
  RefineSettings settings;
  SetOptions(texts, &settings);
  settings.refine.solver.num_threads = settings.detection.num_threads =
      settings.matching.num_threads = set.num_threads;
  HoldOpenCvThreads();
  Reconstruction model = posed;
  Database database(set.DatabasePath());
  const PhotographFolder photographs(set.Images(), model);
  FoundInImages found;
  RefineOutput output;
  found.database_id = database.MatchImages(model, CheckDatabase(database, photographs, model));
  found.features = DetectFeatures(settings.detection, photographs, model, found.database_id,
                                  &database, &found.imported, &output.detection);
  RunRefine({settings.detection, settings.matching, settings.regions, settings.refine}, found,
            &database, &model, &output);
  return model;
}

std::vector<double> AucsOf(const Reconstruction& model, const Reconstruction& truth,
                           const std::vector<double>& thresholds_deg) {
  const PoseErrors errors = ComparePoses(model, truth);
  std::vector<double> aucs;
  for (const double threshold_deg : thresholds_deg)
    aucs.push_back(100.0 * PoseAuc(errors.pair_deg, threshold_deg));
  return aucs;
}

std::vector<SeedMeasure> MeasuresAt(std::string_view name, const std::vector<double>& thresholds,
                                    std::string_view unit, BetterIs better) {
  std::vector<SeedMeasure> measures;
  for (const double threshold : thresholds)
    measures.push_back({fmt::format("{} @{:g} {}", name, threshold, unit), better, 1});
  return measures;
}

std::vector<Eigen::Vector3d> ScanOfMesh(const fs::path& mesh_path, double spacing) {
  HOLBA_CHECK(spacing > 0.0);
  const FileGeometry mesh = ReadMesh(mesh_path);
  std::vector<Eigen::Vector3d> points;
  for (const auto& triangle : mesh.triangles) {
    std::array<Eigen::Vector3d, 3> corners;
    for (size_t k = 0; k < 3; ++k) corners[k] = mesh.vertices[triangle[k]];
    // The longest side first, so that rows along it are as few as can be.
    const auto length = [&](size_t k) { return (corners[(k + 1) % 3] - corners[k]).norm(); };
    size_t longest = 0;
    for (size_t k = 1; k < 3; ++k)
      if (length(k) > length(longest)) longest = k;
    std::rotate(corners.begin(), corners.begin() + longest, corners.end());
    const Eigen::Vector3d along = corners[1] - corners[0], to_apex = corners[2] - corners[0];
    const double base = along.norm();
    const double height = base > 0.0 ? along.cross(to_apex).norm() / base : 0.0;
    const int num_rows = std::max(1, static_cast<int>(std::ceil(height / spacing)));
    for (int i = 0; i < num_rows; ++i) {
      const double up = (i + 0.5) / num_rows;
      const int num_in_row = std::max(1, static_cast<int>(std::ceil((1.0 - up) * base / spacing)));
      for (int j = 0; j < num_in_row; ++j) {
        points.push_back(corners[0] + up * to_apex + (1.0 - up) * ((j + 0.5) / num_in_row) * along);
      }
    }
  }
  return points;
}

}  // namespace holba
