// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/two_view_ransac.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "holba/base/random.h"
#include "holba/estimation/two_view/minimal_solvers.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/robust/group_fit.h"

namespace holba {
namespace {

constexpr int kMaxSampleSize = 7;
// Iterations of a local optimisation, and of the last one.
constexpr int kLocalIterations = 15;
constexpr int kFinalIterations = 30;
// After so many samples PROSAC's are those of RANSAC (T_N of the publication).
constexpr double kProsacSamples = 200000.0;
// Share of wrong matches that agree with a wrong model by chance: for subsets of the best matches
// to say that enough was sampled, far more must agree. The band of 4 px along a line through a
// picture of 800 px is 1 to 2 % of it.
constexpr double kChanceAgreement = 0.1;
constexpr size_t kMinSubset = 20;
// What is counted as an error of the noise sigma goes up to so many sigma, and to no less than what
// keypoints are at best located to.
constexpr double kNumSigma = 3.0;
// The gain's R in units of the largest error of an inlier.
constexpr double kGainLimit = 1.4142135623730951;
constexpr double kMinLimitPx = 0.1;

// Which matches a sample is made of. PROSAC's growth function: the subset of the n best grows so
// that each subset gets the samples that RANSAC would on average have drawn from it.
class Sampler {
 public:
  Sampler(size_t num_matches, int sample_size, bool best_first, uint64_t seed)
      : num_matches_{num_matches},
        sample_size_{sample_size},
        random_{seed},
        subset_{best_first ? static_cast<size_t>(sample_size) : num_matches} {
    if (!best_first) return;
    expected_ = kProsacSamples;
    for (int i = 0; i < sample_size; ++i) {
      expected_ *= static_cast<double>(sample_size - i) / static_cast<double>(num_matches - i);
    }
  }

  size_t subset() const { return subset_; }

  void Draw(std::array<uint32_t, kMaxSampleSize>* sample) {
    ++num_drawn_;
    bool with_newest = false;
    if (subset_ < num_matches_) {
      if (num_drawn_ > end_of_subset_) Grow();
      with_newest = num_drawn_ <= end_of_subset_ && subset_ > static_cast<size_t>(sample_size_);
    }
    int count = 0;
    if (with_newest) (*sample)[count++] = static_cast<uint32_t>(subset_ - 1);
    const size_t pool = with_newest ? subset_ - 1 : subset_;
    while (count < sample_size_) {
      const auto candidate = static_cast<uint32_t>(random_.Index(pool));
      if (std::find(sample->begin(), sample->begin() + count, candidate) ==
          sample->begin() + count) {
        (*sample)[count++] = candidate;
      }
    }
  }

 private:
  void Grow() {
    ++subset_;
    const double n = static_cast<double>(subset_);
    const double next = expected_ * n / (n - sample_size_);
    end_of_subset_ += std::max(1.0, std::ceil(next - expected_));
    expected_ = next;
  }

  size_t num_matches_;
  int sample_size_;
  Random random_;
  size_t subset_;
  double num_drawn_ = 0.0;
  double end_of_subset_ = 1.0;  // T'_n
  double expected_ = 0.0;       // T_n
};

class Search {
 public:
  Search(TwoViewKind kind, const MatchedRays& matches, const TwoViewRansacOptions& options)
      : kind_{kind},
        matches_{matches},
        options_{options},
        sample_size_{MinimalSize(kind)},
        limit_px_{kGainLimit * options.max_error_px} {}

  std::optional<TwoViewFit> Run(const Eigen::Matrix3d* start) {
    const auto size = static_cast<size_t>(sample_size_);
    if (matches_.size() <= size) return std::nullopt;
    needed_ = NumSamples(options_.min_inlier_ratio);
    Sampler sampler(matches_.size(), sample_size_, options_.best_first, options_.seed);
    if (start != nullptr) Consider(*start, sampler.subset());

    std::array<uint32_t, kMaxSampleSize> sample;
    std::array<Eigen::Vector3d, kMaxSampleSize> rays1, rays2;
    std::vector<Eigen::Matrix3d> models;
    int num_samples = 0;
    while (num_samples < std::max(options_.min_num_samples, needed_)) {
      ++num_samples;
      sampler.Draw(&sample);
      for (size_t k = 0; k < size; ++k) {
        rays1[k] = matches_.Ray1(sample[k]);
        rays2[k] = matches_.Ray2(sample[k]);
      }
      models.clear();
      Solve({rays1.data(), size}, {rays2.data(), size}, &models);
      for (const Eigen::Matrix3d& model : models) Consider(model, sampler.subset());
    }
    return Finish(num_samples);
  }

 private:
  void Solve(Rays rays1, Rays rays2, std::vector<Eigen::Matrix3d>* models) const {
    switch (kind_) {
      case TwoViewKind::kEssential:
        return SolveEssential(rays1, rays2, models);
      case TwoViewKind::kFundamental:
        return SolveFundamental(rays1, rays2, models);
      case TwoViewKind::kHomography:
        return SolveHomography(rays1, rays2, models);
    }
  }

  int NumSamples(double share) const {
    const double needed = options_.multiplier * NumSamplesNeeded(options_.confidence, share,
                                                                 static_cast<size_t>(sample_size_));
    return static_cast<int>(
        std::clamp(std::ceil(needed), 1.0, static_cast<double>(options_.max_num_samples)));
  }

