// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/weight_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <unordered_set>
#include <utility>

#include "holba/bundle/bundle_problem.h"

namespace holba {
namespace {

// Fewer tracks left out say nothing, and an image with fewer verified points needs the others:
// COLMAP's least number of observations that hold an image.
constexpr size_t kMinTracks = 30;
constexpr size_t kMinVerified = 30;
// Costs of single tracks differ by a tenth or so between two cameras; the mean of so many is known
// to a thousandth or two, which is what weights differ by. Large models are done with a fold.
constexpr size_t kEnoughTracks = 4000;
// Below so many, means are known to a hundredth or two at best, and the lowest is chance: weights
// as given, which follow the measured noise, stay unless others are better by two standard errors.
constexpr size_t kEnoughToRank = 400;
constexpr double kSureErrors = 2.0;
// Weights differ by factors of four: standard deviations by two.
constexpr double kWeightStep = 4.0;
// Steps of an adjustment of a fold. The first, which are not judged, have to forget what is left
// out; then each trial starts near the optimum of other weights, and after two steps their order is
// that of the optima.
constexpr int kFirstIterations = 6;
constexpr int kNextIterations = 2;

// A model with more frames is judged by a part of it: weights are about the noise of observations,
// which is the same in all of it, and the choice then costs what the part does.
constexpr size_t kMaxFrames = 60;
// Members that a group needs in the part.
constexpr size_t kMinMembersInPart = 3;

// kMaxFrames images that share many points: each shares the most with those before it.
std::vector<image_t> ImagesOfPart(const Reconstruction& model, const BundleSelection& selection) {
  const auto images = ImagesOf(model, selection);
  FlatIndex image_idx(images.size());
  for (const auto& [id, image] : images) image_idx.Add(id);
  std::vector<size_t> num_shared(images.size());
  std::vector<bool> is_in(images.size());
  std::vector<image_t> part;
  size_t next = 0;
  for (size_t i = 0; i < images.size(); ++i) {
    const auto count = [&](size_t k) { return images[k].second->points2D.size(); };
    if (count(i) > count(next)) next = i;
  }
  while (part.size() < kMaxFrames) {
    is_in[next] = true;
    part.push_back(images[next].first);
    for (const Point2D& point2D : images[next].second->points2D) {
      const Point3D* point = model.points3D.Find(point2D.point3D_id);
      if (point == nullptr) continue;
      for (const PointObservation& o : point->track) {
        const uint32_t idx = image_idx.Find(o.image_id);
        if (idx != FlatIndex::kNone) ++num_shared[idx];
      }
    }
    size_t best = images.size();
    for (size_t i = 0; i < images.size(); ++i) {
      if (!is_in[i] && num_shared[i] > 0 &&
          (best == images.size() || num_shared[i] > num_shared[best]))
        best = i;
    }
    if (best == images.size()) break;
    next = best;
  }
  return part;
}

BundleSelection PartToJudgeBy(const Reconstruction& model, const BundleOptions& options,
                              const BundleSelection& selection) {
  if (selection.frames.size() <= kMaxFrames) return selection;
  BundleSelection part = BundleSelection::Around(model, options, ImagesOfPart(model, selection),
                                                 {.surroundings = false});
  FlatIndex point_idx(selection.points.size()), line_idx(selection.lines.size());
  for (const auto& point : selection.points) point_idx.Add(point.id);
  for (const auto& line : selection.lines) line_idx.Add(line.id);
  std::erase_if(part.points, [&](const auto& point) { return !point_idx.contains(point.id); });
  std::erase_if(part.lines, [&](const auto& line) { return !line_idx.contains(line.id); });
  std::erase_if(part.groups, [&](const SelectedGroup& group) {
    return group.point3D_ids.size() + group.line3D_ids.size() < kMinMembersInPart;
  });
  // Around holds those of which it has not all members, as the rest of the model stays. Here a held
  // group would tell a fold of what it has not seen.
  for (SelectedGroup& group : part.groups) group.constant = options.fix_groups;
  part.SetGauges(ChooseGaugesOfParts(model, options, part));
  return part;
}

// One choice: the folds, and what each trial's cameras predict.
class Chooser {
 public:
  Chooser(const FoldAdjustment& adjustment, Reconstruction* model)
      : adjustment_(adjustment),
        model_(*model),
        selection_(PartToJudgeBy(*model, adjustment.options, adjustment.selection)),
        base_(Build(adjustment.options, selection_)),
        held_out_(*model, selection_) {
    while (num_folds_ < HeldOutPoints::kNumFolds && choice_.num_tracks < kEnoughTracks)
      choice_.num_tracks += held_out_.NumJudged(num_folds_++);
  }

