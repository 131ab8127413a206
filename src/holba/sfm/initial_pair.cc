// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/initial_pair.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/estimation/two_view/relative_pose.h"
#include "holba/sfm/calibrated_pair.h"

namespace holba {
namespace {

ImagePair Ordered(image_t a, image_t b) { return {std::min(a, b), std::max(a, b)}; }

// A geometry that was estimated, or why it is none.
struct Trial {
  InitialPair pair;
  const char* failure = nullptr;
};

class InitialPairSearch {
 public:
  InitialPairSearch(const InitialPairOptions& options, int random_seed, MapperState* state)
      : options_(options), random_seed_(random_seed), state_(*state), model_(state->model()) {}

  std::optional<InitialPair> Run(int num_threads, InitialPairReport* report) {
    // Tried in parallel, a batch at a time; the first in order wins.
    const size_t batch_size = 2 * static_cast<size_t>(NumThreads(num_threads));
    const size_t max_num_tried = report->num_tried + static_cast<size_t>(options_.max_num_trials);
    for (const image_t first : FirstImages()) {
      ++state_.num_initial_trials[first];
      const std::vector<image_t> seconds = SecondImages(first);
      for (size_t begin = 0; begin < seconds.size(); begin += batch_size) {
        const size_t size = std::min(batch_size, seconds.size() - begin);
        std::vector<Trial> trials(size);
        ParallelTasks(num_threads, size,
                      [&](size_t i) { trials[i] = Try(first, seconds[begin + i]); });
        for (const Trial& trial : trials) {
          state_.tried_initial_pairs.insert(Ordered(first, trial.pair.image_id2));
          ++report->num_tried;
          if (trial.failure == nullptr) return trial.pair;
          ++report->dropped[trial.failure];
        }
        if (report->num_tried >= max_num_tried) return std::nullopt;
      }
    }
    return std::nullopt;
  }

 private:
  bool MayStart(image_t image_id) const {
    return model_.unregistered_images.contains(image_id) &&
           !state_.images_of_earlier_models.contains(image_id);
  }

  bool IsKnown(image_t image_id) const {
    return state_.IsFocalLengthKnown(model_.FindImage(image_id)->camera_id);
  }

  // Other sensors of the frame have known poses: the scale of the rig.
  bool HasScale(image_t image_id) const { return state_.ImagesOfFrame(image_id).size() > 1; }
  bool AreOfOneFrame(image_t a, image_t b) const {
    return model_.FindImage(a)->frame_id == model_.FindImage(b)->frame_id;
  }

  std::vector<image_t> FirstImages() const {
    if (options_.image_id1 >= 0) {
      const auto given = static_cast<image_t>(options_.image_id1);
      return MayStart(given) ? std::vector{given} : std::vector<image_t>();
    }
    std::vector<image_t> images;
    for (const image_t id : state_.graph().image_ids()) {
      const auto tried = state_.num_initial_trials.find(id);
      const int trials = tried != state_.num_initial_trials.end() ? tried->second : 0;
      if (trials < options_.max_trials_per_image && MayStart(id) &&
          state_.graph().NumCorrespondences(id) > 0)
        images.push_back(id);
    }
    std::stable_sort(images.begin(), images.end(), [&](image_t a, image_t b) {
      if (IsKnown(a) != IsKnown(b)) return IsKnown(a);
      return state_.graph().NumCorrespondences(a) > state_.graph().NumCorrespondences(b);
    });
    return images;
  }

  std::vector<image_t> SecondImages(image_t first) const {
    std::vector<image_t> images;
    for (const MatchedImage& matched : state_.graph().MatchedImages(first)) {
      if (options_.image_id2 >= 0 && matched.image_id != static_cast<image_t>(options_.image_id2))
        continue;
      if (!MayStart(matched.image_id) ||
          matched.num_matches < static_cast<size_t>(options_.min_num_inliers) ||
          state_.tried_initial_pairs.contains(Ordered(first, matched.image_id)) ||
          state_.failed_initial_pairs.contains(Ordered(first, matched.image_id)))
        continue;
      images.push_back(matched.image_id);
    }
    std::stable_sort(images.begin(), images.end(), [&](image_t a, image_t b) {
      const bool a_of_frame = AreOfOneFrame(first, a), b_of_frame = AreOfOneFrame(first, b);
      if (a_of_frame != b_of_frame) return a_of_frame;
      if (IsKnown(a) != IsKnown(b)) return IsKnown(a);
      return state_.graph().NumMatches(first, a) > state_.graph().NumMatches(first, b);
    });
    return images;
  }

