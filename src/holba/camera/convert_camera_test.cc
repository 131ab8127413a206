// SPDX-License-Identifier: BSD-3-Clause
#include "holba/camera/convert_camera.h"

#include <gmock/gmock.h>

#include <cmath>

namespace holba {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;

const CameraModel& Model(const char* name) { return *FindCameraModel(name); }

TEST(ConvertCamera, ModelThatContainsTheOtherIsThatCamera) {
  const std::vector<double> simple = {700.0, 410.0, 290.0, -0.21};
  const auto near = [](double value) { return DoubleNear(value, 1e-6); };
  const auto opencv = ConvertCamera(Model("SIMPLE_RADIAL"), simple, 800.0, 600.0, Model("OPENCV"));
  ASSERT_TRUE(opencv);
  EXPECT_THAT(*opencv, ElementsAre(near(700.0), near(700.0), 410.0, 290.0, near(-0.21), near(0.0),
                                   near(0.0), near(0.0)));
  const auto back = ConvertCamera(Model("OPENCV"), *opencv, 800.0, 600.0, Model("SIMPLE_RADIAL"));
  ASSERT_TRUE(back);
  EXPECT_THAT(*back, ElementsAre(near(700.0), 410.0, 290.0, near(-0.21)));
}

// Where it does not contain it, no camera of the model is nearer: here among cameras about it.
TEST(ConvertCamera, OtherLensIsMetInLeastSquares) {
  const std::vector<double> fisheye = {400.0, 405.0, 398.0, 302.0, 0.01, -0.004, 0.001, 0.0};
  const CameraModel& from = Model("OPENCV_FISHEYE");
  const CameraModel& to = Model("RADIAL");
  const auto found = ConvertCamera(from, fisheye, 800.0, 600.0, to);
  ASSERT_TRUE(found);
  const auto sum_of_squares = [&](const std::vector<double>& params) {
    double sum = 0.0;
    for (int row = 0; row < 17; ++row) {
      for (int col = 0; col < 17; ++col) {
        const Eigen::Vector2d pixel((col + 0.5) / 17 * 800.0, (row + 0.5) / 17 * 600.0);
        Eigen::Vector2d seen;
        EXPECT_TRUE(to.project(params.data(), *from.unproject(fisheye.data(), pixel), &seen));
        sum += (seen - pixel).squaredNorm();
      }
    }
    return sum;
  };
  const double least = sum_of_squares(*found);
  EXPECT_LT(std::sqrt(least / 289), 5.0);  // px
  for (const int idx : {0, 3, 4}) {
    for (const double change : {-1e-3, 1e-3}) {
      std::vector<double> other = *found;
      other[idx] += change * (idx == 0 ? 100.0 : 1.0);
      EXPECT_GT(sum_of_squares(other), least) << idx;
    }
  }
}

}  // namespace
}  // namespace holba