  WeightChoice Choose() {
    if (choice_.num_tracks < kMinTracks) return {};
    ChoosePairs();
    TryDiagonal();
    if (!best_.weights.points_alone) TryFamilies();
    if (stopped_) return {};
    if (IsSurelyLower(best_costs_, as_given_)) choice_.weights = best_.weights;
    return std::move(choice_);
  }

 private:
  using Costs = std::vector<double>;

  BundleProblem Build(const BundleOptions& options, const BundleSelection& selection) const {
    return BuildProblem(model_, options, selection, adjustment_.measurements, &adjustment_.filter);
  }

  // Of points alone.
  Costs CostsOfPoints(const BundleSelection& selection) {
    BundleOptions points_only = adjustment_.options;
    points_only.config = BundleConfig::kPoint;
    Costs costs;
    for (size_t fold = 0; fold < num_folds_; ++fold) {
      BundleProblem bundle =
          Build(points_only, WithoutPointsOfStructure(model_, held_out_.Without(fold, selection)));
      adjustment_.scales->Begin(bundle.problem);
      Judge(fold, kFirstIterations, &bundle, &costs);
      Finish();
    }
    return costs;
  }

  // Of some weights, each trial of a fold begun where the one before ended, also that of an earlier
  // call.
  std::vector<Costs> CostsOf(const std::vector<StructureWeights>& trials) {
    std::vector<Costs> costs(trials.size());
    const bool is_first = folds_.empty();
    for (size_t fold = 0; fold < num_folds_; ++fold) {
      if (is_first) {
        folds_.push_back(std::make_unique<BundleProblem>(
            Build(adjustment_.options, held_out_.Without(fold, selection_))));
      }
      BundleProblem& bundle = *folds_[fold];
      adjustment_.scales->Begin(bundle.problem);
      if (is_first && !stopped_) stopped_ = !adjustment_.solve(kFirstIterations, &bundle.problem);
      for (size_t i = 0; i < trials.size(); ++i) {
        adjustment_.scales->Weigh(trials[i]);
        Judge(fold, kNextIterations, &bundle, &costs[i]);
      }
      adjustment_.scales->Weigh({});
      Finish();
    }
    return costs;
  }

  void Judge(size_t fold, int num_iterations, BundleProblem* bundle, Costs* costs) {
    if (!stopped_) stopped_ = !adjustment_.solve(num_iterations, &bundle->problem);
    if (stopped_) return;
    WriteBack(*bundle, &model_);
    const Costs found = held_out_.PredictionCosts(fold, model_, adjustment_.point_scale_px,
                                                  adjustment_.num_threads);
    costs->insert(costs->end(), found.begin(), found.end());
  }

  void Finish() {
    adjustment_.scales->Leave();
    WriteBack(base_, &model_);
  }

  // Points alone, with the unverified ones and without.
  void ChoosePairs() {
    of_points_ = CostsOfPoints(selection_);
    const std::vector<point3D_t> unverified = UnverifiedPoints(model_, selection_);
    if (!unverified.empty() && !stopped_) {
      BundleSelection verified = WithoutPoints(selection_, unverified);
      Costs without = CostsOfPoints(verified);
      if (stopped_) return;
      choice_.pairs_from_verified = MeanDifference(of_points_, without);
      if (IsSurelyLower(without, of_points_)) {
        choice_.without_unverified = true;
        selection_ = std::move(verified);
        of_points_ = std::move(without);
      }
    }
    Take({{.points_alone = true}, {}}, of_points_);
  }

  // All structure weighed alike: more or less while that is better.
  void TryDiagonal() {
    const auto all = [](double s) { return StructureWeights{s, s, s}; };
    Try({all(kWeightStep), all(1.0), all(1.0 / kWeightStep)});
    if (best_.weights.points_alone) return;
    for (const double factor : {kWeightStep, 1.0 / kWeightStep}) {
      if (best_.weights.structure == all(factor)) Try({all(factor * factor)});
    }
  }

