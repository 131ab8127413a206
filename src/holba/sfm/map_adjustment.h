// SPDX-License-Identifier: BSD-3-Clause
// Adjustments of a growing model: around a new image, and of all of it, each followed by what
// better poses allow (tracks completed and merged) and forbid (observations filtered).
#pragma once

#include <cstddef>
#include <vector>

#include "holba/bundle/adjust_local.h"
#include "holba/bundle/bundle_options.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/sfm/mapper_options.h"
#include "holba/sfm/mapper_state.h"
#include "holba/solver/solver.h"

namespace holba {

// Of all adjustments of one kind; the paper's runtime table.
struct AdjustmentCounts {
  size_t num_adjustments = 0, num_iterations = 0;
  double seconds = 0.0;  // building, solving, writing back
  // Of iterations: the first ones, with the analysis of the problem, and the others.
  double first_iteration_seconds = 0.0, later_iteration_seconds = 0.0;

  void Add(const SolverSummary& solver, double seconds_of_all);
};

struct AdjustmentReport {
  AdjustmentCounts local, global;
  size_t num_filtered = 0, num_completed = 0, num_merged = 0, num_retriangulated = 0;
  size_t num_lines_filtered = 0, num_lines_merged = 0, num_lines_continued = 0;
  double group_seconds = 0.0;      // of groups made anew
  size_t num_held_intrinsics = 0;  // adjustments that would have made a camera no lens is
};

// Carries what adjustments share from one to the next.
class MapAdjuster {
 public:
  MapAdjuster(const MapperOptions& options, const SolverOptions& solver, MapperState* state);

  // The images with those that see most of the same points at sufficient angles, what they see, and
  // held what else sees that. Intrinsics move where all images of the camera are among them.
  void AdjustAround(const std::vector<image_t>& image_ids);
  // Everything. Returns images that lost their pose. `is_last`: until hardly an observation
  // changes; else a few rounds, for the next image changes more.
  std::vector<image_t> AdjustAll(bool is_last);
  // Once, of all, without what follows: after the first pair.
  void AdjustOnce();

  // Whether the model has grown so much since the last AdjustAll that it is due; never while all of
  // it fits into an adjustment around an image.
  bool IsGlobalDue() const;
  bool IsGlobalDone() const;  // nothing was registered since

  const AdjustmentReport& report() const { return report_; }

  // Snapshots (snapshot_archive.h).
  template <typename Archive>
  void Visit(Archive* archive) {
    (*archive)(report_, loss_scale_px_, line_loss_scale_px_, frames_at_global_, points_at_global_,
               frames_at_groups_, frames_at_cameras_);
  }

 private:
  BundleOptions Bundle() const;
  std::vector<image_t> ImagesAround(const std::vector<image_t>& image_ids) const;
  void FreeIntrinsicsOf(BundleSelection* selection, const BundleOptions& bundle) const;
  void HoldExisting(BundleSelection* selection, const BundleOptions& bundle) const;
  // Solves; where that makes intrinsics which no lens has, again without moving these.
  LocalSummary Adjust(const BundleOptions& bundle, const SolverOptions& solver,
                      BundleSelection* selection);
  bool HasLines() const { return options_.structure >= MapperStructure::kLines; }
  // Lines as their images have them after an adjustment; returns how many observations changed.
  size_t UpdateLines(const std::vector<image_t>& image_ids, std::vector<line3D_t> line_ids);
  void MeasureNoise();
  size_t NumObservations() const;

  const MapperOptions& options_;
  SolverOptions local_solver_, global_solver_;
  MapperState& state_;
  SolverWorkspace workspace_;
  AdjustmentReport report_;
  // Scale of the points' loss, px: two robust standard deviations of their residuals.
  double loss_scale_px_ = 1.0, line_loss_scale_px_ = 1.0;
  size_t frames_at_global_ = 0, points_at_global_ = 0, frames_at_groups_ = 0;
  size_t frames_at_cameras_ = 0;
};

}  // namespace holba
