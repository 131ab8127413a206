// SPDX-License-Identifier: BSD-3-Clause
// What takes part in an adjustment, with which weights and losses: the one table of both.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/options.h"
#include "holba/camera/camera_model.h"
#include "holba/problem/loss.h"
#include "holba/scene/types.h"

namespace holba {

class Reconstruction;

// The paper's configurations: each adds to the one before.
enum class BundleConfig { kPoint, kPointLine, kGroups, kHolistic };
// 2D: reprojection errors in pixels (the method). 3D: distances in model units, for comparison
// only.
enum class StructureForm { k2d, k3d };
// kTwoCams, as in COLMAP: the first frame is held, and of the frame farthest from it the
// translation coordinate that fixes the scale. Held points, frames, lines and groups and the
// baseline of a rig fix a part of the gauge; then only the rest is held (gauge.h). kFree: nothing
// is held.
enum class Gauge { kTwoCams, kFree };
// Whether richer lens models are tried (camera_model_choice.h).
enum class CameraModelSource { kGiven, kAuto };
enum class LossChoice { kTrivial, kHuber, kSoftL1, kCauchy, kAuto };

// Terms that share a weight and a loss.
enum class TermFamily { kPoint, kLine, kGroup, kVp, kWireframe, kRelation, kMeasurement, kPrior };
inline constexpr int kNumTermFamilies = 8;
// The terms of FORMAT.md, in its order, then those beside it: measurements of groups, points that
// were made from structure or with it (IsOfStructure: they have a noise of their own, by which they
// are weighed where the loss is `auto`; and like lines they are compared with the points alone),
// and the 3D forms.
struct Term {
  std::string_view name;
  TermFamily family;
  bool in_format;
};
inline constexpr Term kTerms[] = {
    {"point", TermFamily::kPoint, true},
    {"line", TermFamily::kLine, true},
    {"group_point", TermFamily::kGroup, true},
    {"group_line", TermFamily::kGroup, true},
    {"vp", TermFamily::kVp, true},
    {"wireframe_point", TermFamily::kWireframe, true},
    {"wireframe_line", TermFamily::kWireframe, true},
    {"relation", TermFamily::kRelation, true},
    {"group_measurement", TermFamily::kMeasurement, false},
    {"structure_point", TermFamily::kPoint, false},
    {"principal_point_prior", TermFamily::kPrior, false},
    {"group_point_3d", TermFamily::kGroup, false},
    {"group_line_3d", TermFamily::kGroup, false},
    {"wireframe_3d", TermFamily::kWireframe, false},
};
// The name must be one of the table.
TermFamily FamilyOf(std::string_view term);
// Residuals without unit (sines of angles, standard deviations) instead of pixels.
constexpr bool IsAngular(TermFamily family) {
  return family == TermFamily::kVp || family == TermFamily::kRelation ||
         family == TermFamily::kMeasurement || family == TermFamily::kPrior;
}

struct TermSettings {
  // Empty: auto for points and lines of models, trivial for BAL problems, Cauchy for the others.
  std::optional<LossChoice> loss;
  double loss_scale = 1.0;  // in the residual's unit: px, or the sine of an angle
  double weight = 1.0;      // multiplies the robustified cost
};

struct BundleOptions {
  BundleConfig config = BundleConfig::kHolistic;

  // By TermFamily. Weights and losses of the paper, appendix "Balancing Different Types of Costs".
  std::array<TermSettings, kNumTermFamilies> terms = {{
      {std::nullopt, 1.0, 1.0},          // point
      {std::nullopt, 1.0, 1.0},          // line
      {LossChoice::kCauchy, 1.0, 0.5},   // group_point, group_line
      {LossChoice::kCauchy, 0.2, 5e3},   // vp
      {LossChoice::kCauchy, 1.0, 0.1},   // wireframe_point, wireframe_line
      {LossChoice::kCauchy, 0.2, 5e3},   // relation
      {LossChoice::kCauchy, 3.0, 1.0},   // group_measurement, in its own standard deviations
      {LossChoice::kTrivial, 1.0, 1.0},  // priors, in theirs
  }};
  // The loss `auto`: Cauchy at this many robust standard deviations of the term's residuals.
  double auto_num_sigmas = 2.0;
  // Smallest scale of the loss `auto`, pixels: no feature is localised better, whatever its
  // residuals say.
  double auto_min_scale_px = 0.05;

  // The annealing of the loss `auto` starts at this multiple of the goal, and the scale halves:
  // wide enough that observations which are wrong at the start only still count.
  double auto_start_multiple = 8.0;

  // Associations that contradict the features as seen take no part (association_gate.h), tested
  // anew in each round.
  bool gate = true;
  int gate_rounds = 3;
  double gate_confidence = 0.99;  // share of the right associations that passes
  // How much lines and structure move the cameras is chosen: by factors on their weights, or not at
  // all, whichever makes cameras that predict points best which the adjustment did not see
  // (weight_choice.h).
  bool choose_weights = true;

  bool refine_focal_length = true;
  bool refine_principal_point = false;
  // Standard deviation of what is known of a principal point that moves, by the width of the image
  // in x and its height in y; 0: nothing is. Known is where it stands, or what
  // known_principal_points_px has.
  double principal_point_sigma = 0.0;
  std::map<camera_t, Eigen::Vector2d> known_principal_points_px;
  bool refine_extra_params = true;
  // Cameras of one model and size become one unless points that are left out are predicted better
  // with several. Only where whole models are adjusted, as the next.
  bool share_cameras = false;
  // kAuto: cameras get a richer lens model where points that are left out are predicted better with
  // it.
  CameraModelSource camera_model = CameraModelSource::kGiven;
  // Poses of the sensors of a rig in it (but of the reference), where poses are not held.
  bool refine_sensor_from_rig = true;
  bool fix_poses = false;
  bool fix_points = false;
  bool fix_lines = false;
  bool fix_groups = false;
  Gauge gauge = Gauge::kTwoCams;
  // Features and groups outside the configuration are estimated afterwards, with all that was
  // adjusted held.
  bool refit_others = true;

  StructureForm group_form = StructureForm::k2d;
  double group_3d_weight = 100.0;
  StructureForm wireframe_form = StructureForm::k2d;
  double wireframe_3d_weight = 100.0;

  TermSettings& operator[](TermFamily family) { return terms[static_cast<size_t>(family)]; }
  const TermSettings& operator[](TermFamily family) const {
    return terms[static_cast<size_t>(family)];
  }
  // Poses and intrinsics stay as they are.
  void HoldCameras();
  // What is known of the principal points of cameras is where they stand now, if nothing is yet.
  void RememberPrincipalPoints(const Reconstruction& model);
  // Puts them there. All must be remembered.
  void RestorePrincipalPoints(Reconstruction* model) const;
  // The choice of a family for a model (or, `is_bal`, a BAL problem).
  void SetDefaultLosses(bool is_bal);
  void Describe(OptionTable* table) const;
};

// Bit i: parameter i of a camera model moves if the intrinsics are not held.
uint32_t FreeIntrinsics(const CameraModel& model, const BundleOptions& options);

// A direction of a group measured in one image, in the camera frame: the ray of a vanishing point,
// or a plane's normal.
struct GroupMeasurement {
  image_t image_id = kInvalidId32;
  group3D_t group3D_id = kNoId;
  Eigen::Vector3d direction_in_cam = Eigen::Vector3d::UnitZ();  // unit; the sign does not matter
  double sigma_deg = 1.0;
};

}  // namespace holba
