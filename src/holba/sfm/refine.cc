// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/refine.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "holba/base/progress.h"
#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_selection.h"
#include "holba/bundle/followers.h"
#include "holba/bundle/intrinsics_choice.h"
#include "holba/scene/local_frame.h"
#include "holba/scene/selection.h"

namespace holba {
namespace {

// Standard deviation of a term's residuals at the model, px; `otherwise` where there are none.
double SigmaPx(const BundleSummary& summary, const std::string& term, double otherwise) {
  const auto it = summary.auto_sigmas.find(term);
  return it != summary.auto_sigmas.end() && it->second > 0.0 ? it->second : otherwise;
}

// One run of RefineModel.
class Refiner {
 public:
  Refiner(const RefineOptions& options, const ImageFeatureMap& features, Reconstruction* model,
          const std::function<void(const std::string&)>& log)
      : options_(options), features_(features), model_(*model), log_(log) {
    options_.structure.SetNumThreads(options.solver.num_threads);
    bundle_ = options.bundle;
    if (options.fix_poses) bundle_.HoldCameras();
    bundle_.RememberPrincipalPoints(model_);
  }

  RefineReport Run(const LineMatcher& match_lines, const RegionObserver& observe_regions) {
    const Timer timer;
    // Points, matches, structure; of each round what is reliable, two adjustments, associations.
    Progress progress("Refining", "steps", 3 + 4 * static_cast<size_t>(options_.num_rounds));
    progress.Update(0);
    RemoveStructure(&model_);
    AdjustPoints();
    progress.Advance();
    const double points_seconds = timer.Seconds();
    if (bundle_.config == BundleConfig::kPoint) {
      report_.stage1 = report_.points_alone;
      report_.stage1_options = bundle_;
      UpdateErrors(&model_);
      report_.adjust_seconds = points_seconds;
      return std::move(report_);
    }

    const LineMatchMap matches = match_lines(model_);
    progress.Advance();
    const Timer structure_timer;
    report_.structure = BuildStructure(options_.structure, features_, &matches, observe_regions,
                                       options_.solver.num_threads, &model_);
    report_.structure_seconds = structure_timer.Seconds();
    progress.Advance();

    const Timer adjust_timer;
    for (int round = 0; round < options_.num_rounds; ++round) {
      Classify();
      progress.Advance();
      Stage1(round + 1 == options_.num_rounds);
      progress.Advance();
      Stage2();
      progress.Advance();
      const std::map<group3D_t, std::vector<double>> adjusted = GroupParams();
      UpdateAssociations(options_.structure, &model_, &report_.structure);
      // Members are judged by fits to points and lines; what is written is the adjustment's.
      if (round + 1 == options_.num_rounds) SetGroupParams(adjusted);
      progress.Advance();
    }
    Classify();
    report_.stage1_options = bundle_;
    FormGroupObservations();
    UpdateErrors(&model_);
    report_.adjust_seconds = points_seconds + adjust_timer.Seconds();
    return std::move(report_);
  }

 private:
  void Log(const std::string& text) const {
    if (log_) log_(text);
  }

  // Structure is worth most on good poses; COLMAP's follow the few wrong observations.
  void AdjustPoints() {
    BundleOptions options = bundle_;
    options.config = BundleConfig::kPoint;
    options.refit_others = false;
    // The given points were not: COLMAP's own last adjustment follows what is wrong.
    options.auto_start_multiple = BundleOptions().auto_start_multiple;
    if (!options_.fix_poses) ChooseCameras(options);
    options.share_cameras = bundle_.share_cameras = false;
    options.camera_model = bundle_.camera_model = CameraModelSource::kGiven;
    const Reconstruction given = model_;
    report_.points_alone = AdjustBundle(options, options_.solver, &model_);
    known_sigmas_ = report_.points_alone.auto_sigmas;
    if (bundle_.refine_principal_point && !bundle_.fix_poses) ChoosePrincipalPoints(options, given);
    Log(fmt::format("Points alone: standard deviation of a coordinate {:.3f} px",
                    SigmaPx(report_.points_alone, "point", 0.0)));
  }

  // Which cameras are one, and of which lens models they are.
  void ChooseCameras(const BundleOptions& options) {
    if (options.share_cameras)
      report_.shared_cameras = ShareCameras(options, options_.solver, {}, log_, &model_);
    if (options.camera_model == CameraModelSource::kAuto)
      report_.camera_models = ChooseCameraModels(options, options_.solver, {}, log_, &model_);
  }