  // Lines by themselves, and what is made from them, from the best so far.
  void TryFamilies() {
    const StructureWeights best = best_.weights.structure;
    std::vector<StructureWeights> trials;
    for (const double factor : {kWeightStep, 1.0 / kWeightStep}) {
      trials.push_back({factor * best.lines, best.corners, best.groups});
      trials.push_back({best.lines, factor * best.corners, factor * best.groups});
    }
    Try(trials);
  }

  void Try(const std::vector<StructureWeights>& trials) {
    const std::vector<Costs> costs = CostsOf(trials);
    if (stopped_) return;
    for (size_t i = 0; i < trials.size(); ++i) {
      if (trials[i] == StructureWeights()) as_given_ = costs[i];
      Take({{.structure = trials[i]}, MeanDifference(costs[i], of_points_)}, costs[i]);
    }
  }

  void Take(const WeightTrial& trial, const Costs& costs) {
    choice_.trials.push_back(trial);
    if (choice_.trials.size() > 1 && !(trial.from_points.mean < best_.from_points.mean)) return;
    best_ = trial;
    best_costs_ = costs;
  }

  // Lower, and where tracks are few by more than chance.
  bool IsSurelyLower(const Costs& costs, const Costs& than) const {
    const PairedMean difference = MeanDifference(costs, than);
    const double needed = choice_.num_tracks < kEnoughToRank ? kSureErrors : 0.0;
    return difference.mean < -needed * difference.standard_error;
  }

  const FoldAdjustment& adjustment_;
  Reconstruction& model_;
  BundleSelection selection_;
  const BundleProblem base_;
  const HeldOutPoints held_out_;
  size_t num_folds_ = 0;                               // that are judged
  std::vector<std::unique_ptr<BundleProblem>> folds_;  // with structure
  Costs of_points_;
  WeightTrial best_;
  Costs best_costs_, as_given_;
  WeightChoice choice_;
  bool stopped_ = false;
};

}  // namespace

std::string CameraWeights::Text() const {
  if (points_alone) return "points alone";
  return fmt::format("lines x {:g}, corners x {:g}, groups x {:g}", structure.lines,
                     structure.corners, structure.groups);
}

std::vector<point3D_t> UnverifiedPoints(const Reconstruction& model,
                                        const BundleSelection& selection) {
  FlatIndex image_idx;
  for (const auto& [id, image] : ImagesOf(model, selection)) image_idx.Add(id);
  std::vector<size_t> num_verified(image_idx.size());
  const auto for_each_image = [&](const Point3D& point, const auto& visit) {
    for (const PointObservation& o : point.track) {
      const uint32_t idx = image_idx.Find(o.image_id);
      if (idx != FlatIndex::kNone) visit(idx);
    }
  };
  const auto is_verified = [&](const Selected<point3D_t>& selected, const Point3D& point) {
    return selected.constant || IsOfStructure(point.origin) ||
           NumImages(point.track, image_idx) >= HeldOutPoints::kMinImages;
  };
  for (const auto& selected : selection.points) {
    const Point3D& point = model.points3D.at(selected.id);
    if (is_verified(selected, point))
      for_each_image(point, [&](uint32_t idx) { ++num_verified[idx]; });
  }
  std::vector<point3D_t> unverified;
  for (const auto& selected : selection.points) {
    const Point3D& point = model.points3D.at(selected.id);
    if (is_verified(selected, point)) continue;
    bool is_needed = false;
    for_each_image(point, [&](uint32_t idx) { is_needed |= num_verified[idx] < kMinVerified; });
    if (!is_needed) unverified.push_back(selected.id);
  }
  return unverified;
}

BundleSelection SelectionOfCameras(const Reconstruction& model, const WeightChoice& choice,
                                   const BundleSelection& selection) {
  BundleSelection seen = choice.without_unverified
                             ? WithoutPoints(selection, UnverifiedPoints(model, selection))
                             : selection;
  return choice.weights.points_alone ? WithoutPointsOfStructure(model, std::move(seen)) : seen;
}

WeightChoice ChooseWeights(const FoldAdjustment& adjustment, Reconstruction* model) {
  return Chooser(adjustment, model).Choose();
}

}  // namespace holba
