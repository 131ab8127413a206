// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/two_view_estimation.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "holba/base/random.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/estimation/two_view/watermark.h"

namespace holba {
namespace {

// Where the essential matrix holds, a fundamental matrix is only looked for to see whether the
// calibration is wrong, which shows in few samples or not at all.
constexpr int kMaxSamplesOfCheck = 500;

Eigen::Matrix3d UnitNorm(const Eigen::Matrix3d& M) { return M / M.norm(); }

// The rotation that takes the rays of the first image nearest to those of the second (Kabsch).
Rigid3d FitRotation(const MatchedRays& matches, std::span<const uint32_t> subset) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (uint32_t i : subset)
    sum += matches.Ray2(i).normalized() * matches.Ray1(i).normalized().transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) signs[2] = -1.0;
  const Eigen::Matrix3d R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  return {Eigen::Quaterniond(R).normalized(), Eigen::Vector3d::Zero()};
}

// One run over a set of matches.
class Estimation {
 public:
  Estimation(const TwoViewOptions& options, const TwoViewEnd& end1, const TwoViewEnd& end2,
             const PointMatches& matches, bool best_first, uint64_t seed)
      : options_{options}, end1_{end1}, end2_{end2}, matches_{matches} {
    is_calibrated_ = end1.is_calibrated && end2.is_calibrated;
    camera1_ =
        is_calibrated_ ? *end1.camera : AssumedPinhole(end1.camera->width, end1.camera->height);
    camera2_ =
        is_calibrated_ ? *end2.camera : AssumedPinhole(end2.camera->width, end2.camera->height);
    for (const auto& [idx1, idx2] : matches) {
      pixels1_.push_back(end1.keypoints->Position(idx1));
      pixels2_.push_back(end2.keypoints->Position(idx2));
    }
    rays_ = MatchedRays(camera1_, pixels1_, camera2_, pixels2_);
    ransac_.max_error_px = options.max_error;
    ransac_.confidence = options.confidence;
    ransac_.max_num_samples = options.max_num_trials;
    ransac_.best_first = best_first;
    ransac_.seed = seed;
    if (rays_.size() > 0) {
      ransac_.min_inlier_ratio =
          std::clamp(static_cast<double>(options.min_num_inliers) / rays_.size(),
                     options.min_inlier_ratio, 1.0);
    }
  }

  TwoViewResult Run() {
    result_.geometry.config = TwoViewConfig::kDegenerate;
    result_.failure = TwoViewFailure::kFewMatches;
    if (rays_.size() < static_cast<size_t>(options_.min_num_inliers)) return std::move(result_);
    result_.failure = TwoViewFailure::kFewInliers;
    Search();
    const TwoViewFit* chosen = Choose();
    if (chosen == nullptr) return std::move(result_);

    result_.failure = TwoViewFailure::kNone;
    for (uint32_t i : chosen->inliers)
      result_.geometry.inlier_matches.push_back(matches_[rays_.Original(i)]);
    StoreModels();
    if (options_.detect_watermark && IsWatermark(*chosen)) {
      result_.geometry.config = TwoViewConfig::kWatermark;
      result_.failure = TwoViewFailure::kWatermark;
    } else if (options_.compute_relative_pose && is_calibrated_) {
      FindPose(*chosen);
    }
    return std::move(result_);
  }

 private:
  bool IsEnough(const std::optional<TwoViewFit>& fit) const {
    return fit && fit->inliers.size() >= static_cast<size_t>(options_.min_num_inliers);
  }

  std::optional<TwoViewFit> Fit(TwoViewKind kind, TwoViewRansacOptions ransac,
                                const Eigen::Matrix3d* start = nullptr) {
    ransac.seed += static_cast<uint64_t>(kind);
    auto fit = FitTwoView(kind, rays_, ransac, start);
    if (fit) result_.num_samples += fit->num_samples;
    return fit;
  }

