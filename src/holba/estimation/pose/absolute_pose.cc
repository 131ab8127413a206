// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/absolute_pose.h"

#include <algorithm>
#include <cmath>

#include "holba/base/random.h"
#include "holba/estimation/pose/focal_pose.h"
#include "holba/estimation/pose/pose_evidence.h"
#include "holba/estimation/pose/pose_refinement.h"
#include "holba/geometry/angle.h"
#include "holba/robust/group_fit.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

constexpr size_t kSampleSize = 3;
// Samples are drawn so many times as often as samples without noise would have to be.
constexpr double kTrialMultiplier = 3.0;
constexpr int kLocalIterations = 12, kFinalIterations = 30;
// What keypoints and the ends of segments are at best located to, where that of a model is seen; a
// smaller error means nothing.
constexpr double kSmallestThresholdPx = 1.0;
constexpr double kMinNoisePx = 0.1;
constexpr double kMinNoiseRad = 1e-4;
// Inliers, and the thresholds of the last fit, in units of the noise.
constexpr double kInlierSigmas = 4.0, kSmallestSigmas = 3.0, kLargestSigmas = 6.0;
// The upper limit of inliers is no less than this: the noise of many points of a model and of few
// of one kind is not that of each one.
constexpr double kMinInlierPx = 1.0;
// Sightings that the common noise of all kinds weighs as in the noise of one kind.
constexpr double kCommonNoiseWeight = 4.0;
// Half of the median of the squared length of a normal vector of two components: log 2.
constexpr double kHalfMedianOfTwo = 0.6931471805599453;
// A focal length that was known is right to so much (a factor's logarithm): EXIF tells that of the
// lens, which focusing changes.
constexpr double kKnownFocalLengthSigma = 0.1;

class Search {
 public:
  Search(const AbsolutePoseOptions& options, const Camera& camera, bool focal_is_known,
         const AbsolutePoseMatches& matches, uint64_t seed)
      : options_{options},
        matches_{matches},
        evidence_{camera, matches},
        focal_is_known_{focal_is_known || camera.model->focal_idxs.empty()},
        random_{seed},
        max_noise_{options.abs_pose_max_error, options.abs_pose_max_error,
                   DegToRad(options.abs_pose_max_direction_error_deg)},
        search_noise_{1.0, 1.0, max_noise_.directions / options.abs_pose_max_error},
        gain_{std::min(kSmallestThresholdPx, 0.5 * options.abs_pose_max_error),
              std::sqrt(2.0) * options.abs_pose_max_error} {}

  std::optional<AbsolutePose> Run() {
    if (matches_.points.size() < SampleSize()) return std::nullopt;
    int needed = NumTrials(options_.abs_pose_min_inlier_ratio);
    int num_trials = 0;
    std::vector<PoseUnknowns> hypotheses;
    for (; num_trials < std::max(options_.abs_pose_min_num_trials, needed); ++num_trials) {
      hypotheses.clear();
      Propose(&hypotheses);
      for (const PoseUnknowns& hypothesis : hypotheses) {
        if (Consider(hypothesis)) needed = std::min(needed, NumTrials(ShareOfInliers()));
      }
    }
    if (!(best_gain_ > 0.0)) return std::nullopt;
    return Finish(num_trials);
  }

 private:
  int NumTrials(double share) const {
    const double needed =
        kTrialMultiplier * NumSamplesNeeded(options_.abs_pose_confidence, share, SampleSize());
    return static_cast<int>(
        std::clamp(std::ceil(needed), 1.0, static_cast<double>(options_.abs_pose_max_num_trials)));
  }
  size_t SampleSize() const { return focal_is_known_ ? kSampleSize : kSampleSize + 1; }

  void Propose(std::vector<PoseUnknowns>* hypotheses) {
    FewSightings sample;
    while (sample.points.size() < SampleSize()) {
      const auto i = static_cast<uint32_t>(random_.Index(matches_.points.size()));
      if (std::find(sample.points.begin(), sample.points.end(), i) == sample.points.end())
        sample.points.push_back(i);
    }
    if (!focal_is_known_) {
      return SolveWithFocalLength(
          evidence_, sample,
          {options_.abs_pose_min_focal_length_ratio, options_.abs_pose_max_focal_length_ratio},
          hypotheses);
    }
    poses_.clear();
    SolveThree(evidence_, evidence_.camera().params, sample, &poses_);
    for (const Rigid3d& pose : poses_) hypotheses->push_back({pose, evidence_.camera().params});
  }

  double GainOf(const PoseUnknowns& at, double to_beat) const {
    return focal_is_known_
               ? evidence_.GainOf(at.cam_from_world, search_noise_, gain_, to_beat)
               : evidence_.GainOf(at.cam_from_world, at.params, search_noise_, gain_, to_beat);
  }

