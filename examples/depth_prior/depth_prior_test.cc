// SPDX-License-Identifier: BSD-3-Clause
#include "depth_prior.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "holba/base/random.h"
#include "holba/geometry/manifold.h"

namespace holba::example {
namespace {

struct Values {
  std::array<double, 3> point;
  std::array<double, 7> pose;
  std::array<double, 1> scale;
  std::array<const double*, 3> Slots() const { return {point.data(), pose.data(), scale.data()}; }
};

Values RandomValues(Random* random) {
  Values v;
  for (double& x : v.point) x = random->Uniform(-1, 1);
  Eigen::Map<Eigen::Vector4d> q(v.pose.data());
  for (int i = 0; i < 4; ++i) q[i] = random->Normal();
  q.normalize();
  for (int i = 4; i < 6; ++i) v.pose[i] = random->Uniform(-1, 1);
  v.pose[6] = random->Uniform(3, 6);  // in front of the camera
  v.scale[0] = random->Normal();
  return v;
}

TEST(DepthPrior, JacobiansAreCentralDifferences) {
  Random random(1);
  const DepthPriorResidual residual{0.05};
  for (int round = 0; round < 20; ++round) {
    const Values at = RandomValues(&random);
    const DepthPriorResidual::Datum datum{random.Normal()};
    double r = 0.0, by_point[3], by_pose[6], by_scale[1];
    const std::array<double*, 3> jacobians{by_point, by_pose, by_scale};
    ASSERT_TRUE(residual.Evaluate(datum, at.Slots().data(), &r, jacobians.data()));
    const auto value = [&](const Values& v) {
      double out = 0.0;
      const std::array<double*, 3> none{};
      EXPECT_TRUE(residual.Evaluate(datum, v.Slots().data(), &out, none.data()));
      return out;
    };
    const double step = 1e-6;
    for (int i = 0; i < 10; ++i) {
      std::array<double, 2> sides;
      for (int side = 0; side < 2; ++side) {
        Values moved = at;
        const double change = side == 0 ? -step : step;
        double delta[6] = {};
        if (i < 3) {
          moved.point[i] += change;
        } else if (i < 9) {
          delta[i - 3] = change;
          PoseManifold::Plus(at.pose.data(), delta, moved.pose.data());
        } else {
          moved.scale[0] += change;
        }
        sides[side] = value(moved);
      }
      const double numeric = (sides[1] - sides[0]) / (2.0 * step);
      const double exact = i < 3 ? by_point[i] : i < 9 ? by_pose[i - 3] : by_scale[0];
      EXPECT_NEAR(numeric, exact, 1e-7 * (1.0 + std::abs(exact))) << i;
    }
  }
}

TEST(DepthPrior, IsZeroWhereTheScaledDepthIsThatOfTheNetworkAndAbsentBehindTheCamera) {
  const DepthPriorResidual residual{0.05};
  Values at{{0, 0, 0}, {0, 0, 0, 1, 0, 0, 4}, {std::log(2.0)}};
  double r = 1.0;
  const std::array<double*, 3> none{};
  ASSERT_TRUE(residual.Evaluate({std::log(2.0)}, at.Slots().data(), &r, none.data()));
  EXPECT_NEAR(r, 0.0, 1e-14);
  at.pose[6] = -4.0;
  EXPECT_FALSE(residual.Evaluate({std::log(2.0)}, at.Slots().data(), &r, none.data()));
}

}  // namespace
}  // namespace holba::example
