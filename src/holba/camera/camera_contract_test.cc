// SPDX-License-Identifier: BSD-3-Clause
// The laws of the camera contract (camera_model.h), for every model and several plausible cameras
// of it.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "holba/camera/camera_examples.h"
#include "holba/camera/camera_model.h"
#include "holba/camera/camera_models.h"
#include "holba/geometry/angle.h"
#include "holba/geometry/dual.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

template <typename List>
struct ToTestTypes;
template <typename... Models>
struct ToTestTypes<CameraModelList<Models...>> {
  using type = ::testing::Types<Models...>;
};

struct ModelName {
  template <typename Model>
  static std::string GetName(int) {
    return std::string(Model::kName);
  }
};

// At several depths, on the axis and up to 40 degrees from it.
std::vector<Eigen::Vector3d> PointsInView() {
  std::vector<Eigen::Vector3d> points = {{0, 0, 2}, {1e-7, -2e-7, 1}};
  for (const double angle_deg : {1.0, 5.0, 12.0, 25.0, 40.0}) {
    for (int turn = 0; turn < 8; ++turn) {
      const double angle = DegToRad(angle_deg), around = 0.3 + turn * M_PI / 4;
      const double range = 0.4 + 0.7 * turn + 0.1 * angle_deg;
      points.push_back(range * Eigen::Vector3d(std::sin(angle) * std::cos(around),
                                               std::sin(angle) * std::sin(around),
                                               std::cos(angle)));
    }
  }
  return points;
}

template <typename Model>
constexpr bool kHasMaxAngle = requires(const double* params) { Model::MaxAngle(params); };

template <typename Model>
struct Jacobians {
  Eigen::Vector2d pixel;
  RowMajor<2, 3> d_point;
  RowMajor<2, Model::kNumParams> d_params;
};

template <typename Model>
class CameraContract : public ::testing::Test {
 protected:
  static constexpr int N = Model::kNumParams;
  using Params = std::vector<double>;

  void SetUp() override {
    examples_ = ExampleCameraParams(Model::kName);
    ASSERT_GE(examples_.size(), 2u);
    for (const Params& params : examples_) ASSERT_EQ(params.size(), static_cast<size_t>(N));
    ASSERT_NE(Table(), nullptr);
  }

  static const CameraModel* Table() { return FindCameraModel(Model::kModelId); }

  template <typename Check>
  void ForEachCameraAndPoint(const Check& check) const {
    for (const Params& params : examples_) {
      for (const Eigen::Vector3d& X : PointsInView()) {
        SCOPED_TRACE(::testing::Message() << "parameters " << ::testing::PrintToString(params)
                                          << " point " << X.transpose());
        check(params, X);
        if (this->HasFatalFailure()) return;
      }
    }
  }

  // With points beyond 90 degrees from the axis of cameras that see these, too.
  template <typename Check>
  void ForEachCameraAndSeenPoint(const Check& check) const {
    ForEachCameraAndPoint(check);
    if constexpr (kHasMaxAngle<Model>) {
      for (const Params& params : examples_) {
        const double max_angle = Model::MaxAngle(params.data());
        for (const double angle_deg :
             {80.0, 89.93, 89.95, 90.0, 90.05, 95.0, 120.0, 150.0, 174.0}) {
          const double angle = DegToRad(angle_deg);
          if (angle_deg > 89.0 && angle > 0.97 * max_angle) continue;
          if (angle_deg < 89.0 && angle > max_angle) continue;
          for (int turn = 0; turn < 5; ++turn) {
            const double around = 0.2 + turn * 2.0 * M_PI / 5;
            const Eigen::Vector3d X =
                (0.5 + turn) * Eigen::Vector3d(std::sin(angle) * std::cos(around),
                                               std::sin(angle) * std::sin(around), std::cos(angle));
            SCOPED_TRACE(::testing::Message() << "parameters " << ::testing::PrintToString(params)
                                              << " at " << angle_deg << " degrees");
            check(params, X);
            if (this->HasFatalFailure()) return;
          }
        }
      }
    }
  }

