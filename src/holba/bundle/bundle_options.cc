// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/bundle_options.h"

#include "holba/base/check.h"
#include "holba/scene/reconstruction.h"

namespace holba {
namespace {

struct FamilyText {
  TermFamily family;
  const char* name;
  const char* unit;  // suffix of the scale
  const char* what;
};
constexpr FamilyText kFamilies[] = {
    {TermFamily::kPoint, "point", "_px", "points"},
    {TermFamily::kLine, "line", "_px", "lines"},
    {TermFamily::kGroup, "group", "_px", "members of planes and primitives"},
    {TermFamily::kVp, "vp", "_sine", "lines of a vanishing point (sine of the angle)"},
    {TermFamily::kWireframe, "wireframe", "_px", "point-line incidences"},
    {TermFamily::kRelation, "relation", "_sine",
     "relations between groups (sine or cosine of the angle)"},
    {TermFamily::kMeasurement, "measurement", "_sigmas",
     "2D measurements of groups (in their standard deviations)"},
};

}  // namespace

TermFamily FamilyOf(std::string_view term) {
  for (const Term& known : kTerms) {
    if (known.name == term) return known.family;
  }
  FailCheck(__FILE__, __LINE__, "a term of the table", std::string(term));
}

void BundleOptions::SetDefaultLosses(bool is_bal) {
  for (TermFamily family : {TermFamily::kPoint, TermFamily::kLine}) {
    TermSettings& settings = (*this)[family];
    if (!settings.loss) settings.loss = is_bal ? LossChoice::kTrivial : LossChoice::kAuto;
  }
  for (TermSettings& settings : terms) {
    if (!settings.loss) settings.loss = LossChoice::kCauchy;
  }
}

void BundleOptions::HoldCameras() {
  fix_poses = true;
  refine_focal_length = refine_principal_point = refine_extra_params = false;
}

void BundleOptions::RememberPrincipalPoints(const Reconstruction& model) {
  for (const auto& [id, camera] : model.cameras) {
    const auto idxs = camera.model->principal_point_idxs;
    known_principal_points_px.try_emplace(
        id, Eigen::Vector2d(camera.params[idxs[0]], camera.params[idxs[1]]));
  }
}

void BundleOptions::RestorePrincipalPoints(Reconstruction* model) const {
  for (auto& [id, camera] : model->cameras) {
    const Eigen::Vector2d& known_px = known_principal_points_px.at(id);
    for (int k = 0; k < 2; ++k) camera.params[camera.model->principal_point_idxs[k]] = known_px[k];
  }
}

void BundleOptions::Describe(OptionTable* table) const {
  table->Section("Bundle");
  table
      ->Choice("config", &config,
               {{"point", BundleConfig::kPoint},
                {"point_line", BundleConfig::kPointLine},
                {"groups", BundleConfig::kGroups},
                {"holistic", BundleConfig::kHolistic}},
               "What takes part; each adds to the one before: lines; groups and relations; "
               "wireframe.")
      .Basic();
  for (const FamilyText& text : kFamilies) {
    const TermSettings& settings = (*this)[text.family];
    const std::string name = text.name, what = text.what;
    std::vector<std::pair<std::string, std::optional<LossChoice>>> losses = {
        {"trivial", LossChoice::kTrivial},
        {"huber", LossChoice::kHuber},
        {"soft_l1", LossChoice::kSoftL1},
        {"cauchy", LossChoice::kCauchy},
        {"auto", LossChoice::kAuto}};
    std::string sentence = "Robust loss of the residuals of " + what +
                           "; auto: Cauchy at auto_num_sigmas measured standard deviations";
    if (!settings.loss) {
      losses.insert(losses.begin(), {"default", std::nullopt});
      sentence += "; default: auto, but trivial for BAL problems";
    }
    table->Choice(name + "_loss", &settings.loss, losses, sentence + ".");
    table->Field(
        name + "_loss_scale" + text.unit, &settings.loss_scale, GreaterThan(0),
        "Residual norm at which that loss departs from the square (auto measures its own).");
    table->Field(name + "_weight", &settings.weight, AtLeast(0),
                 "Factor on the robustified cost of " + what + ".");
  }
  table->Field("auto_num_sigmas", &auto_num_sigmas, GreaterThan(0),
               "Scale of the loss auto, in robust standard deviations of the term's residuals.");
  table->Field("auto_min_scale_px", &auto_min_scale_px, GreaterThan(0),
               "Smallest scale of the loss auto, pixels.");
  table->Field("gate", &gate,
               "Whether members of groups and incidences that contradict the features as seen are "
               "left out.");
  table->Field("gate_rounds", &gate_rounds, Between(1, 10),
               "Rounds of testing associations and adjusting.");
  table->Field("gate_confidence", &gate_confidence, Between(0.5, 0.999999),
               "Share of the right associations that passes a test.");
  table->Field(
      "choose_weights", &choose_weights,
      "Whether points that are left out choose how much lines and structure move the cameras; "
      "else their weights are as given.");
  table->Field("refine_focal_length", &refine_focal_length, "Whether focal lengths are adjusted.")
      .Basic();
  table
      ->Field("refine_principal_point", &refine_principal_point,
              "Whether principal points are adjusted.")
      .Basic();
  table->Field(
      "principal_point_sigma", &principal_point_sigma, AtLeast(0),
      "Standard deviation of a principal point that is adjusted from where it stands, by the "
      "width and the height of the image; 0: it is free.");
  table
      ->Field("refine_extra_params", &refine_extra_params,
              "Whether distortion parameters are adjusted.")
      .Basic();
  table->Field("share_cameras", &share_cameras,
               "Whether cameras of one lens model and size become one, unless points that are left "
               "out are predicted better with several.");
  table->Choice(
      "camera_model", &camera_model,
      {{"given", CameraModelSource::kGiven}, {"auto", CameraModelSource::kAuto}},
      "Lens model of cameras; auto: a richer one than given (OPENCV, RADIAL, FULL_OPENCV, "
      "OPENCV_FISHEYE) where points that are left out are predicted better with it.");
  table
      ->Field("refine_sensor_from_rig", &refine_sensor_from_rig,
              "Whether poses of sensors in their rig are adjusted, the reference sensor's "
              "excepted; one that sees too little stays, and all do where poses are held.")
      .Basic();
  table
      ->Field("fix_poses", &fix_poses,
              "Whether camera poses are held, those of sensors in their rigs included.")
      .Basic();
  table->Field("fix_points", &fix_points, "Whether points are held.");
  table->Field("fix_lines", &fix_lines, "Whether lines are held.");
  table->Field("fix_groups", &fix_groups,
               "Whether vanishing points, planes and primitives are held.");
  table->Choice(
      "gauge", &gauge, {{"two_cams", Gauge::kTwoCams}, {"free", Gauge::kFree}},
      "What fixes position, orientation and scale: two cameras as in COLMAP, or nothing.");
  table->Field("refit_others", &refit_others,
               "Whether features and groups outside the configuration are estimated afterwards "
               "with the rest held.");
  table->Choice(
      "group_form", &group_form, {{"2d", StructureForm::k2d}, {"3d", StructureForm::k3d}},
      "Residuals of group members: pixels (2d), or distances in model units for comparison (3d).");
  table->Field("group_3d_weight", &group_3d_weight, AtLeast(0),
               "Weight of the 3d form of group members.");
  table->Choice(
      "wireframe_form", &wireframe_form, {{"2d", StructureForm::k2d}, {"3d", StructureForm::k3d}},
      "Residuals of incidences: pixels (2d), or point-line distances for comparison (3d).");
  table->Field("wireframe_3d_weight", &wireframe_3d_weight, AtLeast(0),
               "Weight of the 3d form of incidences.");
}

uint32_t FreeIntrinsics(const CameraModel& model, const BundleOptions& options) {
  uint32_t free = 0;
  const auto release = [&](std::span<const int> idxs) {
    for (int idx : idxs) free |= uint32_t{1} << idx;
  };
  if (options.refine_focal_length) release(model.focal_idxs);
  if (options.refine_principal_point) release(model.principal_point_idxs);
  if (options.refine_extra_params) release(model.extra_idxs);
  return free;
}

}  // namespace holba