  // Hypotheses compete with the best hypothesis, not with what was made of it: one that is better
  // may become better still.
  void Consider(const Eigen::Matrix3d& model, size_t subset) {
    double gain = GainOf(kind_, model, matches_, limit_px_, best_hypothesis_gain_);
    if (!(gain > best_hypothesis_gain_)) return;
    const MatchedRays* counted = Possible(model);
    gain = GainOf(kind_, model, *counted, limit_px_);
    if (!(gain > best_hypothesis_gain_)) return;
    best_hypothesis_gain_ = gain;
    const Eigen::Matrix3d refined =
        RefineModel(kind_, model, *counted, limit_px_, kLocalIterations).model;
    const double refined_gain = GainOf(kind_, refined, *Possible(refined), limit_px_);
    if (!(refined_gain > best_gain_)) return;
    best_gain_ = refined_gain;
    best_ = refined;
    needed_ = std::min(needed_, SamplesForBest(subset));
  }

  // The matches, of which those count that the model's best pose has in front of the cameras.
  const MatchedRays* Possible(const Eigen::Matrix3d& model) {
    in_front_.assign(matches_.size(), 1);
    if (kind_ != TwoViewKind::kEssential) return &matches_;
    ErrorsOf(kind_, model, matches_, &errors_);
    double best = -1.0;
    for (const Rigid3d& pose : PosesOfEssential(model)) {
      std::vector<uint8_t> flags = AreInFront(pose, matches_, options_.max_error_px);
      double gain = 0.0;
      for (size_t i = 0; i < errors_.size(); ++i) {
        const double left = 1.0 - errors_[i] / (limit_px_ * limit_px_);
        if (left > 0.0 && flags[i]) gain += left * left;
      }
      if (!(gain > best)) continue;
      best = gain;
      in_front_ = std::move(flags);
    }
    possible_ = matches_.Counting(in_front_);
    return &possible_;
  }

  // For all matches, and for those subsets of the best ones that hold all samples so far.
  int SamplesForBest(size_t subset) const {
    std::vector<double> errors;
    ErrorsOf(kind_, best_, matches_, &errors);
    const double limit = options_.max_error_px * options_.max_error_px;
    int needed = options_.max_num_samples;
    size_t num_inliers = 0;
    for (size_t i = 0; i < errors.size(); ++i) {
      if (errors[i] <= limit) ++num_inliers;
      const size_t n = i + 1;
      if (n < errors.size() && (!options_.best_first || n < std::max(subset, kMinSubset))) continue;
      const double by_chance = kChanceAgreement * n;
      const bool is_chance = num_inliers < sample_size_ + by_chance +
                                               4.0 * std::sqrt(by_chance * (1 - kChanceAgreement));
      if (n < errors.size() && is_chance) continue;
      const double share = static_cast<double>(num_inliers) / static_cast<double>(n);
      needed = std::min(needed, NumSamples(std::max(share, options_.min_inlier_ratio)));
    }
    return needed;
  }

  std::optional<TwoViewFit> Finish(int num_samples) {
    if (!(best_gain_ > 0.0)) return std::nullopt;
    TwoViewFit fit;
    const MatchedRays* counted = Possible(best_);
    fit.model = RefineModel(kind_, best_, *counted, limit_px_, kFinalIterations).model;
    for (int round = 0; round < 2; ++round) {
      fit.sigma_px = NoiseOf(fit.model);
      const double limit_px = std::max(kNumSigma * fit.sigma_px, kMinLimitPx);
      fit.model = RefineModel(kind_, fit.model, *counted, limit_px, kFinalIterations).model;
    }
    counted = Possible(fit.model);
    fit.gain = GainOf(kind_, fit.model, *counted, limit_px_);
    fit.num_samples = num_samples;
    fit.inliers = InliersOf(kind_, fit.model, matches_, options_.max_error_px);
    fit.num_near = fit.inliers.size();
    std::erase_if(fit.inliers, [&](uint32_t i) { return !in_front_[i]; });
    if (fit.inliers.size() <= static_cast<size_t>(sample_size_)) return std::nullopt;
    return fit;
  }

  // By the median of the errors of the inliers: of one coordinate for Sampson errors, of two for
  // those of transfers.
  double NoiseOf(const Eigen::Matrix3d& model) const {
    std::vector<double> errors;
    ErrorsOf(kind_, model, matches_, &errors);
    const double limit = options_.max_error_px * options_.max_error_px;
    size_t count = 0;
    for (size_t i = 0; i < errors.size(); ++i) {
      if (errors[i] <= limit && in_front_[i]) errors[count++] = errors[i];
    }
    errors.resize(count);
    if (errors.empty()) return options_.max_error_px;
    const auto middle = errors.begin() + errors.size() / 2;
    std::nth_element(errors.begin(), middle, errors.end());
    return std::sqrt(*middle) / (kind_ == TwoViewKind::kHomography ? 1.177 : 0.6745);
  }

  TwoViewKind kind_;
  const MatchedRays& matches_;
  const TwoViewRansacOptions& options_;
  int sample_size_;
  double limit_px_;  // of the gain
  int needed_ = 0;
  std::vector<double> errors_;
  std::vector<uint8_t> in_front_;
  MatchedRays possible_;
  double best_hypothesis_gain_ = 0.0, best_gain_ = 0.0;
  Eigen::Matrix3d best_ = Eigen::Matrix3d::Zero();
};

}  // namespace

std::optional<TwoViewFit> FitTwoView(TwoViewKind kind, const MatchedRays& matches,
                                     const TwoViewRansacOptions& options,
                                     const Eigen::Matrix3d* start) {
  return Search(kind, matches, options).Run(start);
}

std::vector<uint32_t> InliersOf(TwoViewKind kind, const Eigen::Matrix3d& model,
                                const MatchedRays& matches, double max_error_px) {
  std::vector<double> errors;
  ErrorsOf(kind, model, matches, &errors);
  std::vector<uint32_t> inliers;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] <= max_error_px * max_error_px) inliers.push_back(static_cast<uint32_t>(i));
  }
  return inliers;
}

}  // namespace holba