  // Hypotheses compete with the best hypothesis, not with what was made of it: one that is better
  // may become better still. Returns whether there is a new best pose.
  bool Consider(const PoseUnknowns& hypothesis) {
    const double gain = GainOf(hypothesis, best_hypothesis_gain_);
    if (!(gain > best_hypothesis_gain_)) return false;
    best_hypothesis_gain_ = gain;
    FreeIntrinsics free;
    free.focal_length = !focal_is_known_;
    const RefinedPose refined =
        RefinePose(evidence_, hypothesis, {search_noise_, gain_, free, kLocalIterations});
    if (!(refined.gain > best_gain_) || !IsPlausible(refined.at)) return false;
    best_gain_ = refined.gain;
    best_ = refined.at;
    return true;
  }

  bool IsPlausible(const PoseUnknowns& at) const {
    if (focal_is_known_) return true;
    const double ratio = FocalLengthRatio(evidence_.camera(), at.params);
    return ratio >= options_.abs_pose_min_focal_length_ratio &&
           ratio <= options_.abs_pose_max_focal_length_ratio;
  }

  double ShareOfInliers() const {
    ForEachKind<std::vector<double>> squared;
    evidence_.SquaredErrors(best_.cam_from_world, best_.params, &squared);
    const double limit = options_.abs_pose_max_error * options_.abs_pose_max_error;
    const auto count = std::count_if(squared.points.begin(), squared.points.end(),
                                     [&](double e2) { return e2 <= limit; });
    return std::max(static_cast<double>(count) / static_cast<double>(squared.points.size()),
                    options_.abs_pose_min_inlier_ratio);
  }

  std::optional<AbsolutePose> Finish(int num_trials) {
    FreeIntrinsics free;
    free.focal_length = !focal_is_known_;
    PoseUnknowns at =
        RefinePose(evidence_, best_, {search_noise_, gain_, free, kFinalIterations}).at;
    free.focal_length |= options_.abs_pose_refine_focal_length;
    free.focal_length_sigma = focal_is_known_ ? kKnownFocalLengthSigma : 0.0;
    free.extra_params = options_.abs_pose_refine_extra_params;
    AbsolutePose result;
    for (int round = 0; round < 3; ++round) {
      const auto noise = NoiseOf(at);
      if (!noise) return std::nullopt;
      result.noise_sigma = *noise;
      at = RefinePose(evidence_, at,
                      {*noise, Gain(kSmallestSigmas, kLargestSigmas), free, kFinalIterations})
               .at;
    }
    MarkInliers(at, &result);
    if (!IsPlausible(at) || result.num_inliers.points + result.num_inliers.lines <
                                static_cast<size_t>(options_.abs_pose_min_num_inliers)) {
      return std::nullopt;
    }
    const auto covariance = PoseCovariance(evidence_, at, result.noise_sigma, free, result.inliers);
    if (!covariance) return std::nullopt;
    result.covariance = *covariance;
    result.cam_from_world = at.cam_from_world;
    result.params = at.params;
    result.gain = evidence_.GainOf(at.cam_from_world, at.params, search_noise_, gain_, -1.0);
    result.num_trials = num_trials;
    if (result.num_inliers.points == 0) result.noise_sigma.points = 0.0;
    if (result.num_inliers.lines == 0) result.noise_sigma.lines = 0.0;
    if (result.num_inliers.directions == 0) result.noise_sigma.directions = 0.0;
    return result;
  }

  // Of one of the two numbers of an error, by the median within the largest error. Few of a kind
  // say little of its noise: they are taken together with those of the other kinds in units of the
  // largest errors. Empty: no more numbers than unknowns.
  std::optional<ForEachKind<double>> NoiseOf(const PoseUnknowns& at) const {
    ForEachKind<std::vector<double>> squared;
    evidence_.SquaredErrors(at.cam_from_world, at.params, &squared);
    std::vector<double> all;
    const auto keep = [&](double limit, std::vector<double>* errors) {
      std::erase_if(*errors, [&](double e2) { return !(e2 <= limit * limit); });
      for (double e2 : *errors) all.push_back(e2 / (limit * limit));
    };
    keep(max_noise_.points, &squared.points);
    keep(max_noise_.lines, &squared.lines);
    keep(max_noise_.directions, &squared.directions);
    const double num_unknowns = focal_is_known_ ? 6.0 : 7.0;
    const double num_errors = 2.0 * static_cast<double>(all.size());
    if (!(num_errors > num_unknowns)) return std::nullopt;
    // What the unknowns took away from the errors.
    const double taken = num_errors / (num_errors - num_unknowns);
    const double common = Median(all);
    const auto noise = [&](const std::vector<double>& errors, double limit, double smallest) {
      const double count = static_cast<double>(errors.size());
      const double own = Median(errors), weight = kCommonNoiseWeight;
      const double median = (count * own + weight * common * limit * limit) / (count + weight);
      return std::clamp(std::sqrt(taken * median / (2.0 * kHalfMedianOfTwo)), smallest, limit);
    };
    return ForEachKind<double>{noise(squared.points, max_noise_.points, kMinNoisePx),
                               noise(squared.lines, max_noise_.lines, kMinNoisePx),
                               noise(squared.directions, max_noise_.directions, kMinNoiseRad)};
  }

