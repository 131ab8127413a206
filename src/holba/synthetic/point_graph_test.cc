// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/point_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "holba/base/error.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

PointGraphOptions SmallGraph(PointGraphKind kind, bool camera_per_image = false) {
  PointGraphOptions options;
  options.kind = kind;
  options.num_images = 60;
  options.observations_per_image = 150;
  options.camera_per_image = camera_per_image;
  return options;
}

size_t NumObservations(const Reconstruction& model) {
  size_t count = 0;
  for (const auto& [id, point] : model.points3D) count += point.track.size();
  return count;
}

// Differences of pixels and projections, both coordinates of every observation.
std::vector<double> ReprojectionErrors(const Reconstruction& model) {
  std::vector<double> errors;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& o : point.track) {
      const Image& image = model.images.at(o.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      Eigen::Vector2d pixel;
      EXPECT_TRUE(
          camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel));
      const Eigen::Vector2d error = pixel - image.points2D[o.point2D_idx].xy;
      errors.push_back(error.x());
      errors.push_back(error.y());
    }
  }
  return errors;
}

double Rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double x : values) sum += x * x;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

bool HaveSameNumbers(const Reconstruction& a, const Reconstruction& b) {
  if (a.points3D.size() != b.points3D.size() || a.images.size() != b.images.size()) return false;
  for (const auto& [id, point] : a.points3D) {
    const Point3D& other = b.points3D.at(id);
    if (point.xyz != other.xyz || point.track.size() != other.track.size()) return false;
    for (size_t i = 0; i < point.track.size(); ++i) {
      const PointObservation &p = point.track[i], &q = other.track[i];
      if (p.image_id != q.image_id || p.point2D_idx != q.point2D_idx) return false;
    }
  }
  for (const auto& [id, image] : a.images) {
    const Image& other = b.images.at(id);
    if (image.cam_from_world.rotation.coeffs() != other.cam_from_world.rotation.coeffs() ||
        image.cam_from_world.translation != other.cam_from_world.translation ||
        image.points2D.size() != other.points2D.size()) {
      return false;
    }
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      if (image.points2D[i].xy != other.points2D[i].xy) return false;
    }
  }
  return true;
}

class EveryPointGraph : public testing::TestWithParam<std::pair<PointGraphKind, bool>> {
 protected:
  PointGraphOptions Options() const { return SmallGraph(GetParam().first, GetParam().second); }
};

TEST_P(EveryPointGraph, HasTheImagesAndObservationsAskedFor) {
  const Reconstruction model = MakePointGraph(Options()).truth;
  EXPECT_EQ(model.images.size(), 60u);
  EXPECT_EQ(model.frames.size(), 60u);
  EXPECT_EQ(model.cameras.size(), GetParam().second ? 60u : 1u);
  // The last track may go beyond.
  EXPECT_GE(NumObservations(model), 9000u);
  EXPECT_LT(NumObservations(model), 9060u);
  for (const auto& [id, point] : model.points3D) EXPECT_GE(point.track.size(), 2u);
}

TEST_P(EveryPointGraph, IsConsistentAtTruthAndStart) {
  const SyntheticProblem problem = MakePointGraph(Options());
  EXPECT_EQ(problem.truth.FindInconsistency(), std::nullopt);
  EXPECT_EQ(problem.perturbed.FindInconsistency(), std::nullopt);
}

TEST_P(EveryPointGraph, ObservesTheTruthWithTheNoiseAskedFor) {
  PointGraphOptions options = Options();
  options.observation_noise_px = 0.8;
  EXPECT_NEAR(Rms(ReprojectionErrors(MakePointGraph(options).truth)), 0.8, 0.02);
  options.observation_noise_px = 0.0;
  EXPECT_LT(Rms(ReprojectionErrors(MakePointGraph(options).truth)), 1e-9);
}