  // Principal points stay where they do harm: on a walk straight ahead they trade for the direction
  // of the walk.
  void ChoosePrincipalPoints(const BundleOptions& options, const Reconstruction& given) {
    BundleOptions holding = options;
    holding.refine_principal_point = false;
    Reconstruction held = given;
    bundle_.RestorePrincipalPoints(&held);  // a lens model may have been chosen with others
    const BundleSummary summary =
        AdjustBundle(holding, options_.solver, &held, {}, {}, known_sigmas_);
    report_.principal_point =
        ComparePredictions({options, model_}, {holding, held}, known_sigmas_, options_.solver);
    const PairedMean& difference = *report_.principal_point;
    report_.principal_point_held = difference.mean > kMaxLossErrors * difference.standard_error ||
                                   !PrincipalPointsArePlausible();
    Log(fmt::format(
        "Points left out cost {:+.4f} +- {:.4f} with principal points adjusted: these {}",
        difference.mean, difference.standard_error,
        report_.principal_point_held ? "stay" : "move"));
    if (!report_.principal_point_held) return;
    bundle_.refine_principal_point = false;
    model_ = std::move(held);
    report_.points_alone = summary;
    known_sigmas_ = summary.auto_sigmas;
  }

  // Within three standard deviations of what is known: beyond, the coordinates fit something else
  // that the camera model lacks, which points that are seen by the same cameras share.
  bool PrincipalPointsArePlausible() const {
    if (!(bundle_.principal_point_sigma > 0.0)) return true;
    return std::all_of(model_.cameras.begin(), model_.cameras.end(), [&](const auto& entry) {
      const auto& [id, camera] = entry;
      const auto idxs = camera.model->principal_point_idxs;
      const Eigen::Vector2d now(camera.params[idxs[0]], camera.params[idxs[1]]);
      const Eigen::Vector2d size(static_cast<double>(camera.width),
                                 static_cast<double>(camera.height));
      const Eigen::Vector2d sigma = bundle_.principal_point_sigma * size;
      const Eigen::Vector2d moved =
          (now - bundle_.known_principal_points_px.at(id)).cwiseQuotient(sigma);
      return moved.lpNorm<Eigen::Infinity>() <= kMaxPrincipalPointSigmas;
    });
  }

  void Classify() {
    const BundleSummary& last =
        report_.stage1.auto_sigmas.empty() ? report_.points_alone : report_.stage1;
    const double point_sigma_px = SigmaPx(last, "point", 1.0);
    report_.reliability = ClassifyFeatures(options_.reliability, point_sigma_px,
                                           SigmaPx(last, "line", options_.structure.lines.sigma_px),
                                           options_.solver.num_threads, model_);
    Log(fmt::format("Uncertain: {} of {} points, {} of {} lines",
                    report_.reliability.unreliable_points.size(), model_.points3D.size(),
                    report_.reliability.unreliable_lines.size(), model_.lines3D.size()));
  }

  // Cameras, reliable features, groups, wireframe. Only the last one has to converge.
  void Stage1(bool is_last) {
    SolverOptions solver = options_.solver;
    if (!is_last) solver.function_tolerance = std::max(solver.function_tolerance, kRoundTolerance);
    const Reliability& reliability = report_.reliability;
    // Structure that is tested again is not worth choosing for.
    BundleOptions bundle = bundle_;
    bundle.choose_weights &= is_last;
    // What a single image sees is in neither stage and follows the cameras of this one.
    const Followers followers(model_, PointsSeenOnce(model_), LinesSeenOnce(model_));
    // Groups with too little active support would be free to go anywhere.
    const BundleSelection part = BundleSelection::OfFeatures(
        model_, bundle_, [&](point3D_t id) { return !reliability.unreliable_points.contains(id); },
        [&](line3D_t id) { return !reliability.unreliable_lines.contains(id); }, kMinSupport);
    report_.stage1 = AdjustBundle(bundle, solver, part, &model_, {}, log_, known_sigmas_);
    followers.Place(&model_);
    known_sigmas_ = report_.stage1.auto_sigmas;
    Reject(report_.stage1.filter);
  }

  // Unreliable features on the cameras and groups as they are.
  void Stage2() {
    const Reliability& reliability = report_.reliability;
    if (reliability.unreliable_points.empty() && reliability.unreliable_lines.empty()) return;
    BundleOptions options = bundle_;
    options.HoldCameras();
    options.fix_groups = true;
    // A group without members is no group.
    const BundleSelection part = BundleSelection::OfFeatures(
        model_, options, [&](point3D_t id) { return reliability.unreliable_points.contains(id); },
        [&](line3D_t id) { return reliability.unreliable_lines.contains(id); }, 1);
    report_.stage2 = AdjustBundle(options, options_.solver, part, &model_, {}, log_, known_sigmas_);
    AssociationFilter filter = report_.stage2.filter;
    // The group is judged by its reliable members, in stage 1.
    filter.groups.clear();
    Reject(filter);
  }

