// SPDX-License-Identifier: BSD-3-Clause
#include "holba/evaluation/alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "holba/evaluation/test_scenes.h"

namespace holba {
namespace {

void ExpectNear(const Sim3d& a, const Sim3d& b, double tolerance) {
  EXPECT_NEAR(a.scale, b.scale, tolerance * b.scale);
  EXPECT_LT(LogRotation(a.rotation * b.rotation.conjugate()).norm(), tolerance);
  EXPECT_LT((a.translation - b.translation).norm(), tolerance * (1.0 + b.translation.norm()));
}

std::vector<Eigen::Vector3d> Moved(const std::vector<Eigen::Vector3d>& points, const Sim3d& sim) {
  std::vector<Eigen::Vector3d> moved;
  for (const Eigen::Vector3d& X : points) moved.push_back(sim * X);
  return moved;
}

TEST(EstimateSimilarity, RecoversTheSimilarityOfExactPoints) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Eigen::Vector3d> from;
    for (int i = 0; i < 3 + trial; ++i) from.push_back(RandomVector(&random));
    const Sim3d sim = RandomSimilarity(&random);
    const auto estimate = EstimateSimilarity(from, Moved(from, sim));
    ASSERT_TRUE(estimate);
    ExpectNear(*estimate, sim, 1e-10);
  }
}

