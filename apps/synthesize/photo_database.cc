// SPDX-License-Identifier: BSD-3-Clause
#include "apps/synthesize/photo_database.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/estimation/two_view/two_view_estimation.h"
#include "holba/estimation/two_view/two_view_ransac.h"

namespace holba {
namespace {

// Pairs whose geometries are found at a time.
constexpr size_t kGroupSize = 512;
constexpr int kMaxIterations = 10;

struct PairOfCameras {
  const PhotoSetCamera &camera1, &camera2;
  const Keypoints &keypoints1, &keypoints2;

  bool IsCalibrated() const {
    return camera1.has_prior_focal_length && camera2.has_prior_focal_length;
  }
};

PairOfCameras CamerasOf(const PhotoSet& set, const PhotoSetPair& pair) {
  const auto camera_of = [&](image_t id) -> const PhotoSetCamera& {
    return set.cameras[set.truth.images.at(id).camera_id - 1];
  };
  return {camera_of(pair.image_id1), camera_of(pair.image_id2),
          set.images[pair.image_id1 - 1].keypoints, set.images[pair.image_id2 - 1].keypoints};
}

Eigen::Matrix3d UnitNorm(const Eigen::Matrix3d& m) { return m / m.norm(); }

// The true geometry fitted to the verified matches: what a search that finds the right one ends
// with.
class FittedTruth {
 public:
  FittedTruth(const PhotoSet& set, const PhotoSetPair& pair)
      : pair_(pair), cameras_(CamerasOf(set, pair)) {
    camera1_ = cameras_.camera1.camera;
    camera2_ = cameras_.camera2.camera;
    if (!cameras_.IsCalibrated()) {
      // As EstimateTwoView: models of pixels.
      camera1_ = AssumedPinhole(camera1_.width, camera1_.height);
      camera2_ = AssumedPinhole(camera2_.width, camera2_.height);
    }
    std::vector<Eigen::Vector2d> pixels1, pixels2;
    for (const auto& [idx1, idx2] : pair.matches) {
      pixels1.push_back(cameras_.keypoints1.Position(idx1));
      pixels2.push_back(cameras_.keypoints2.Position(idx2));
    }
    rays_ = MatchedRays(camera1_, pixels1, camera2_, pixels2);
    // In the true cameras' rays; in those of assumed ones up to their calibration.
    const image_t id1 = pair.image_id1, id2 = pair.image_id2;
    to_rays1_ = CalibrationMatrix(TrueCamera(set, id1)).inverse() * CalibrationMatrix(camera1_);
    to_rays2_ = CalibrationMatrix(TrueCamera(set, id2)).inverse() * CalibrationMatrix(camera2_);
  }

  TwoViewGeometry Fit() {
    TwoViewGeometry geometry;
    geometry.inlier_matches = pair_.matches;
    const bool is_calibrated = cameras_.IsCalibrated();
    geometry.config = is_calibrated ? TwoViewConfig::kCalibrated : TwoViewConfig::kUncalibrated;
    const Eigen::Matrix3d E = EssentialMatrix(pair_.cam2_from_cam1);
    const Eigen::Matrix3d in_rays = to_rays2_.transpose() * E * to_rays1_;
    const Eigen::Matrix3d epipolar =
        RefineModel(is_calibrated ? TwoViewKind::kEssential : TwoViewKind::kFundamental, in_rays,
                    rays_, kMaxError, kMaxIterations)
            .model;
    const Eigen::Matrix3d inverse1 = CalibrationMatrix(camera1_).inverse();
    const Eigen::Matrix3d K2 = CalibrationMatrix(camera2_);
    geometry.F = UnitNorm(K2.inverse().transpose() * epipolar * inverse1);
    if (is_calibrated) {
      geometry.E = epipolar;
      SetPose(PosesOfEssential(epipolar), &geometry);
    }
    // Where nearly all matches are of one plane or have no parallax, COLMAP's rule.
    const Eigen::Matrix3d rotation =
        to_rays2_.inverse() * pair_.cam2_from_cam1.RotationMatrix() * to_rays1_;
    for (const auto& start : {std::optional(rotation), HomographyOfMost()}) {
      if (!start) continue;
      const Eigen::Matrix3d H =
          RefineModel(TwoViewKind::kHomography, *start, rays_, kMaxError, kMaxIterations).model;
      const auto num_inliers =
          static_cast<double>(InliersOf(TwoViewKind::kHomography, H, rays_, kMaxError).size());
      if (num_inliers <= kMaxShareOfHomography * static_cast<double>(pair_.matches.size()))
        continue;
      geometry.config = is_calibrated ? TwoViewConfig::kPlanar : TwoViewConfig::kPlanarOrPanoramic;
      geometry.H = UnitNorm(K2 * H * inverse1);
      break;
    }
    return geometry;
  }

 private:
  static constexpr double kMaxError = 4.0, kMaxShareOfHomography = 0.8;  // COLMAP's defaults