  static Jacobians<Model> HandWritten(const Params& params, const Eigen::Vector3d& X) {
    Jacobians<Model> J;
    EXPECT_TRUE(Model::ProjectWithJacobian(params.data(), X, &J.pixel, J.d_point.data(),
                                           J.d_params.data()));
    return J;
  }

  std::vector<Params> examples_;
};

// Largest difference, relative to the largest entry.
template <typename A, typename B>
double RelativeError(const A& a, const B& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1.0, b.cwiseAbs().maxCoeff());
}

TYPED_TEST_SUITE(CameraContract, ToTestTypes<CameraModels>::type, ModelName);

TYPED_TEST(CameraContract, UnprojectInvertsProject) {
  this->ForEachCameraAndSeenPoint([](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &pixel));
    const std::optional<Eigen::Vector3d> ray = TypeParam::Unproject(params.data(), pixel);
    ASSERT_TRUE(ray.has_value());
    EXPECT_NEAR(ray->norm(), 1.0, 1e-14);
    EXPECT_LT((*ray - X.normalized()).norm(), 1e-9);
  });
}

TYPED_TEST(CameraContract, ProjectInvertsUnproject) {
  for (const auto& params : this->examples_) {
    const IdealCalibration K = TypeParam::Calibration(params.data());
    int num_rays = 0;
    for (int i = -6; i <= 6; ++i) {
      for (int j = -6; j <= 6; ++j) {
        const Eigen::Vector2d pixel(K.cx + 0.15 * i * K.fx, K.cy + 0.15 * j * K.fy);
        const auto ray = TypeParam::Unproject(params.data(), pixel);
        if (!ray) continue;
        ++num_rays;
        Eigen::Vector2d back;
        ASSERT_TRUE(TypeParam::Project(params.data(), Eigen::Vector3d(5.0 * *ray), &back));
        EXPECT_LT((back - pixel).norm(), 1e-8) << pixel.transpose();
      }
    }
    EXPECT_GE(num_rays, 60);
  }
}

TYPED_TEST(CameraContract, ProjectionDependsOnTheDirectionOnly) {
  this->ForEachCameraAndSeenPoint([](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d near, far;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &near));
    ASSERT_TRUE(TypeParam::Project(params.data(), Eigen::Vector3d(37.0 * X), &far));
    EXPECT_LT((near - far).norm(), 1e-9);
    // Euler: a function of the direction has no derivative along the point.
    const auto J = CameraContract<TypeParam>::HandWritten(params, X);
    EXPECT_LT((J.d_point * X).norm(), 1e-9 * J.d_point.norm() * X.norm());
  });
}

TYPED_TEST(CameraContract, JacobiansAgreeWithDualNumbers) {
  constexpr int N = TypeParam::kNumParams;
  using D = Dual<3 + N>;
  this->ForEachCameraAndSeenPoint([](const auto& params, const Eigen::Vector3d& X) {
    std::array<D, N> p;
    Vector3<D> x;
    for (int i = 0; i < 3; ++i) x[i] = D::Variable(X[i], i);
    for (int i = 0; i < N; ++i) p[i] = D::Variable(params[i], 3 + i);
    Vector2<D> pixel;
    ASSERT_TRUE(TypeParam::Project(p.data(), x, &pixel));
    Jacobians<TypeParam> dual;
    for (int row = 0; row < 2; ++row) {
      dual.d_point.row(row) = pixel[row].gradient.template head<3>().transpose();
      dual.d_params.row(row) = pixel[row].gradient.template tail<N>().transpose();
      dual.pixel[row] = pixel[row].value;
    }
    const auto J = CameraContract<TypeParam>::HandWritten(params, X);
    EXPECT_LT(RelativeError(J.pixel, dual.pixel), 1e-13);
    EXPECT_LT(RelativeError(J.d_point, dual.d_point), 1e-10);
    EXPECT_LT(RelativeError(J.d_params, dual.d_params), 1e-10);
  });
}

