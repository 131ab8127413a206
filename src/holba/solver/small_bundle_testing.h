// SPDX-License-Identifier: BSD-3-Clause
// A small bundle adjustment problem with known truth, for tests of solvers.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "holba/base/random.h"
#include "holba/camera/camera_model.h"
#include "holba/problem/problem.h"
#include "holba/residual/point.h"

namespace holba {

// Cameras on an arc around a cloud of points. The first pose is held and one coordinate of the last
// one's translation. With a `window` each point is seen by so many neighbouring cameras only.
struct SmallBundle {
  Problem problem;
  std::vector<double> truth;
  std::vector<BlockId> poses, points;
  BlockId camera;

  explicit SmallBundle(double noise_px, bool refine_focal_length = true,
                       LossType loss = LossType::kTrivial, int num_points = 40, int num_poses = 6,
                       int window = 0) {
    Random random(11);
    const CameraModel& model = *FindCameraModel("PINHOLE");
    const std::vector<double> params{700, 720, 500, 480};
    camera = problem.AddBlock("camera", EuclideanOps(4), BlockRole::kIntrinsics, params);
    problem.block(camera).held = 0b1100;
    problem.block(camera).constant = !refine_focal_length;
    for (int i = 0; i < num_poses; ++i) {
      const double angle = 0.25 * i;
      const Eigen::Quaterniond q(
          Eigen::AngleAxisd(angle, Eigen::Vector3d(0.1, 1, 0.05).normalized()));
      const double values[7] = {q.x(), q.y(), q.z(), q.w(), 0.1 * i, 0.05 * i * i, 9.0 + 0.2 * i};
      poses.push_back(problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values));
    }
    problem.block(poses[0]).constant = true;
    problem.block(poses.back()).held = 1u << 3;
    auto batch = std::make_unique<KernelBatch<PointResidual>>("point", 2, std::vector<int>{3, 6, 4},
                                                              PointResidual{&model});
    batch->loss = {loss, 1.0};
    for (int k = 0; k < num_points; ++k) {
      const double X[3] = {random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2)};
      points.push_back(problem.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature, X));
      const int first = window > 0 ? k % (num_poses - window + 1) : 0;
      const int end = window > 0 ? first + window : num_poses;
      for (int i = first; i < end; ++i) {
        const BlockId pose = poses[i];
        PointInImage image;
        EXPECT_TRUE(ProjectPoint(model, nullptr, problem.values(pose), params.data(),
                                 {X[0], X[1], X[2]}, &image));
        const Eigen::Vector2d noise(random.Normal(noise_px), random.Normal(noise_px));
        batch->Add(std::array{points.back(), pose, camera}, {image.pixel + noise, nullptr});
      }
    }
    problem.AddBatch(std::move(batch));
    truth = problem.state();
  }

  // Moves all free tangent coordinates away from the truth.
  void Perturb(uint64_t seed) {
    Random random(seed);
    problem.state() = truth;
    for (BlockId id = 0; id < problem.num_blocks(); ++id) {
      const ParameterBlock& block = problem.block(id);
      if (block.FreeTangent() == 0) continue;
      const double sigma = block.role == BlockRole::kPose      ? 0.03
                           : block.role == BlockRole::kFeature ? 0.1
                                                               : 10.0;
      std::vector<double> delta(block.manifold->tangent), moved(block.manifold->ambient);
      for (int i = 0; i < block.manifold->tangent; ++i)
        delta[i] = block.held >> i & 1 ? 0.0 : random.Normal(sigma);
      block.manifold->plus(problem.values(id), delta.data(), moved.data());
      std::copy(moved.begin(), moved.end(), problem.values(id));
    }
  }
};

}  // namespace holba
