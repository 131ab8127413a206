// SPDX-License-Identifier: BSD-3-Clause
// Covariance and Ceres' Covariance agree on a bundle problem with robust losses, held coordinates
// and intrinsics.
#include <ceres/covariance.h>
#include <ceres/problem.h>
#include <gtest/gtest.h>

#include <deque>

#include "holba/base/random.h"
#include "holba/camera/camera_model.h"
#include "holba/residual/point.h"
#include "holba/solver/ceres/ceres_adapters.h"
#include "holba/solver/covariance.h"

namespace holba {
namespace {

TEST(Covariance, IsThatOfCeres) {
  Random random(21);
  Problem problem;
  const CameraModel& model = *FindCameraModel("SIMPLE_RADIAL");
  const std::vector<double> params{700, 500, 480, 0.02};
  const BlockId camera =
      problem.AddBlock("camera", EuclideanOps(4), BlockRole::kIntrinsics, params);
  problem.block(camera).held = 0b0110;
  std::vector<BlockId> poses, points;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Quaterniond q(
        Eigen::AngleAxisd(0.25 * i, Eigen::Vector3d(0.1, 1, 0.05).normalized()));
    const double values[7] = {q.x(), q.y(), q.z(), q.w(), 0.1 * i, 0.05 * i * i, 9.0 + 0.2 * i};
    poses.push_back(problem.AddBlock("pose", OpsOf<PoseManifold>(), BlockRole::kPose, values));
  }
  problem.block(poses[0]).constant = true;
  problem.block(poses[4]).held = 1u << 3;
  auto batch = std::make_unique<KernelBatch<PointResidual>>("point", 2, std::vector<int>{3, 6, 4},
                                                            PointResidual{&model});
  batch->loss = {LossType::kCauchy, 1.0};
  batch->weight = 2.0;
  for (int k = 0; k < 30; ++k) {
    const double X[3] = {random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2)};
    points.push_back(problem.AddBlock("point", OpsOf<Euclidean<3>>(), BlockRole::kFeature, X));
    for (BlockId pose : poses) {
      PointInImage image;
      ASSERT_TRUE(ProjectPoint(model, nullptr, problem.values(pose), params.data(),
                               {X[0], X[1], X[2]}, &image));
      const Eigen::Vector2d noise(random.Normal(0.8), random.Normal(0.8));
      batch->Add(std::array{points.back(), pose, camera}, {image.pixel + noise, nullptr});
    }
  }
  problem.AddBatch(std::move(batch));

  const std::optional<Covariance> covariance = Covariance::Compute(problem, -1);
  ASSERT_TRUE(covariance.has_value());

  ceres::Problem::Options not_owner;
  not_owner.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  not_owner.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  not_owner.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(not_owner);
  std::deque<CeresManifold> manifolds;
  std::deque<CeresResidual> residuals;
  const ResidualBatch& seen = *problem.batches()[0];
  CeresLoss loss(seen.loss, seen.weight);
  ResidualMemory memory;
  memory.Resize(seen.size(), 2);
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    ceres_problem.AddParameterBlock(problem.values(id), block.manifold->ambient,
                                    &manifolds.emplace_back(*block.manifold, block.held));
    if (block.constant) ceres_problem.SetParameterBlockConstant(problem.values(id));
  }
  for (size_t i = 0; i < seen.size(); ++i) {
    ceres_problem.AddResidualBlock(
        &residuals.emplace_back(problem, seen, i, &memory), &loss,
        std::vector<double*>{problem.values(seen.block(i, 0)), problem.values(seen.block(i, 1)),
                             problem.values(seen.block(i, 2))});
  }
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance expected(options);
  std::vector<std::pair<const double*, const double*>> wanted;
  const std::vector<BlockId> tested{poses[1], poses[4], camera, points[0], points[17]};
  for (BlockId id : tested) wanted.emplace_back(problem.values(id), problem.values(id));
  wanted.emplace_back(problem.values(poses[1]), problem.values(camera));
  ASSERT_TRUE(expected.Compute(wanted, &ceres_problem));

  // Among the coordinates that are free.
  const auto expect_equal = [&](BlockId a, BlockId b, const Eigen::MatrixXd& found) {
    const auto free_of = [&](BlockId id) {
      std::vector<int> free;
      for (int i = 0; i < problem.block(id).manifold->tangent; ++i) {
        if (!(problem.block(id).held >> i & 1)) free.push_back(i);
      }
      return free;
    };
    const std::vector<int> rows = free_of(a), cols = free_of(b);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> of_ceres(rows.size(),
                                                                                   cols.size());
    ASSERT_TRUE(expected.GetCovarianceBlockInTangentSpace(problem.values(a), problem.values(b),
                                                          of_ceres.data()));
    const Eigen::MatrixXd ours = found(rows, cols);
    EXPECT_LT((ours - of_ceres).norm(), 1e-8 * of_ceres.norm()) << problem.block(a).kind;
  };
  for (BlockId id : tested) expect_equal(id, id, covariance->Of(id));
  expect_equal(poses[1], camera, covariance->Between(poses[1], camera).value());
  EXPECT_EQ(covariance->Of(poses[0]).norm(), 0.0);
  EXPECT_EQ(covariance->Of(camera).row(1).norm(), 0.0);
}

}  // namespace
}  // namespace holba