  static const Camera& TrueCamera(const PhotoSet& set, image_t id) {
    return set.truth.cameras.at(set.truth.images.at(id).camera_id);
  }

  // Of four poses the nearest to the true one.
  void SetPose(const std::vector<Rigid3d>& poses, TwoViewGeometry* geometry) const {
    const Eigen::Vector3d direction = pair_.cam2_from_cam1.translation.normalized();
    double best = -1e300;
    for (const Rigid3d& pose : poses) {
      const double closeness = direction.dot(pose.translation) -
                               pose.rotation.angularDistance(pair_.cam2_from_cam1.rotation);
      if (closeness <= best) continue;
      best = closeness;
      geometry->cam2_from_cam1 = pose;
    }
  }

  // A homography that many matches agree with, by the matches' spread over samples of four: the
  // plane that most matches lie in, if one has most of them.
  std::optional<Eigen::Matrix3d> HomographyOfMost() const {
    TwoViewRansacOptions ransac;
    ransac.max_error_px = kMaxError;
    ransac.min_inlier_ratio = kMaxShareOfHomography;
    ransac.min_num_samples = 1;
    ransac.max_num_samples = 30;
    ransac.multiplier = 1.0;
    ransac.seed = (static_cast<uint64_t>(pair_.image_id1) << 32) | pair_.image_id2;
    const auto fit = FitTwoView(TwoViewKind::kHomography, rays_, ransac);
    if (!fit) return std::nullopt;
    return fit->model;
  }

  const PhotoSetPair& pair_;
  const PairOfCameras cameras_;
  Camera camera1_, camera2_;
  MatchedRays rays_;
  Eigen::Matrix3d to_rays1_, to_rays2_;
};

TwoViewGeometry Estimated(const PhotoSet& set, const PhotoSetPair& pair) {
  const PairOfCameras cameras = CamerasOf(set, pair);
  const uint64_t seed = (static_cast<uint64_t>(pair.image_id1) << 32) | pair.image_id2;
  TwoViewGeometry geometry =
      EstimateTwoView(
          TwoViewOptions(),
          {&cameras.camera1.camera, cameras.camera1.has_prior_focal_length, &cameras.keypoints1},
          {&cameras.camera2.camera, cameras.camera2.has_prior_focal_length, &cameras.keypoints2},
          pair.raw_matches, false, seed)
          .geometry;
  std::sort(geometry.inlier_matches.begin(), geometry.inlier_matches.end());
  return geometry;
}

void WriteImages(const PhotoSet& set, Database* database) {
  const std::string settings(kSyntheticSettings);
  for (size_t k = 0; k < set.cameras.size(); ++k) {
    database->AddCamera(static_cast<camera_t>(k + 1),
                        {set.cameras[k].camera, set.cameras[k].has_prior_focal_length});
  }
  for (const auto& [id, image] : set.truth.images) {
    database->AddImage(id, {image.name, image.camera_id});
    const PhotoSetImage& features = set.images[id - 1];
    database->WriteKeypoints(id, features.keypoints);
    // Without a row COLMAP would describe keypoints of its own.
    database->WriteDescriptors(id, {});
    database->WriteSegments(id, settings, features.segments);
    database->WriteVanishingPoints(id, settings,
                                   {features.vanishing_points, features.vp_of_segment});
    database->WriteLabelMap(id, settings, features.label_map);
  }
}

}  // namespace

TwoViewGeometry GeometryOf(const PhotoSet& set, const PhotoSetPair& pair, GeometrySource source) {
  return source == GeometrySource::kTruth ? FittedTruth(set, pair).Fit() : Estimated(set, pair);
}

PhotoDatabaseReport WritePhotoDatabase(const PhotoSet& set, GeometrySource source, int num_threads,
                                       Database* database) {
  PhotoDatabaseReport report;
  Database::Transaction transaction(database);
  WriteImages(set, database);
  for (size_t begin = 0; begin < set.pairs.size(); begin += kGroupSize) {
    std::vector<TwoViewGeometry> geometries(std::min(kGroupSize, set.pairs.size() - begin));
    ParallelTasks(num_threads, geometries.size(),
                  [&](size_t i) { geometries[i] = GeometryOf(set, set.pairs[begin + i], source); });
    for (size_t i = 0; i < geometries.size(); ++i) {
      const PhotoSetPair& pair = set.pairs[begin + i];
      const TwoViewGeometry& geometry = geometries[i];
      database->WriteMatches(pair.image_id1, pair.image_id2, pair.raw_matches);
      database->WriteTwoViewGeometry(pair.image_id1, pair.image_id2, geometry);
      database->WriteLineMatches(pair.image_id1, pair.image_id2, std::string(kSyntheticSettings),
                                 pair.line_matches);
      report.num_pairs += !geometry.inlier_matches.empty();
      report.num_inliers += geometry.inlier_matches.size();
      report.num_planar += geometry.H && geometry.config != TwoViewConfig::kCalibrated &&
                           geometry.config != TwoViewConfig::kUncalibrated;
    }
  }
  transaction.Commit();
  return report;
}

}  // namespace holba
