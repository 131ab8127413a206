// SPDX-License-Identifier: BSD-3-Clause
// Rendered photographs of the presets (docs/render.md) with their database, posed models and
// refinement: what the benchmarks `geometry`, `poses`, `ablation` and `primitives` have in common.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/bench/option_texts.h"
#include "apps/bench/paper_bench.h"
#include "holba/base/temporary_paths.h"
#include "holba/evaluation/nearest_distance.h"
#include "holba/evaluation/pose_auc.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct RenderedSet {
  std::filesystem::path folder;  // images, labels, database.db with features and matches
  Reconstruction truth;
  int num_threads = -1;

  std::filesystem::path Images() const { return folder / "images"; }
  std::filesystem::path Labels() const { return folder / "labels"; }
  std::filesystem::path DatabasePath() const { return folder / "database.db"; }
  std::filesystem::path Mesh() const { return folder / "mesh.ply"; }
};

// Sets of one benchmark, which live in the work folder, or in a temporary one as long as this.
class RenderedSets {
 public:
  explicit RenderedSets(const PaperBenchOptions& options);

  // Rooms of case i: room_1 to room_8, then these again with other seeds. 320 x 240, 640 x 480 or
  // 1024 x 768 px; 10, 16 or 100 images.
  RenderedSet Room(int case_idx) const;
  RenderedSet Table(int case_idx) const;
  // "room_1", ...
  std::vector<std::string> RoomNames() const;

 private:
  RenderedSet Make(const std::string& preset, uint64_t seed, bool maps) const;
  std::filesystem::path Folder() const;

  PaperBenchOptions options_;
  std::optional<TemporaryPath> temporary_;
};

// The cameras where they truly are with the points that the database's matches give there.
Reconstruction TriangulateOnTruth(const RenderedSet& set);

// As `holba map` with a structure and known intrinsics, which are held; the largest model.
// `others`: further options of map.
Reconstruction MapSet(const RenderedSet& set, const std::string& structure,
                      const OptionTexts& others);

// As `holba refine` with options of it, intrinsics held. Images are the database's.
Reconstruction RefineOnSet(const RenderedSet& set, const Reconstruction& posed,
                           const OptionTexts& options);

// Percent, of all pairs of true images.
std::vector<double> AucsOf(const Reconstruction& model, const Reconstruction& truth,
                           const std::vector<double>& thresholds_deg);

// "NAME @T UNIT" for each threshold.
std::vector<SeedMeasure> MeasuresAt(std::string_view name, const std::vector<double>& thresholds,
                                    std::string_view unit, BetterIs better);

// Points spread evenly over the triangles, `spacing` apart about: a scan of a surface.
std::vector<Eigen::Vector3d> ScanOfMesh(const std::filesystem::path& mesh_path, double spacing);

}  // namespace holba