  // All three models; where the essential matrix holds, the others only as far as they can change
  // the configuration.
  void Search() {
    if (is_calibrated_) E_ = Fit(TwoViewKind::kEssential, ransac_);
    TwoViewRansacOptions of_F = ransac_, of_H = ransac_;
    if (IsEnough(E_)) {
      const double share = static_cast<double>(E_->num_near) / rays_.size();
      of_F.min_inlier_ratio =
          std::clamp(share / options_.min_E_F_inlier_ratio, ransac_.min_inlier_ratio, 1.0);
      of_F.multiplier = 1.0;
      of_F.max_num_samples = std::min(of_F.max_num_samples, kMaxSamplesOfCheck);
      of_H.min_inlier_ratio =
          std::clamp(share * options_.max_H_inlier_ratio, ransac_.min_inlier_ratio, 1.0);
      of_H.multiplier = 1.0;
    }
    F_ = Fit(TwoViewKind::kFundamental, of_F, E_ ? &E_->model : nullptr);
    if (!is_calibrated_ && IsEnough(F_)) {
      const double share = static_cast<double>(F_->inliers.size()) / rays_.size();
      of_H.min_inlier_ratio =
          std::clamp(share * options_.max_H_inlier_ratio, ransac_.min_inlier_ratio, 1.0);
    }
    H_ = Fit(TwoViewKind::kHomography, of_H);
    if (E_) result_.num_inliers_E = E_->inliers.size();
    if (F_) result_.num_inliers_F = F_->inliers.size();
    if (H_) result_.num_inliers_H = H_->inliers.size();
  }

  // COLMAP's rule: the configuration and the model whose inliers are kept. Null: none.
  const TwoViewFit* Choose() {
    const auto is_planar = [&](double num_inliers) {
      return IsEnough(H_) && result_.num_inliers_H > options_.max_H_inlier_ratio * num_inliers;
    };
    const auto larger = [&](const TwoViewFit& fit) {
      return H_->inliers.size() > fit.inliers.size() ? &*H_ : &fit;
    };
    TwoViewConfig& config = result_.geometry.config;
    // A fundamental matrix does not know which side is behind a camera.
    if (IsEnough(E_) &&
        static_cast<double>(E_->num_near) > options_.min_E_F_inlier_ratio * result_.num_inliers_F) {
      const bool planar = is_planar(static_cast<double>(result_.num_inliers_E));
      config = planar ? TwoViewConfig::kPlanarOrPanoramic : TwoViewConfig::kCalibrated;
      return planar ? larger(*E_) : &*E_;
    }
    if (IsEnough(F_)) {
      const bool planar = is_planar(static_cast<double>(result_.num_inliers_F));
      config = planar ? TwoViewConfig::kPlanarOrPanoramic : TwoViewConfig::kUncalibrated;
      return planar ? larger(*F_) : &*F_;
    }
    if (IsEnough(H_)) {
      config = TwoViewConfig::kPlanarOrPanoramic;
      return &*H_;
    }
    return nullptr;
  }

  // Matrices of pixels, of distorted cameras of ideal ones.
  void StoreModels() {
    const Eigen::Matrix3d inverse1 = CalibrationMatrix(camera1_).inverse();
    const Eigen::Matrix3d K2 = CalibrationMatrix(camera2_), inverse2 = K2.inverse();
    if (E_) result_.geometry.E = E_->model;
    if (F_) result_.geometry.F = UnitNorm(inverse2.transpose() * F_->model * inverse1);
    if (H_) result_.geometry.H = UnitNorm(K2 * H_->model * inverse1);
  }

  bool IsWatermark(const TwoViewFit& chosen) const {
    std::vector<Eigen::Vector2d> pixels1, pixels2;
    for (uint32_t i : chosen.inliers) {
      pixels1.push_back(pixels1_[rays_.Original(i)]);
      pixels2.push_back(pixels2_[rays_.Original(i)]);
    }
    const WatermarkRule rule{.border_size = options_.watermark_border_size,
                             .min_inlier_ratio = options_.watermark_min_inlier_ratio,
                             .max_error_px = options_.watermark_detection_max_error};
    return LooksLikeWatermark(rule, {end1_.camera->width, end1_.camera->height}, pixels1,
                              {end2_.camera->width, end2_.camera->height}, pixels2, ransac_.seed);
  }