  std::map<group3D_t, std::vector<double>> GroupParams() const {
    std::map<group3D_t, std::vector<double>> params;
    for (const auto& [id, group] : model_.groups3D) params[id] = group.params;
    return params;
  }
  void SetGroupParams(const std::map<group3D_t, std::vector<double>>& params) {
    for (auto& [id, group] : model_.groups3D) {
      const auto known = params.find(id);
      if (known != params.end()) group.params = known->second;
    }
  }

  // Takes associations that failed their tests out of the model.
  void Reject(const AssociationFilter& filter) {
    const auto rejects = [&](const char* kind, const Group3D& group, bool is_rejected) {
      if (is_rejected) ++report_.rejected[std::string(group.type->name) + kind];
      return is_rejected;
    };
    model_.DeleteMembers(
        [&](group3D_t id, const Group3D& group, point3D_t p) {
          return rejects(" points", group, filter.points.contains({id, p}));
        },
        [&](group3D_t id, const Group3D& group, line3D_t l) {
          return rejects(" lines", group, filter.lines.contains({id, l}));
        });
    report_.rejected["wireframe edges"] += model_.DeleteEdges([&](const WireframeEdge& edge) {
      return filter.edges.contains({edge.point3D_id, edge.line3D_id});
    });
    if (filter.groups.empty()) return;
    for (group3D_t id : filter.groups) {
      const Group3D* group = model_.groups3D.Find(id);
      if (group) ++report_.rejected[std::string(group->type->name) + " groups"];
    }
    model_.DeleteGroups3D([&](group3D_t id, const Group3D&) { return filter.groups.contains(id); });
  }

  void FormGroupObservations() {
    std::erase_if(report_.rejected, [](const auto& entry) { return entry.second == 0; });
    ObserveGroups(&model_);
  }

  static constexpr double kRoundTolerance = 1e-4;
  static constexpr double kMaxPrincipalPointSigmas = 3.0;
  // By so many standard errors freer intrinsics may predict worse: it is rather the lens model that
  // fails there, for no camera has its principal point just in the middle (its prior says 2 % of
  // the width). Two are reached by chance on a set of eight photographs.
  static constexpr double kMaxLossErrors = 3.0;
  // Members that a group needs to take part in stage 1.
  static constexpr size_t kMinSupport = 3;

  RefineOptions options_;
  const ImageFeatureMap& features_;
  Reconstruction& model_;
  const std::function<void(const std::string&)>& log_;
  BundleOptions bundle_;
  NoiseSigmas known_sigmas_;  // of the last adjustment of points and lines that move cameras
  RefineReport report_;
};

}  // namespace

RefineOptions::RefineOptions() {
  // Gated associations bear strong weights (docs/adjust.md).
  bundle[TermFamily::kGroup].weight = 5.0;
  bundle[TermFamily::kWireframe].weight = 0.1;
  // Lines, junctions and corners were fitted robustly when they were made.
  bundle.auto_start_multiple = 3.0;
  // The rounds of refine test again what these have tested.
  bundle.gate_rounds = 2;
  // COLMAP holds it at the middle of the image, where it is not: with the loss `auto` it is
  // determined, and poses and focal length gain far more than structure could give them.
  bundle.refine_principal_point = true;
  // Makers of lenses and sensors place it within 1 to 2 % of the width; what images say of it they
  // say more surely than that, or not at all (walks straight ahead).
  bundle.principal_point_sigma = 0.02;
  // COLMAP's default, SIMPLE_RADIAL, is less than many lenses are.
  bundle.camera_model = CameraModelSource::kAuto;
  // COLMAP gives each photograph without EXIF a camera of its own.
  bundle.share_cameras = true;
}

void RefineOptions::Describe(OptionTable* table) const {
  table->Section("Refine");
  table->Field("fix_poses", &fix_poses, "Whether poses and intrinsics stay as they are.").Basic();
  table
      ->Field("num_rounds", &num_rounds, Between(1, 10),
              "Rounds of adjusting (reliable features with cameras, then the others) and "
              "estimating associations anew.")
      .Basic();
  structure.Describe(table);
  reliability.Describe(table);
  bundle.Describe(table);
  solver.Describe(table);
}

RefineReport RefineModel(const RefineOptions& options, const ImageFeatureMap& features,
                         const LineMatcher& match_lines, const RegionObserver& observe_regions,
                         Reconstruction* model,
                         const std::function<void(const std::string&)>& log) {
  // Structure is built where numbers are small, too, and whatever the unit is.
  const LocalFrame local(model, FrameUnit(options.bundle));
  return Refiner(options, features, model, log).Run(match_lines, observe_regions);
}

}  // namespace holba
