// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/pose/absolute_pose.h"

#include <algorithm>
#include <cmath>

#include "holba/base/random.h"
#include "holba/estimation/pose/linear_pose.h"
#include "holba/estimation/pose/minimal_poses.h"
#include "holba/estimation/pose/pose_evidence.h"
#include "holba/estimation/pose/pose_refinement.h"
#include "holba/geometry/angle.h"
#include "holba/robust/group_fit.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

constexpr size_t kSampleSize = 3;
constexpr size_t kMaxPairs = 1000;  // of directions
// Samples are drawn so many times as often as samples without noise would have to be.
constexpr double kTrialMultiplier = 3.0;
constexpr int kLocalIterations = 12, kFinalIterations = 30;
// What keypoints and the ends of segments are at best located to, where that of a model is seen; a
// smaller error means nothing.
constexpr double kSmallestThresholdPx = 1.0;
constexpr double kMinNoisePx = 0.1;
constexpr double kMinNoiseRad = 1e-4;
// Inliers, and the thresholds of the last fit, in units of the noise. Thresholds of 3 to 6 cost a
// tenth of the accuracy of few points, whose noise is known badly.
constexpr double kInlierSigmas = 4.0, kSmallestSigmas = 4.0, kLargestSigmas = 8.0;
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
    FindPairsOfDirections();
    const bool from_features = matches_.points.size() + matches_.lines.size() >= SampleSize();
    const bool from_directions =
        !pairs_.empty() && (matches_.points.size() >= 2 || matches_.lines.size() >= 3 ||
                            (matches_.points.size() == 1 && !matches_.lines.empty()));
    if (!from_features && !from_directions) return std::nullopt;
    const double least = options_.abs_pose_min_inlier_ratio;
    shares_ = {least, least, least};
    weights_ = {static_cast<double>(matches_.points.size()),
                static_cast<double>(matches_.lines.size()), 0.0};
    int needed = NumTrials(from_features, from_directions);
    int num_trials = 0;
    std::vector<PoseUnknowns> hypotheses;
    for (; num_trials < std::max(options_.abs_pose_min_num_trials, needed); ++num_trials) {
      hypotheses.clear();
      if (from_directions && (num_trials % 2 == 0 || !from_features)) {
        ProposeFromDirections(&hypotheses);
      } else {
        ProposeFromFeatures(&hypotheses);
      }
      for (const PoseUnknowns& hypothesis : hypotheses) {
        if (!Consider(hypothesis)) continue;
        CountInliers();
        needed = std::min(needed, NumTrials(from_features, from_directions));
      }
    }
    if (!(best_gain_ > 0.0)) return std::nullopt;
    return Finish(num_trials);
  }

 private:
  size_t SampleSize() const { return focal_is_known_ ? kSampleSize : kSampleSize + 1; }

  // Pairs of directions that make the same angle in the camera and in the world, and their
  // rotations. With an unknown focal length the angle says nothing of a pair.
  void FindPairsOfDirections() {
    const auto& directions = matches_.directions;
    std::vector<Eigen::Quaterniond> rotations;
    for (uint32_t i = 0; i < directions.size(); ++i) {
      for (uint32_t j = 0; j < i && pairs_.size() < kMaxPairs; ++j) {
        rotations.clear();
        if (focal_is_known_) {
          SolveRotation(directions[i].direction_in_cam, directions[j].direction_in_cam,
                        directions[i].direction_in_world, directions[j].direction_in_world,
                        2.0 * max_noise_.directions, &rotations);
          if (rotations.empty()) continue;
        }
        pairs_.push_back({{i, j}, rotations});
      }
    }
  }

  // So that with the confidence wanted one sample at least was all right, if shares_ of what
  // samples are drawn from are right.
  int NumTrials(bool from_features, bool from_directions) const {
    const double sum = weights_.points + weights_.lines;
    const double share =
        sum > 0.0 ? (weights_.points * shares_.points + weights_.lines * shares_.lines) / sum : 0.0;
    // Of a pair of directions, and of up to three features that give the translation.
    const double by_directions =
        from_directions ? shares_.directions * shares_.directions * share * share * share : 0.0;
    const double by_features =
        from_features ? std::pow(share, static_cast<double>(SampleSize())) : 0.0;
    const double chance = from_features && from_directions ? 0.5 * (by_directions + by_features)
                                                           : by_directions + by_features;
    const double needed =
        kTrialMultiplier * NumSamplesNeeded(options_.abs_pose_confidence, chance, 1);
    return static_cast<int>(
        std::clamp(std::ceil(needed), 1.0, static_cast<double>(options_.abs_pose_max_num_trials)));
  }

  // Adds a point or a line that is not there yet, by weights_.
  void Draw(FewSightings* sample) {
    const size_t points_left = matches_.points.size() - sample->points.size();
    const size_t lines_left = matches_.lines.size() - sample->lines.size();
    const bool is_point =
        lines_left == 0 ||
        (points_left > 0 &&
         random_.Uniform() * (weights_.points + weights_.lines) < weights_.points);
    std::vector<uint32_t>& drawn = is_point ? sample->points : sample->lines;
    const size_t count = is_point ? matches_.points.size() : matches_.lines.size();
    while (true) {
      const auto i = static_cast<uint32_t>(random_.Index(count));
      if (std::find(drawn.begin(), drawn.end(), i) != drawn.end()) continue;
      drawn.push_back(i);
      return;
    }
  }

  FocalLengthRange FocalRange() const {
    return {options_.abs_pose_min_focal_length_ratio, options_.abs_pose_max_focal_length_ratio};
  }

  void ProposeFromFeatures(std::vector<PoseUnknowns>* hypotheses) {
    FewSightings sample;
    for (size_t k = 0; k < SampleSize(); ++k) Draw(&sample);
    const Eigen::Quaterniond turn =
        sample.lines.empty() ? Eigen::Quaterniond::Identity() : RandomTurn();
    if (!focal_is_known_)
      return SolveWithFocalLength(evidence_, sample, FocalRange(), turn, hypotheses);
    const std::vector<double>& params = evidence_.camera().params;
    poses_.clear();
    SolveThree(evidence_, params, sample, turn, &poses_);
    for (const Rigid3d& pose : poses_) hypotheses->push_back({pose, params});
  }

  void ProposeFromDirections(std::vector<PoseUnknowns>* hypotheses) {
    FewSightings sample;
    for (int k = 0; k < 3; ++k) {
      const bool has_another = matches_.points.size() > sample.points.size() ||
                               matches_.lines.size() > sample.lines.size();
      if (has_another) Draw(&sample);
      const size_t num_points = sample.points.size(), num_lines = sample.lines.size();
      if (num_points == 2 || (num_points == 1 && num_lines > 0)) break;
    }
    const PairOfDirections& pair = pairs_[random_.Index(pairs_.size())];
    if (!focal_is_known_) {
      return SolveDirectionsWithFocalLength(evidence_, pair.directions, sample, FocalRange(),
                                            hypotheses);
    }
    for (const Eigen::Quaterniond& rotation : pair.rotations)
      SolveWithRotation(evidence_, evidence_.camera().params, rotation, sample, hypotheses);
  }

  Eigen::Quaterniond RandomTurn() {
    const double w = random_.Normal(), x = random_.Normal(), y = random_.Normal();
    return Eigen::Quaterniond(w, x, y, random_.Normal()).normalized();
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

  // Samples are drawn from the kinds as the best pose's inliers are spread over them, with one
  // more of each, so that no kind is given up.
  void CountInliers() {
    ForEachKind<std::vector<double>> squared;
    evidence_.SquaredErrors(best_.cam_from_world, best_.params, &squared);
    const auto count = [&](const std::vector<double>& errors, double limit, double* share) {
      const double num_inliers = static_cast<double>(std::count_if(
          errors.begin(), errors.end(), [&](double e2) { return e2 <= limit * limit; }));
      if (errors.empty()) return 0.0;
      *share = std::max(num_inliers / static_cast<double>(errors.size()),
                        options_.abs_pose_min_inlier_ratio);
      return num_inliers + 1.0;
    };
    weights_.points = count(squared.points, max_noise_.points, &shares_.points);
    weights_.lines = count(squared.lines, max_noise_.lines, &shares_.lines);
    count(squared.directions, max_noise_.directions, &shares_.directions);
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
  struct PairOfDirections {
    std::pair<uint32_t, uint32_t> directions;
    std::vector<Eigen::Quaterniond> rotations;  // for a known focal length
  };
  std::vector<PairOfDirections> pairs_;
  // What samples are drawn by, and the shares that are right: of the best pose so far.
  ForEachKind<double> weights_, shares_;
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