  void MarkInliers(const PoseUnknowns& at, AbsolutePose* result) const {
    ForEachKind<std::vector<double>> squared;
    evidence_.SquaredErrors(at.cam_from_world, at.params, &squared);
    const auto mark = [](const std::vector<double>& errors, double sigma, double smallest,
                         double largest, std::vector<uint8_t>* flags, size_t* count) {
      const double limit = std::min(std::max(kInlierSigmas * sigma, smallest), largest);
      flags->reserve(errors.size());
      for (double e2 : errors) flags->push_back(e2 <= limit * limit ? 1 : 0);
      *count = static_cast<size_t>(std::count(flags->begin(), flags->end(), 1));
    };
    mark(squared.points, result->noise_sigma.points, kMinInlierPx, max_noise_.points,
         &result->inliers.points, &result->num_inliers.points);
    mark(squared.lines, result->noise_sigma.lines, kMinInlierPx, max_noise_.lines,
         &result->inliers.lines, &result->num_inliers.lines);
    mark(squared.directions, result->noise_sigma.directions, 0.0, max_noise_.directions,
         &result->inliers.directions, &result->num_inliers.directions);
  }

  const AbsolutePoseOptions& options_;
  const AbsolutePoseMatches& matches_;
  PoseEvidence evidence_;
  bool focal_is_known_;
  Random random_;
  ForEachKind<double> max_noise_;     // largest errors of inliers: pixels, pixels, radians
  ForEachKind<double> search_noise_;  // pixels; of directions as many radians as count like one
  Gain gain_;                         // of errors in units of search_noise_
  std::vector<Rigid3d> poses_;
  double best_hypothesis_gain_ = 0.0, best_gain_ = 0.0;
  PoseUnknowns best_;
};

}  // namespace

void AbsolutePoseOptions::Describe(OptionTable* table) const {
  table->Section("Mapper");
  table->Field("abs_pose_max_error", &abs_pose_max_error, GreaterThan(0),
               "Largest error in pixels of a point or line that agrees with the pose of a new "
               "image. Errors below it count by their size.");
  table->Field("abs_pose_min_num_inliers", &abs_pose_min_num_inliers, AtLeast(1),
               "Points and lines that have to agree with the pose of a new image.");
  table->Field("abs_pose_min_inlier_ratio", &abs_pose_min_inlier_ratio, Between(0, 1),
               "Share of right sightings below which no pose is looked for; it bounds the number "
               "of trials.");
  table->Field("abs_pose_refine_focal_length", &abs_pose_refine_focal_length,
               "Whether a new image's pose refines the focal length.");
  table->Field("abs_pose_refine_extra_params", &abs_pose_refine_extra_params,
               "Whether a new image's pose refines the parameters of the lens.");
  table->Field("abs_pose_max_direction_error_deg", &abs_pose_max_direction_error_deg,
               Between(0.001, 90),
               "Largest angle between a vanishing direction that agrees with the pose and its "
               "prediction; at half of it the direction counts as a point at half of "
               "abs_pose_max_error.");
  table->Field("abs_pose_confidence", &abs_pose_confidence, Between(0, 0.9999999),
               "Probability that a sample of right sightings was drawn.");
  table->Field("abs_pose_min_num_trials", &abs_pose_min_num_trials, AtLeast(1),
               "Samples drawn at least.");
  table->Field("abs_pose_max_num_trials", &abs_pose_max_num_trials, AtLeast(1),
               "Samples drawn at most.");
  table->Field("abs_pose_min_focal_length_ratio", &abs_pose_min_focal_length_ratio, GreaterThan(0),
               "Smallest focal length that is looked for where it is unknown, in units of the "
               "image's longer side.");
  table->Field("abs_pose_max_focal_length_ratio", &abs_pose_max_focal_length_ratio, GreaterThan(0),
               "Largest focal length that is looked for where it is unknown, in units of the "
               "image's longer side.");
}

std::optional<AbsolutePose> EstimateAbsolutePose(const AbsolutePoseOptions& options,
                                                 const Camera& camera, bool focal_is_known,
                                                 const AbsolutePoseMatches& matches,
                                                 uint64_t seed) {
  return Search(options, camera, focal_is_known, matches, seed).Run();
}

}  // namespace holba
