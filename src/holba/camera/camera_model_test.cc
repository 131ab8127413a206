// SPDX-License-Identifier: BSD-3-Clause
// The list of camera models, and the laws that hold between particular models.
#include "holba/camera/camera_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string_view>
#include <vector>

#include "holba/camera/camera_models.h"
#include "holba/camera/snavely.h"

namespace holba {
namespace {

using ::testing::ElementsAreArray;
using Ints = std::vector<int>;

struct Row {
  int id;
  std::string_view name, param_names;
  Ints focal, principal_point, extra;
};

// COLMAP's: params_info, focal_length_idxs(), principal_point_idxs() and extra_params_idxs() of
// pycolmap 4.2.1.
const Row kTable[] = {
    {0, "SIMPLE_PINHOLE", "f cx cy", {0}, {1, 2}, {}},
    {1, "PINHOLE", "fx fy cx cy", {0, 1}, {2, 3}, {}},
    {2, "SIMPLE_RADIAL", "f cx cy k", {0}, {1, 2}, {3}},
    {3, "RADIAL", "f cx cy k1 k2", {0}, {1, 2}, {3, 4}},
    {4, "OPENCV", "fx fy cx cy k1 k2 p1 p2", {0, 1}, {2, 3}, {4, 5, 6, 7}},
    {5, "OPENCV_FISHEYE", "fx fy cx cy k1 k2 k3 k4", {0, 1}, {2, 3}, {4, 5, 6, 7}},
    {6,
     "FULL_OPENCV",
     "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
     {0, 1},
     {2, 3},
     {4, 5, 6, 7, 8, 9, 10, 11}},
    {7, "FOV", "fx fy cx cy omega", {0, 1}, {2, 3}, {4}},
    {8, "SIMPLE_RADIAL_FISHEYE", "f cx cy k", {0}, {1, 2}, {3}},
    {9, "RADIAL_FISHEYE", "f cx cy k1 k2", {0}, {1, 2}, {3, 4}},
    {10,
     "THIN_PRISM_FISHEYE",
     "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1",
     {0, 1},
     {2, 3},
     {4, 5, 6, 7, 8, 9, 10, 11}},
    {11,
     "RAD_TAN_THIN_PRISM_FISHEYE",
     "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3",
     {0, 1},
     {2, 3},
     {4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}},
    {12, "SIMPLE_DIVISION", "f cx cy k", {0}, {1, 2}, {3}},
    {13, "DIVISION", "fx fy cx cy k", {0, 1}, {2, 3}, {4}},
    {14, "SIMPLE_FISHEYE", "f cx cy", {0}, {1, 2}, {}},
    {15, "FISHEYE", "fx fy cx cy", {0, 1}, {2, 3}, {}},
    {16, "EUCM", "fx fy cx cy alpha beta", {0, 1}, {2, 3}, {4, 5}},
    {17, "EQUIRECTANGULAR", "w h", {}, {}, {}},
};

Ints ToVector(std::span<const int> values) { return Ints(values.begin(), values.end()); }

TEST(CameraModels, IdsNamesAndParametersAreThoseOfColmap) {
  ASSERT_EQ(AllCameraModels().size(), 18u);
  for (const Row& row : kTable) {
    const CameraModel* model = FindCameraModel(row.id);
    ASSERT_NE(model, nullptr) << row.id;
    EXPECT_EQ(model, AllCameraModels()[row.id]);
    EXPECT_EQ(model, FindCameraModel(row.name));
    EXPECT_EQ(model->id, row.id);
    EXPECT_EQ(model->name, row.name);
    EXPECT_EQ(model->param_names, row.param_names);
    EXPECT_EQ(model->num_params, 1 + std::ranges::count(row.param_names, ' ')) << row.name;
    EXPECT_EQ(ToVector(model->focal_idxs), row.focal) << row.name;
    EXPECT_EQ(ToVector(model->principal_point_idxs), row.principal_point) << row.name;
    EXPECT_EQ(ToVector(model->extra_idxs), row.extra) << row.name;
    EXPECT_EQ(model->is_pinhole, row.id <= 1) << row.name;
  }
}

TEST(CameraModels, UnknownModelsAreNull) {
  EXPECT_EQ(FindCameraModel(-1), nullptr);
  EXPECT_EQ(FindCameraModel(18), nullptr);
  EXPECT_EQ(FindCameraModel(""), nullptr);
  EXPECT_EQ(FindCameraModel("pinhole"), nullptr);
}

TEST(CameraModels, CalibrationReadsFocalLengthAndPrincipalPoint) {
  double params[kMaxCameraParams];
  for (int i = 0; i < kMaxCameraParams; ++i) params[i] = 100 + i;
  for (const CameraModel* model : AllCameraModels()) {
    if (model->name == "EQUIRECTANGULAR") continue;
    const IdealCalibration K = model->ideal_calibration(params);
    EXPECT_EQ(K.fx_idx, model->focal_idxs.front()) << model->name;
    EXPECT_EQ(K.fy_idx, model->focal_idxs.back());
    EXPECT_EQ(K.cx_idx, model->principal_point_idxs[0]);
    EXPECT_EQ(K.cy_idx, model->principal_point_idxs[1]);
    EXPECT_EQ(K.fx, params[K.fx_idx]);
    EXPECT_EQ(K.fy, params[K.fy_idx]);
    EXPECT_EQ(K.cx, params[K.cx_idx]);
    EXPECT_EQ(K.cy, params[K.cy_idx]);
  }
}

Eigen::Vector2d ProjectOrDie(std::string_view name, const std::vector<double>& params,
                             const Eigen::Vector3d& X) {
  const CameraModel* model = FindCameraModel(name);
  Eigen::Vector2d pixel(NAN, NAN);
  EXPECT_EQ(params.size(), static_cast<size_t>(model->num_params)) << name;
  EXPECT_TRUE(model->project(params.data(), X, &pixel)) << name;
  return pixel;
}

const std::vector<Eigen::Vector3d> kPoints = {
    {0, 0, 2}, {0.3, -0.2, 1}, {-1.1, 0.7, 2.5}, {2, 3, 4}, {1e-5, 2e-5, 1}};

// Both names project every point to the same pixel.
void ExpectSameCamera(std::string_view a, const std::vector<double>& params_a, std::string_view b,
                      const std::vector<double>& params_b) {
  for (const Eigen::Vector3d& X : kPoints) {
    EXPECT_LT((ProjectOrDie(a, params_a, X) - ProjectOrDie(b, params_b, X)).norm(), 1e-10)
        << a << " " << b << " " << X.transpose();
  }
}

TEST(CameraModels, ZeroDistortionIsThePinhole) {
  ExpectSameCamera("PINHOLE", {600, 600, 320, 240}, "SIMPLE_PINHOLE", {600, 320, 240});
  for (const char* one_focal : {"SIMPLE_RADIAL", "RADIAL", "SIMPLE_DIVISION"}) {
    std::vector<double> params = {600, 320, 240};
    params.resize(FindCameraModel(one_focal)->num_params, 0.0);
    ExpectSameCamera("SIMPLE_PINHOLE", {600, 320, 240}, one_focal, params);
  }
  for (const char* two_focals : {"OPENCV", "FULL_OPENCV", "FOV", "DIVISION", "EUCM"}) {
    std::vector<double> params = {600, 610, 320, 240};
    params.resize(FindCameraModel(two_focals)->num_params, 0.0);
    ExpectSameCamera("PINHOLE", {600, 610, 320, 240}, two_focals, params);
  }
}

TEST(CameraModels, ZeroDistortionIsTheEquidistantFisheye) {
  ExpectSameCamera("FISHEYE", {600, 600, 320, 240}, "SIMPLE_FISHEYE", {600, 320, 240});
  for (const char* one_focal : {"SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"}) {
    std::vector<double> params = {600, 320, 240};
    params.resize(FindCameraModel(one_focal)->num_params, 0.0);
    ExpectSameCamera("SIMPLE_FISHEYE", {600, 320, 240}, one_focal, params);
  }
  for (const char* two_focals :
       {"OPENCV_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE"}) {
    std::vector<double> params = {600, 610, 320, 240};
    params.resize(FindCameraModel(two_focals)->num_params, 0.0);
    ExpectSameCamera("FISHEYE", {600, 610, 320, 240}, two_focals, params);
  }
}

TEST(CameraModels, AModelContainsItsSimplerRelatives) {
  ExpectSameCamera("SIMPLE_RADIAL", {600, 320, 240, 0.1}, "RADIAL", {600, 320, 240, 0.1, 0});
  ExpectSameCamera("RADIAL", {600, 320, 240, 0.1, 0.02}, "OPENCV",
                   {600, 600, 320, 240, 0.1, 0.02, 0, 0});
  ExpectSameCamera("OPENCV", {600, 610, 320, 240, 0.1, 0.02, 0.003, -0.001}, "FULL_OPENCV",
                   {600, 610, 320, 240, 0.1, 0.02, 0.003, -0.001, 0, 0, 0, 0});
  ExpectSameCamera("SIMPLE_DIVISION", {600, 320, 240, -0.2}, "DIVISION",
                   {600, 600, 320, 240, -0.2});
  ExpectSameCamera("RADIAL_FISHEYE", {600, 320, 240, 0.1, 0.02}, "OPENCV_FISHEYE",
                   {600, 600, 320, 240, 0.1, 0.02, 0, 0});
  ExpectSameCamera("OPENCV_FISHEYE", {600, 610, 320, 240, 0.1, 0.02, 0.03, -0.01},
                   "THIN_PRISM_FISHEYE", {600, 610, 320, 240, 0.1, 0.02, 0, 0, 0.03, -0.01, 0, 0});
  ExpectSameCamera("OPENCV_FISHEYE", {600, 610, 320, 240, 0.1, 0.02, 0.03, -0.01},
                   "RAD_TAN_THIN_PRISM_FISHEYE",
                   {600, 610, 320, 240, 0.1, 0.02, 0.03, -0.01, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST(CameraModels, ValuesWorkedByHand) {
  // r^2 = 0.25 at (0.3, 0.4, 1).
  EXPECT_LT((ProjectOrDie("SIMPLE_RADIAL", {100, 50, 40, 0.4}, {0.3, 0.4, 1}) -
             Eigen::Vector2d(50 + 33, 40 + 44))
                .norm(),
            1e-12);
  // 45 degrees to the right: theta = pi/4.
  EXPECT_LT((ProjectOrDie("SIMPLE_FISHEYE", {100, 50, 40}, {3, 0, 3}) -
             Eigen::Vector2d(50 + 25 * std::numbers::pi, 40))
                .norm(),
            1e-12);
  // k = -2, r = 1: 2 / (1 + sqrt(1 + 8)) = 1/2.
  EXPECT_LT(
      (ProjectOrDie("SIMPLE_DIVISION", {100, 50, 40, -2}, {0, 1, 1}) - Eigen::Vector2d(50, 90))
          .norm(),
      1e-12);
  // alpha = 1/2, beta = 1: (x, y) / ((5 + 4) / 2) at (3, 0, 4).
  EXPECT_LT(
      (ProjectOrDie("EUCM", {90, 90, 50, 40, 0.5, 1}, {3, 0, 4}) - Eigen::Vector2d(110, 40)).norm(),
      1e-12);
  // omega = pi/2: 2 tan(omega/2) = 2, atan(2 * 1/2) / (pi/2) = 1/2 at r = 1/2.
  EXPECT_LT((ProjectOrDie("FOV", {100, 100, 50, 40, std::numbers::pi / 2}, {1, 0, 2}) -
             Eigen::Vector2d(100, 40))
                .norm(),
            1e-12);
  // The right: a quarter turn; straight up: the first row.
  EXPECT_LT(
      (ProjectOrDie("EQUIRECTANGULAR", {1000, 500}, {2, 0, 0}) - Eigen::Vector2d(750, 250)).norm(),
      1e-12);
  EXPECT_NEAR(ProjectOrDie("EQUIRECTANGULAR", {1000, 500}, {0, -7, 0}).y(), 0.0, 1e-12);
}

TEST(CameraModels, FovIsSmoothWhereItsSeriesBegin) {
  // Against the plain formula on both sides of |omega| = 0.05 and of (2 r tan(omega/2))^2 = 0.01.
  for (const double omega : {0.01, 0.0499999, 0.0500001, 0.3, -0.3}) {
    for (const double r : {0.01, 0.3, 1.9999, 2.0001}) {
      const double expected = std::atan(2 * r * std::tan(omega / 2)) / omega;
      const double found = ProjectOrDie("FOV", {1, 1, 0, 0, omega}, {r, 0, 1}).x();
      EXPECT_NEAR(found / expected, 1.0, 2e-14) << omega << " " << r;
    }
  }
}

TEST(CameraModels, FisheyeIsSmoothWhereItsSeriesBegins) {
  for (const double r : {1e-9, 1e-3, 0.0999999, 0.1000001, 3.0, 1e6}) {
    const double found = ProjectOrDie("SIMPLE_FISHEYE", {1, 0, 0}, {r, 0, 1}).x();
    EXPECT_NEAR(found / std::atan(r), 1.0, 2e-14) << r;
  }
}

TEST(CameraModels, DivisionHasNoImageWhereTheRootIsUndefined) {
  const CameraModel* model = FindCameraModel("DIVISION");
  const double params[] = {100, 100, 50, 40, 0.25};  // 4 k r^2 = r^2
  Eigen::Vector2d pixel;
  double d_point[6], d_params[10];
  EXPECT_TRUE(model->project(params, {0.99, 0, 1}, &pixel));
  EXPECT_TRUE(model->project_with_jacobian(params, {0.99, 0, 1}, &pixel, d_point, d_params));
  EXPECT_FALSE(model->project(params, {1.01, 0, 1}, &pixel));
  EXPECT_FALSE(model->project_with_jacobian(params, {1.01, 0, 1}, &pixel, d_point, d_params));
  // The distorted radius ends at 1/sqrt(k) = 2.
  EXPECT_TRUE(model->unproject(params, {50 + 199, 40}).has_value());
  EXPECT_FALSE(model->unproject(params, {50 + 201, 40}).has_value());
}

TEST(CameraModels, PixelsOutsideTheReachOfTheLensHaveNoRay) {
  // r (1 - 0.3 r^2) is at most 0.7027, at r = 1.054.
  const CameraModel* radial = FindCameraModel("SIMPLE_RADIAL");
  const double barrel[] = {100, 0, 0, -0.3};
  EXPECT_TRUE(radial->unproject(barrel, {70.0, 0}).has_value());
  EXPECT_FALSE(radial->unproject(barrel, {70.5, 0}).has_value());
  EXPECT_FALSE(radial->unproject(barrel, {0, 200}).has_value());
  // 90 degrees is at f pi/2 = 157.08, 180 at 314.16.
  const CameraModel* fisheye = FindCameraModel("SIMPLE_FISHEYE");
  const double equidistant[] = {100, 0, 0};
  EXPECT_GT(fisheye->unproject(equidistant, {157.0, 0}).value().z(), 0.0);
  EXPECT_LT(fisheye->unproject(equidistant, {157.1, 0}).value().z(), 0.0);
  EXPECT_FALSE(fisheye->unproject(equidistant, {314.2, 0}).has_value());
  EXPECT_FALSE(fisheye->unproject(equidistant, {700, 0}).has_value());
  // omega r_d < pi/2.
  const CameraModel* fov = FindCameraModel("FOV");
  const double fov_params[] = {100, 100, 0, 0, 1.0};
  EXPECT_TRUE(fov->unproject(fov_params, {157.0, 0}).has_value());
  EXPECT_FALSE(fov->unproject(fov_params, {157.1, 0}).has_value());
  // alpha = 1, beta = 1 maps to x/|X|: the unit disc.
  const CameraModel* eucm = FindCameraModel("EUCM");
  const double eucm_params[] = {100, 100, 0, 0, 1.0, 1.0};
  EXPECT_TRUE(eucm->unproject(eucm_params, {99.9, 0}).has_value());
  EXPECT_FALSE(eucm->unproject(eucm_params, {100.1, 0}).has_value());
}

// The lens r (1 + 0.8 r^2 - 0.5 r^4) folds at r = 1.10 (value 1.36 there): from the distorted
// point, beyond the fold, Newton's method alone does not find the ray.
TEST(CameraModels, RaysAreFoundThoughThePixelLiesBeyondTheFold) {
  const CameraModel* model = FindCameraModel("RADIAL");
  const double params[] = {100, 0, 0, 0.8, -0.5};
  for (const double r : {0.2, 0.7, 0.95, 1.05, 1.08}) {
    const Eigen::Vector3d X(0.6 * r, 0.8 * r, 1);
    Eigen::Vector2d pixel;
    ASSERT_TRUE(model->project(params, X, &pixel));
    const auto ray = model->unproject(params, pixel);
    ASSERT_TRUE(ray.has_value()) << r;
    EXPECT_LT((*ray - X.normalized()).norm(), 1e-9) << r;
  }
}

TEST(CameraModels, EquirectangularSeesTheWholeSphere) {
  const CameraModel* model = FindCameraModel("EQUIRECTANGULAR");
  const double params[] = {2000, 1000};
  for (int column = 1; column < 24; ++column) {
    for (int row = 1; row < 12; ++row) {
      const Eigen::Vector2d pixel(2000.0 * column / 24, 1000.0 * row / 12);
      const auto ray = model->unproject(params, pixel);
      ASSERT_TRUE(ray.has_value());
      EXPECT_NEAR(ray->norm(), 1.0, 1e-15);
      Eigen::Vector2d back;
      ASSERT_TRUE(model->project(params, 3.0 * *ray, &back));
      EXPECT_LT((back - pixel).norm(), 1e-9);
      // Ideal pixels exist in the front half only.
      EXPECT_EQ(IdealPixel(*model, params, pixel).has_value(), ray->z() > 1e-12);
    }
  }
  Eigen::Vector2d pixel;
  double d_point[6];
  EXPECT_FALSE(model->project(params, Eigen::Vector3d::Zero(), &pixel));
  EXPECT_TRUE(model->project(params, {0, 1, 0}, &pixel));
  EXPECT_TRUE(model->project_with_jacobian(params, {0, 1, 0}, &pixel, nullptr, nullptr));
  EXPECT_FALSE(model->project_with_jacobian(params, {0, 1, 0}, &pixel, d_point, nullptr));
  EXPECT_FALSE(model->unproject(params, {100, -1}).has_value());
  EXPECT_FALSE(model->unproject(params, {100, 1001}).has_value());
}

TEST(CameraModels, EquirectangularCalibrationAgreesAroundTheAxis) {
  const double params[] = {2000, 1100};
  const IdealCalibration K = FindCameraModel("EQUIRECTANGULAR")->ideal_calibration(params);
  EXPECT_DOUBLE_EQ(K.fx, 2000 / (2 * std::numbers::pi));
  EXPECT_DOUBLE_EQ(K.fy, 1100 / std::numbers::pi);
  EXPECT_DOUBLE_EQ(K.cx, 1000);
  EXPECT_DOUBLE_EQ(K.cy, 550);
  EXPECT_THAT((std::array{K.fx_idx, K.fy_idx, K.cx_idx, K.cy_idx}),
              ElementsAreArray({-1, -1, -1, -1}));
  Eigen::Vector2d pixel;
  double d_point[6];
  ASSERT_TRUE(FindCameraModel("EQUIRECTANGULAR")
                  ->project_with_jacobian(params, {0, 0, 1}, &pixel, d_point, nullptr));
  EXPECT_NEAR(d_point[0], K.fx, 1e-10);
  EXPECT_NEAR(d_point[4], K.fy, 1e-10);
}

TEST(CameraModels, IdealPixelOfAPinholeIsThePixelItself) {
  const double params[] = {600, 610, 320, 240};
  const Eigen::Vector2d pixel(17.3, 99.1);
  double d_params[8];
  EXPECT_EQ(*IdealPixel(*FindCameraModel("PINHOLE"), params, pixel), pixel);
  EXPECT_EQ(*IdealPixelWithJacobian(*FindCameraModel("PINHOLE"), params, pixel, d_params), pixel);
  EXPECT_THAT(d_params, ::testing::Each(0.0));
}

TEST(Snavely, SeesPointsBehindAsTheirReflections) {
  const CameraModel& snavely = SnavelyCameraModel();
  const CameraModel& radial = *FindCameraModel("RADIAL");
  EXPECT_EQ(snavely.name, radial.name);
  EXPECT_EQ(snavely.id, radial.id);
  const double params[5] = {500, 0, 0, -0.1, 0.02};
  const Eigen::Vector3d X(0.3, -0.2, 2.0);
  Eigen::Vector2d in_front, behind, expected;
  ASSERT_TRUE(radial.project(params, X, &expected));
  ASSERT_FALSE(radial.project(params, -X, &behind));
  ASSERT_TRUE(snavely.project(params, X, &in_front));
  ASSERT_TRUE(snavely.project(params, -X, &behind));
  EXPECT_EQ(in_front, expected);
  EXPECT_EQ(behind, expected);

  double d_point[6], d_params[10];
  ASSERT_TRUE(snavely.project_with_jacobian(params, -X, &behind, d_point, d_params));
  constexpr double kStep = 1e-6;
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(c);
    Eigen::Vector2d above, below;
    ASSERT_TRUE(snavely.project(params, -X + step, &above));
    ASSERT_TRUE(snavely.project(params, -X - step, &below));
    for (int r = 0; r < 2; ++r) {
      EXPECT_NEAR(d_point[3 * r + c], (above[r] - below[r]) / (2 * kStep), 1e-5);
    }
  }
}

}  // namespace
}  // namespace holba