TYPED_TEST(CameraContract, JacobiansAgreeWithCentralDifferences) {
  constexpr int N = TypeParam::kNumParams;
  this->ForEachCameraAndSeenPoint([](const auto& params, const Eigen::Vector3d& X) {
    const auto difference = [&](const auto& project_at, double step) -> Eigen::Vector2d {
      Eigen::Vector2d above, below;
      EXPECT_TRUE(project_at(step, &above) && project_at(-step, &below));
      return (above - below) / (2.0 * step);
    };
    Jacobians<TypeParam> numeric;
    for (int i = 0; i < 3; ++i) {
      numeric.d_point.col(i) = difference(
          [&](double step, Eigen::Vector2d* pixel) {
            Eigen::Vector3d moved = X;
            moved[i] += step;
            return TypeParam::Project(params.data(), moved, pixel);
          },
          1e-6 * X.norm());
    }
    for (int i = 0; i < N; ++i) {
      numeric.d_params.col(i) = difference(
          [&](double step, Eigen::Vector2d* pixel) {
            auto moved = params;
            moved[i] += step;
            return TypeParam::Project(moved.data(), X, pixel);
          },
          1e-5 * std::max(1.0, std::abs(params[i])));
    }
    const auto J = CameraContract<TypeParam>::HandWritten(params, X);
    EXPECT_LT(RelativeError(J.d_point, numeric.d_point), 1e-5);
    EXPECT_LT(RelativeError(J.d_params, numeric.d_params), 1e-5);
  });
}

TYPED_TEST(CameraContract, ProjectAndItsJacobianFormAgree) {
  this->ForEachCameraAndSeenPoint([](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d plain, with_jacobian;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &plain));
    ASSERT_TRUE(TypeParam::ProjectWithJacobian(params.data(), X, &with_jacobian, nullptr, nullptr));
    EXPECT_LT((plain - with_jacobian).norm(), 1e-10);
  });
}

TYPED_TEST(CameraContract, TheTableHoldsTheFunctionsOfTheModel) {
  const CameraModel& table = *this->Table();
  this->ForEachCameraAndSeenPoint([&](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d direct, through_table, with_jacobian;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &direct));
    ASSERT_TRUE(table.project(params.data(), X, &through_table));
    EXPECT_EQ(direct, through_table);
    ASSERT_TRUE(table.project_with_jacobian(params.data(), X, &with_jacobian, nullptr, nullptr));
    EXPECT_LT((direct - with_jacobian).norm(), 1e-10);
    EXPECT_EQ(*table.unproject(params.data(), direct),
              *TypeParam::Unproject(params.data(), direct));
  });
}

TYPED_TEST(CameraContract, ModelsWithMaxAngleSeeToItAndNoFurther) {
  EXPECT_EQ(this->Table()->max_angle != nullptr, kHasMaxAngle<TypeParam>);
  if constexpr (kHasMaxAngle<TypeParam>) {
    double widest = 0.0;
    for (const auto& params : this->examples_) {
      const double max_angle = TypeParam::MaxAngle(params.data());
      EXPECT_EQ(this->Table()->max_angle(params.data()), max_angle);
      widest = std::max(widest, max_angle);
      double last_px = 0.0;
      for (int degrees = 1; degrees < 180; ++degrees) {
        const double angle = DegToRad(degrees);
        const Eigen::Vector3d X(std::sin(angle), 0.0, std::cos(angle));
        Eigen::Vector2d pixel;
        const bool is_seen = TypeParam::Project(params.data(), X, &pixel);
        EXPECT_EQ(is_seen, degrees < 90 || angle <= max_angle) << degrees;
        EXPECT_EQ(TypeParam::ProjectWithJacobian(params.data(), X, &pixel, nullptr, nullptr),
                  is_seen);
        if (!is_seen || angle > max_angle) continue;
        // One pixel belongs to one ray: further out with every degree.
        const double distance_px = std::abs(pixel.x() - TypeParam::Calibration(params.data()).cx);
        EXPECT_GT(distance_px, last_px) << degrees;
        last_px = distance_px;
      }
      // Right behind, and at the centre, there is no direction.
      for (const Eigen::Vector3d& X : {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, 0, 0)}) {
        Eigen::Vector2d pixel;
        EXPECT_FALSE(TypeParam::Project(params.data(), X, &pixel));
        EXPECT_FALSE(TypeParam::ProjectWithJacobian(params.data(), X, &pixel, nullptr, nullptr));
      }
    }
    EXPECT_GT(widest, DegToRad(95.0));
  }
}