TEST_P(EveryPointGraph, StartsFromTheTruthMovedByTheNoiseAskedFor) {
  const PointGraphOptions options = Options();
  const SyntheticProblem problem = MakePointGraph(options);
  std::vector<double> centres, rotations_deg, points, log_focals;
  for (const auto& [id, image] : problem.truth.images) {
    const Image& moved = problem.perturbed.images.at(id);
    const Eigen::Vector3d c = problem.perturbed.CameraCentre(id) - problem.truth.CameraCentre(id);
    const Eigen::Vector3d w =
        LogRotation(moved.cam_from_world.rotation * image.cam_from_world.rotation.conjugate());
    for (int k = 0; k < 3; ++k) {
      centres.push_back(c[k]);
      rotations_deg.push_back(RadToDeg(w[k]));
    }
    log_focals.push_back(std::log(problem.perturbed.cameras.at(image.camera_id).params[0] /
                                  problem.truth.cameras.at(image.camera_id).params[0]));
  }
  for (const auto& [id, point] : problem.truth.points3D) {
    const Eigen::Vector3d d = problem.perturbed.points3D.at(id).xyz - point.xyz;
    points.insert(points.end(), d.begin(), d.end());
  }
  // 180 and some thousand numbers.
  EXPECT_NEAR(Rms(centres), options.centre_noise, 0.2 * options.centre_noise);
  EXPECT_NEAR(Rms(rotations_deg), options.rotation_noise_deg, 0.2 * options.rotation_noise_deg);
  EXPECT_NEAR(Rms(points), options.point_noise, 0.05 * options.point_noise);
  EXPECT_NEAR(Rms(log_focals), GetParam().second ? options.focal_length_noise : 0.0, 0.004);
}

TEST_P(EveryPointGraph, IsTheSameForTheSameSeedAndAnotherForAnother) {
  PointGraphOptions options = Options();
  const SyntheticProblem once = MakePointGraph(options), again = MakePointGraph(options);
  EXPECT_TRUE(HaveSameNumbers(once.truth, again.truth));
  EXPECT_TRUE(HaveSameNumbers(once.perturbed, again.perturbed));
  EXPECT_FALSE(HaveSameNumbers(once.truth, once.perturbed));
  options.seed = 1;
  EXPECT_FALSE(HaveSameNumbers(once.truth, MakePointGraph(options).truth));
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryPointGraph,
                         testing::Values(std::pair(PointGraphKind::kSequence, false),
                                         std::pair(PointGraphKind::kSequence, true),
                                         std::pair(PointGraphKind::kCollection, false),
                                         std::pair(PointGraphKind::kCollection, true)));

// Mean over observations of the length of the track that they belong to.
double MeanTrackOfObservations(const Reconstruction& model) {
  double sum = 0.0;
  for (const auto& [id, point] : model.points3D) {
    sum += static_cast<double>(point.track.size() * point.track.size());
  }
  return sum / static_cast<double>(NumObservations(model));
}

TEST(Sequence, CouplesNeighboursOnly) {
  PointGraphOptions options = SmallGraph(PointGraphKind::kSequence);
  options.num_images = 200;
  const Reconstruction model = MakePointGraph(options).truth;
  for (const auto& [id, point] : model.points3D) {
    EXPECT_LE(point.track.back().image_id - point.track.front().image_id, 40u);
  }
  EXPECT_GT(MeanTrackOfObservations(model), 5.0);
  EXPECT_LT(MeanTrackOfObservations(model), 12.0);
}

TEST(Collection, HasLongTracksAndPopularImages) {
  PointGraphOptions options = SmallGraph(PointGraphKind::kCollection);
  options.num_images = 200;
  const Reconstruction model = MakePointGraph(options).truth;
  EXPECT_GT(MeanTrackOfObservations(model), 10.0);
  EXPECT_LT(MeanTrackOfObservations(model), 30.0);
  size_t most = 0;
  for (const auto& [id, image] : model.images) most = std::max(most, image.points2D.size());
  EXPECT_GT(most, 450u);  // three times the mean
}

TEST(PointGraph, RefusesImpossibleOptions) {
  PointGraphOptions options;
  options.num_images = 3;
  EXPECT_THROW(MakePointGraph(options), InputError);
  options = {};
  options.observations_per_image = 10;
  EXPECT_THROW(MakePointGraph(options), InputError);
  options = {};
  options.camera_model = "UNKNOWN";
  EXPECT_THROW(MakePointGraph(options), InputError);
}

}  // namespace
}  // namespace holba