TEST(EstimateSimilarity, IsARotationAndNoReflectionForPlanarAndMirroredPoints) {
  Random random(2);
  std::vector<Eigen::Vector3d> planar, mirrored;
  for (int i = 0; i < 8; ++i) {
    planar.push_back(RandomVector(&random).cwiseProduct(Eigen::Vector3d(1, 1, 0)));
  }
  const Sim3d sim = RandomSimilarity(&random);
  ExpectNear(*EstimateSimilarity(planar, Moved(planar, sim)), sim, 1e-9);

  std::vector<Eigen::Vector3d> from;
  for (int i = 0; i < 8; ++i) from.push_back(RandomVector(&random));
  for (const Eigen::Vector3d& X : from) mirrored.push_back(-X);
  if (const auto estimate = EstimateSimilarity(from, mirrored)) {
    EXPECT_NEAR(estimate->rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
  }
}

TEST(EstimateSimilarity, IsTheLeastSquaresSolutionOfNoisyPoints) {
  Random random(3);
  std::vector<Eigen::Vector3d> from, to;
  const Sim3d sim = RandomSimilarity(&random);
  for (int i = 0; i < 30; ++i) {
    from.push_back(RandomVector(&random));
    to.push_back(sim * from.back() + 0.1 * RandomVector(&random));
  }
  const auto cost = [&](const Sim3d& s) {
    double sum = 0;
    for (size_t i = 0; i < from.size(); ++i) sum += (to[i] - s * from[i]).squaredNorm();
    return sum;
  };
  const Sim3d best = *EstimateSimilarity(from, to);
  for (int k = 0; k < 7; ++k) {
    for (const double step : {1e-4, -1e-4}) {
      Sim3d moved = best;
      if (k < 3) moved.rotation = ExpRotation(step * Eigen::Vector3d::Unit(k)) * best.rotation;
      if (k >= 3 && k < 6) moved.translation[k - 3] += step;
      if (k == 6) moved.scale += step;
      EXPECT_GT(cost(moved), cost(best)) << k;
    }
  }
}

TEST(EstimateSimilarity, FailsWherePointsLeaveItOpen) {
  Random random(4);
  const Sim3d sim = RandomSimilarity(&random);
  std::vector<Eigen::Vector3d> points;
  EXPECT_FALSE(EstimateSimilarity(points, points));
  for (int i = 0; i < 5; ++i) {
    points.push_back(Eigen::Vector3d(0.5, -1, 2) + i * Eigen::Vector3d(1, 2, 3));
    EXPECT_FALSE(EstimateSimilarity(points, Moved(points, sim))) << "on one line: " << i + 1;
  }
  const std::vector<Eigen::Vector3d> same(4, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(EstimateSimilarity(same, same));
  EXPECT_FALSE(EstimateSimilarity(points, same));
}

TEST(AlignReconstructions, RecoversTheSimilarityFromAnyNumberOfImagesThatFixesIt) {
  Random random(5);
  for (const int num_images : {2, 3, 4, 20}) {
    const Reconstruction truth = RandomCameras(num_images, &random);
    const Sim3d sim = RandomSimilarity(&random);
    const auto estimate = AlignReconstructions(Moved(truth, sim), truth);
    ASSERT_TRUE(estimate);
    ExpectNear(*estimate, sim.Inverse(), 1e-9);
  }
}

TEST(AlignReconstructions, TakesTheScaleAsItIsForOneImage) {
  Random random(6);
  const Reconstruction truth = RandomCameras(1, &random);
  Sim3d sim = RandomSimilarity(&random);
  sim.scale = 1.0;
  ExpectNear(*AlignReconstructions(Moved(truth, sim), truth), sim.Inverse(), 1e-12);
  EXPECT_FALSE(AlignReconstructions(Reconstruction(), truth));
}

TEST(AlignReconstructions, TakesTheTurnAboutAStraightTrajectoryFromTheRotations) {
  Random random(7);
  Reconstruction truth;
  for (int i = 0; i < 10; ++i) {
    AddImage(std::to_string(i),
             LookingFrom({0.5 * i, 1.0, 2.0}, ExpRotation(RandomVector(&random))), &truth);
  }
  const Sim3d sim = RandomSimilarity(&random);
  ExpectNear(*AlignReconstructions(Moved(truth, sim), truth), sim.Inverse(), 1e-9);
}

TEST(AlignReconstructions, UsesSharedPointsUnlessTheyAreFewOrUnwanted) {
  Random random(8);
  Reconstruction truth = RandomCameras(6, &random);
  for (point3D_t id = 1; id <= 8; ++id) {
    Point3D point;
    point.xyz = RandomVector(&random);
    truth.points3D.Add(id, point);
  }
  // The cameras as they are, the points moved away: whoever counts points follows these, which are
  // more.
  Reconstruction model = truth;
  for (auto& [id, point] : model.points3D) point.xyz += Eigen::Vector3d(0.5, 0, 0);
  const auto shift = [&](AlignmentBasis basis) {
    return AlignReconstructions(model, truth, basis)->translation.norm();
  };
  EXPECT_LT(shift(AlignmentBasis::kCentres), 1e-12);
  EXPECT_NEAR(shift(AlignmentBasis::kCentresAndPoints), 0.5, 1e-12);
  EXPECT_EQ(shift(AlignmentBasis::kAuto), shift(AlignmentBasis::kCentresAndPoints));
  model.points3D.RemoveIf([](point3D_t id, const Point3D&) { return id > 2; });
  EXPECT_LT(shift(AlignmentBasis::kAuto), 1e-12);
}

// Cameras and points with noise of 1 %.
Reconstruction NoisyScene(const Reconstruction& truth, Random* random) {
  Reconstruction model = truth;
  for (auto& [id, image] : model.images) {
    const Eigen::Vector3d centre = image.cam_from_world.OriginInA() + 0.01 * RandomVector(random);
    image.cam_from_world = LookingFrom(centre, image.cam_from_world.rotation);
  }
  for (auto& [id, point] : model.points3D) point.xyz += 0.01 * RandomVector(random);
  return model;
}

Reconstruction SceneWithPoints(int num_images, Random* random) {
  Reconstruction truth = RandomCameras(num_images, random);
  for (point3D_t id = 1; id <= 60; ++id) {
    Point3D point;
    point.xyz = RandomVector(random);
    truth.points3D.Add(id, point);
  }
  return truth;
}

TEST(AlignReconstructions, IsTheLeastSquaresSolutionOfAllThatIsNotFarOff) {
  Random random(9);
  const Reconstruction truth = SceneWithPoints(20, &random);
  const Reconstruction model = NoisyScene(truth, &random);
  std::vector<Eigen::Vector3d> from, to;
  for (const auto& [id, image] : truth.images) {
    from.push_back(model.images.at(id).cam_from_world.OriginInA());
    to.push_back(image.cam_from_world.OriginInA());
  }
  for (const auto& [id, point] : truth.points3D) {
    from.push_back(model.points3D.at(id).xyz);
    to.push_back(point.xyz);
  }
  const auto alignment =
      AlignReconstructions(model, truth, PairImages(model, truth), AlignmentBasis::kAuto);
  EXPECT_EQ(alignment->num_left_out, 0u);
  EXPECT_EQ(alignment->num_positions, 80u);
  const Sim3d sim = *EstimateSimilarity(from, to);
  EXPECT_EQ(alignment->truth_from_model.scale, sim.scale);
  EXPECT_EQ(alignment->truth_from_model.translation, sim.translation);
  EXPECT_EQ(alignment->truth_from_model.rotation.coeffs(), sim.rotation.coeffs());
}

TEST(AlignReconstructions, IsNotDecidedByWhatIsFarOff) {
  Random random(10);
  Reconstruction truth = SceneWithPoints(20, &random);
  Reconstruction model = NoisyScene(truth, &random);
  const Sim3d sim = *AlignReconstructions(model, truth);
  // A point near the horizon, whose depth is not known.
  truth.points3D.at(1).xyz = {3000, 0, 4000};
  model.points3D.at(1).xyz = {6000, 100, 8000};
  truth.points3D.at(2).xyz = {0, 500, 0};
  auto alignment =
      AlignReconstructions(model, truth, PairImages(model, truth), AlignmentBasis::kAuto);
  EXPECT_EQ(alignment->num_left_out, 2u);
  ExpectNear(alignment->truth_from_model, sim, 1e-3);
  // A third of the cameras are lost.
  for (image_t id = 1; id <= 6; ++id)
    model.images.at(id).cam_from_world.translation += 50.0 * RandomVector(&random);
  alignment =
      AlignReconstructions(model, truth, PairImages(model, truth), AlignmentBasis::kCentres);
  EXPECT_EQ(alignment->num_left_out, 6u);
  EXPECT_EQ(alignment->num_positions, 20u);
  ExpectNear(alignment->truth_from_model, sim, 0.02);
}

TEST(AlignReconstructions, LeavesACameraOutThatStraysFromAStraightTrajectory) {
  Random random(11);
  Reconstruction truth;
  for (int i = 0; i < 10; ++i) {
    AddImage(std::to_string(i),
             LookingFrom({0.5 * i, 1.0, 2.0}, ExpRotation(RandomVector(&random))), &truth);
  }
  Reconstruction model = truth;
  Rigid3d& lost = model.images.at(4).cam_from_world;
  lost = LookingFrom({3.0, 80.0, 5.0}, ExpRotation(RandomVector(&random)));
  const auto alignment =
      AlignReconstructions(model, truth, PairImages(model, truth), AlignmentBasis::kAuto);
  EXPECT_EQ(alignment->num_left_out, 1u);
  ExpectNear(alignment->truth_from_model, Sim3d(), 1e-9);
}

}  // namespace
}  // namespace holba