  void FindPose(const TwoViewFit& chosen) {
    TwoViewGeometry& geometry = result_.geometry;
    std::optional<ChosenPose> pose;
    if (geometry.config == TwoViewConfig::kCalibrated) {
      pose = ChoosePose(PosesOfEssential(E_->model), rays_, chosen.inliers);
    } else if (geometry.config == TwoViewConfig::kPlanarOrPanoramic) {
      pose = PlanarPose(chosen);
    }
    if (!pose) return;
    geometry.cam2_from_cam1 = pose->cam2_from_cam1;
    result_.median_angle_deg = pose->median_angle_deg;
  }

  std::optional<ChosenPose> PlanarPose(const TwoViewFit& chosen) {
    Rigid3d rotation = FitRotation(rays_, H_->inliers);
    std::vector<uint32_t> of_rotation;
    // Twice, because what fits the homography only by chance turns the rotation.
    for (int round = 0; round < 2; ++round) {
      of_rotation =
          InliersOf(TwoViewKind::kHomography, rotation.RotationMatrix(), rays_, options_.max_error);
      if (of_rotation.size() < 2) break;
      rotation = FitRotation(rays_, of_rotation);
    }
    if (static_cast<double>(of_rotation.size()) >=
        options_.max_H_inlier_ratio * static_cast<double>(H_->inliers.size())) {
      result_.geometry.config = TwoViewConfig::kPanoramic;
      return ChoosePose({rotation}, rays_, chosen.inliers);
    }
    result_.geometry.config = TwoViewConfig::kPlanar;
    // A homography has two poses with the plane in front of the cameras; what lies off the plane
    // tells which.
    std::vector<Rigid3d> poses = PosesOfHomography(H_->model, 0.0);
    if (E_) {
      const std::vector<Rigid3d> more = PosesOfEssential(E_->model);
      poses.insert(poses.end(), more.begin(), more.end());
    }
    std::optional<ChosenPose> best;
    double best_score = 0.0;
    for (const Rigid3d& pose : poses) {
      const auto choice = ChoosePose({pose}, rays_, chosen.inliers);
      if (!choice) continue;
      const double gain =
          GainOf(TwoViewKind::kEssential, EssentialMatrix(pose), rays_, options_.max_error);
      const double score = gain * choice->num_in_front;
      if (!(score > best_score)) continue;
      best_score = score;
      best = choice;
    }
    return best;
  }

  const TwoViewOptions& options_;
  const TwoViewEnd &end1_, &end2_;
  const PointMatches& matches_;
  bool is_calibrated_ = false;
  Camera camera1_, camera2_;
  std::vector<Eigen::Vector2d> pixels1_, pixels2_;
  MatchedRays rays_;
  TwoViewRansacOptions ransac_;
  std::optional<TwoViewFit> E_, F_, H_;
  TwoViewResult result_;
};

PointMatches WithoutStationary(const TwoViewOptions& options, const TwoViewEnd& end1,
                               const TwoViewEnd& end2, const PointMatches& matches) {
  PointMatches moving;
  for (const auto& match : matches) {
    const double shift_px =
        (end1.keypoints->Position(match[0]) - end2.keypoints->Position(match[1])).norm();
    if (shift_px > options.stationary_matches_max_error) moving.push_back(match);
  }
  return moving;
}

// Models one after the other, each of the matches that the ones before leave.
TwoViewResult EstimateMultiple(const TwoViewOptions& options, const TwoViewEnd& end1,
                               const TwoViewEnd& end2, PointMatches matches, bool best_first,
                               uint64_t seed) {
  std::vector<TwoViewResult> results;
  TwoViewResult last;
  while (true) {
    last = Estimation(options, end1, end2, matches, best_first, seed + 16 * results.size()).Run();
    if (last.geometry.inlier_matches.empty()) break;
    PointMatches inliers = last.geometry.inlier_matches;
    std::sort(inliers.begin(), inliers.end());
    std::erase_if(matches, [&](const auto& match) {
      return std::binary_search(inliers.begin(), inliers.end(), match);
    });
    if (options.multiple_ignore_watermark && last.geometry.config == TwoViewConfig::kWatermark) {
      continue;
    }
    results.push_back(std::move(last));
  }
  if (results.empty()) return last;
  if (results.size() == 1) return std::move(results[0]);
  TwoViewResult all;
  all.geometry.config = TwoViewConfig::kMultiple;
  for (const TwoViewResult& result : results) {
    all.geometry.inlier_matches.insert(all.geometry.inlier_matches.end(),
                                       result.geometry.inlier_matches.begin(),
                                       result.geometry.inlier_matches.end());
    all.num_inliers_E += result.num_inliers_E;
    all.num_inliers_F += result.num_inliers_F;
    all.num_inliers_H += result.num_inliers_H;
    all.num_samples += result.num_samples;
  }
  return all;
}

}  // namespace