TYPED_TEST(CameraContract, PointsBehindTheCameraHaveAnImageOnlyInFisheyesAndOnTheSphere) {
  if (kHasMaxAngle<TypeParam>) return;
  const bool sees_behind = TypeParam::kName == "EQUIRECTANGULAR";
  this->ForEachCameraAndPoint([sees_behind](const auto& params, const Eigen::Vector3d& X) {
    if (sees_behind && X.head<2>().norm() < 1e-3) return;  // the origin, for z = 0
    for (const double z : {-X.z(), -1e-9, 0.0, 1e-17}) {
      const Eigen::Vector3d behind(X.x(), X.y(), z);
      Eigen::Vector2d pixel;
      EXPECT_EQ(TypeParam::Project(params.data(), behind, &pixel), sees_behind) << z;
      if (sees_behind) continue;  // its derivatives end at the poles
      EXPECT_FALSE(TypeParam::ProjectWithJacobian(params.data(), behind, &pixel, nullptr, nullptr));
    }
  });
}

TYPED_TEST(CameraContract, WhatIsNotFiniteIsRefused) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const auto& params : this->examples_) {
    Eigen::Vector2d pixel;
    for (const Eigen::Vector3d& X :
         {Eigen::Vector3d(kNan, 0, 1), Eigen::Vector3d(0, kNan, 1), Eigen::Vector3d(0, 0, kNan)}) {
      EXPECT_FALSE(TypeParam::Project(params.data(), X, &pixel));
      EXPECT_FALSE(TypeParam::ProjectWithJacobian(params.data(), X, &pixel, nullptr, nullptr));
    }
    for (const double bad : {kNan, kInf}) {
      EXPECT_FALSE(TypeParam::Unproject(params.data(), {bad, 10}).has_value());
      EXPECT_FALSE(TypeParam::Unproject(params.data(), {10, bad}).has_value());
    }
  }
}

TYPED_TEST(CameraContract, IdealPixelIsKOfTheNormalisedPoint) {
  const CameraModel& table = *this->Table();
  this->ForEachCameraAndPoint([&](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &pixel));
    const IdealCalibration K = TypeParam::Calibration(params.data());
    const Eigen::Vector2d expected(K.fx * X.x() / X.z() + K.cx, K.fy * X.y() / X.z() + K.cy);
    const auto ideal = IdealPixel(table, params.data(), pixel);
    ASSERT_TRUE(ideal.has_value());
    EXPECT_LT((*ideal - expected).norm(), 1e-9 * K.fx);
  });
}

TYPED_TEST(CameraContract, IdealPixelJacobianAgreesWithCentralDifferences) {
  constexpr int N = TypeParam::kNumParams;
  const CameraModel& table = *this->Table();
  this->ForEachCameraAndPoint([&](const auto& params, const Eigen::Vector3d& X) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(TypeParam::Project(params.data(), X, &pixel));
    RowMajor<2, N> analytic, numeric;
    const auto ideal = IdealPixelWithJacobian(table, params.data(), pixel, analytic.data());
    ASSERT_TRUE(ideal.has_value());
    EXPECT_EQ(*ideal, *IdealPixel(table, params.data(), pixel));
    for (int i = 0; i < N; ++i) {
      const double step = 1e-5 * std::max(1.0, std::abs(params[i]));
      auto above = params, below = params;
      above[i] += step;
      below[i] -= step;
      numeric.col(i) =
          (*IdealPixel(table, above.data(), pixel) - *IdealPixel(table, below.data(), pixel)) /
          (2.0 * step);
    }
    EXPECT_LT(RelativeError(analytic, numeric), 1e-5);
  });
}

}  // namespace
}  // namespace holba