  Trial Try(image_t first, image_t second) const {
    Trial trial;
    trial.pair.image_id1 = first;
    trial.pair.image_id2 = second;
    const Image &image1 = *model_.FindImage(first), &image2 = *model_.FindImage(second);
    const PointMatches matches = state_.graph().MatchesBetween(first, second);
    if (AreOfOneFrame(first, second)) return OfRig(matches, image1, image2, trial);
    if (HasScale(first) || HasScale(second)) {
      // Two views do not know how their baseline compares to the rig's.
      trial.failure =
          "frames of a rig with more than one image, whose scale two images cannot tell";
      return trial;
    }
    const TwoViewResult result =
        EstimateCalibratedPair({.min_num_inliers = options_.min_num_inliers,
                                .max_error_px = options_.max_error_px,
                                .random_seed = random_seed_},
                               state_, first, second);
    trial.pair.num_inliers = result.geometry.inlier_matches.size();
    trial.pair.median_angle_deg = result.median_angle_deg;
    if (trial.pair.num_inliers < static_cast<size_t>(options_.min_num_inliers)) {
      trial.failure = "too few inliers";
    } else if (!result.geometry.cam2_from_cam1 ||
               result.geometry.config == TwoViewConfig::kPanoramic) {
      trial.failure = "no relative pose but a rotation";
    } else if (!(result.median_angle_deg > options_.min_angle_deg)) {
      trial.failure = "rays meet at too small angles";
    } else {
      trial.pair.cam2_from_cam1 = *result.geometry.cam2_from_cam1;
      const Eigen::Vector3d& t = trial.pair.cam2_from_cam1.translation;
      if (std::abs(t.z()) >= options_.max_forward_motion * t.norm())
        trial.failure = "the motion is along the viewing direction";
    }
    return trial;
  }

  // The pose is the rig's: the matches must agree with it.
  Trial OfRig(const PointMatches& matches, const Image& image1, const Image& image2,
              Trial trial) const {
    const Rigid3d pose = model_.SensorFromRig(image2) * model_.SensorFromRig(image1).Inverse();
    trial.pair.cam2_from_cam1 = pose;
    if (!(pose.translation.norm() > 0.0)) {
      trial.failure = "no relative pose but a rotation";
      return trial;
    }
    const Camera &camera1 = model_.cameras.at(image1.camera_id),
                 &camera2 = model_.cameras.at(image2.camera_id);
    std::vector<double> angles_deg;
    for (const auto& [idx1, idx2] : matches) {
      const auto ray1 = camera1.model->unproject(camera1.params.data(), image1.points2D[idx1].xy);
      const auto ray2 = camera2.model->unproject(camera2.params.data(), image2.points2D[idx2].xy);
      if (!ray1 || !ray2) continue;
      const auto meeting = MeetRays(pose, *ray1, *ray2);
      if (!meeting || meeting->depth1 <= 0.0 || meeting->depth2 <= 0.0) continue;
      const Eigen::Vector3d in_cam1 = meeting->depth1 * *ray1;
      Eigen::Vector2d pixel;
      if (!camera2.model->project(camera2.params.data(), pose * in_cam1, &pixel) ||
          (pixel - image2.points2D[idx2].xy).norm() > 2.0 * options_.max_error_px)
        continue;
      angles_deg.push_back(meeting->angle_deg);
    }
    trial.pair.num_inliers = angles_deg.size();
    if (angles_deg.size() < static_cast<size_t>(options_.min_num_inliers)) {
      trial.failure = "too few inliers";
      return trial;
    }
    std::nth_element(angles_deg.begin(), angles_deg.begin() + angles_deg.size() / 2,
                     angles_deg.end());
    trial.pair.median_angle_deg = angles_deg[angles_deg.size() / 2];
    // The baseline is known, so that small angles give depths of known uncertainty, at least those
    // that points must have anyway.
    if (!(trial.pair.median_angle_deg > std::min(options_.min_angle_deg, kMinRigAngleDeg)))
      trial.failure = "rays meet at too small angles";
    return trial;
  }

  // COLMAP's smallest angle of a point.
  static constexpr double kMinRigAngleDeg = 1.5;

  const InitialPairOptions& options_;
  const int random_seed_;
  MapperState& state_;
  const Reconstruction& model_;
};

}  // namespace

std::optional<InitialPair> FindInitialPair(const InitialPairOptions& options, int random_seed,
                                           int num_threads, MapperState* state,
                                           InitialPairReport* report) {
  return InitialPairSearch(options, random_seed, state).Run(num_threads, report);
}

void RegisterInitialPair(const InitialPair& pair, MapperState* state) {
  const Reconstruction& model = state->model();
  const Image &image1 = model.unregistered_images.at(pair.image_id1),
              &image2 = model.unregistered_images.at(pair.image_id2);
  const frame_t frame1 = image1.frame_id, frame2 = image2.frame_id;
  const Rigid3d rig_from_cam1 = model.SensorFromRig(image1).Inverse(),
                rig_from_cam2 = model.SensorFromRig(image2).Inverse();
  state->RegisterFrame(frame1, rig_from_cam1);
  if (frame2 != frame1) state->RegisterFrame(frame2, rig_from_cam2 * pair.cam2_from_cam1);
}

}  // namespace holba