void TwoViewOptions::Describe(OptionTable* table) const {
  table->Section("TwoViewGeometry");
  table->Field("min_num_inliers", &min_num_inliers, AtLeast(1),
               "Matches that the geometry of a pair has at least.");
  table->Field("max_error", &max_error, GreaterThan(0),
               "Largest error of an inlier in pixels: Sampson distance, of homographies the root "
               "mean square of both transfer errors. Errors below it count by their size.");
  table->Field("confidence", &confidence, Between(0, 0.9999999),
               "Probability that a sample of right matches was drawn.");
  table->Field("max_num_trials", &max_num_trials, AtLeast(1), "Samples drawn at most.");
  table->Field("min_inlier_ratio", &min_inlier_ratio, Between(0, 1),
               "Share of right matches below which no geometry is looked for; it bounds the number "
               "of samples.");
  table->Field("min_E_F_inlier_ratio", &min_E_F_inlier_ratio, Between(0, 1),
               "The essential matrix has to have this share of the fundamental matrix's inliers, "
               "else the calibration is not believed.");
  table->Field("max_H_inlier_ratio", &max_H_inlier_ratio, Between(0, 1),
               "With a greater share of inliers a homography makes the pair planar or panoramic.");
  table->Field("detect_watermark", &detect_watermark,
               "Whether pairs are marked whose matches are one shift near the border.");
  table->Field("watermark_min_inlier_ratio", &watermark_min_inlier_ratio, Between(0, 1),
               "Share of the matches that is near the border, and that is one shift.");
  table->Field("watermark_border_size", &watermark_border_size, Between(0, 0.5),
               "Width of the border as a share of the image's diagonal.");
  table->Field("watermark_detection_max_error", &watermark_detection_max_error, GreaterThan(0),
               "Largest difference of shifts in pixels that count as one.");
  table->Field("multiple_models", &multiple_models,
               "Whether further geometries are looked for in the matches that one leaves (moving "
               "objects).");
  table->Field("multiple_ignore_watermark", &multiple_ignore_watermark,
               "Whether watermarks are left out of multiple models.");
  table->Field("filter_stationary_matches", &filter_stationary_matches,
               "Whether matches are left out that are at the same pixel in both images.");
  table->Field("stationary_matches_max_error", &stationary_matches_max_error, AtLeast(0),
               "Largest distance in pixels of such matches.");
  table->Field("compute_relative_pose", &compute_relative_pose,
               "Whether the relative pose of calibrated pairs is computed, and with it whether a "
               "pair is planar or panoramic.");
  table->Field("random_seed", &random_seed, AtLeast(0), "Seed of the samples.");
}

std::string_view NameOf(TwoViewFailure failure) {
  switch (failure) {
    case TwoViewFailure::kNone:
      return "verified";
    case TwoViewFailure::kFewMatches:
      return "too few matches";
    case TwoViewFailure::kFewInliers:
      return "no geometry with enough inliers";
    case TwoViewFailure::kWatermark:
      return "watermark";
  }
  return "";
}

TwoViewResult EstimateTwoView(const TwoViewOptions& options, const TwoViewEnd& end1,
                              const TwoViewEnd& end2, const PointMatches& matches, bool best_first,
                              uint64_t pair_seed) {
  Random mix(pair_seed ^ (static_cast<uint64_t>(options.random_seed) << 32));
  const uint64_t seed = mix.Bits();
  const PointMatches& kept =
      options.filter_stationary_matches ? WithoutStationary(options, end1, end2, matches) : matches;
  if (options.multiple_models) return EstimateMultiple(options, end1, end2, kept, best_first, seed);
  return Estimation(options, end1, end2, kept, best_first, seed).Run();
}

}  // namespace holba
