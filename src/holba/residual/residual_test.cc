// SPDX-License-Identifier: BSD-3-Clause
// Every residual: its Jacobians against central differences along the manifolds, and its equation
// against FORMAT.md written out plainly.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "holba/base/random.h"
#include "holba/group/lines_in_plane_testing.h"
#include "holba/problem/residual_batch.h"
#include "holba/residual/group_line.h"
#include "holba/residual/group_line_3d.h"
#include "holba/residual/group_measurement.h"
#include "holba/residual/group_point.h"
#include "holba/residual/group_point_3d.h"
#include "holba/residual/line.h"
#include "holba/residual/point.h"
#include "holba/residual/principal_point_prior.h"
#include "holba/residual/relation.h"
#include "holba/residual/vanishing_point.h"
#include "holba/residual/wireframe_3d.h"
#include "holba/residual/wireframe_line.h"
#include "holba/residual/wireframe_point.h"
#include "holba/residual/with_sensor_pose.h"

namespace holba {
namespace {

struct Slot {
  const ManifoldOps* manifold;
  std::vector<double> values;
};

template <typename Kernel>
std::optional<std::vector<double>> Value(const Kernel& kernel, const typename Kernel::Datum& datum,
                                         const std::vector<Slot>& slots) {
  const double* values[kMaxSlots] = {};
  double* none[kMaxSlots] = {};
  for (size_t s = 0; s < slots.size(); ++s) values[s] = slots[s].values.data();
  std::vector<double> r(Kernel::kDim);
  if (!kernel.Evaluate(datum, values, r.data(), none)) return std::nullopt;
  return r;
}

// Largest difference between the kernel's Jacobians and central differences, relative to the
// largest entry of the block.
template <typename Kernel>
void ExpectJacobians(const Kernel& kernel, const typename Kernel::Datum& datum,
                     const std::vector<Slot>& slots, const std::string& what) {
  const double* values[kMaxSlots] = {};
  double storage[kMaxSlots][kMaxResidualDim * kMaxTangent];
  double* jacobians[kMaxSlots] = {};
  for (size_t s = 0; s < slots.size(); ++s) {
    values[s] = slots[s].values.data();
    jacobians[s] = storage[s];
  }
  double r[Kernel::kDim];
  ASSERT_TRUE(kernel.Evaluate(datum, values, r, jacobians)) << what;
  const auto value_alone = Value(kernel, datum, slots);
  ASSERT_TRUE(value_alone.has_value()) << what;
  for (int k = 0; k < Kernel::kDim; ++k) {
    EXPECT_NEAR(r[k], (*value_alone)[k], 1e-9 * (1.0 + std::abs(r[k])))
        << what << ", value without Jacobians";
  }
  for (size_t s = 0; s < slots.size(); ++s) {
    const int tangent = slots[s].manifold->tangent;
    double largest = 1e-6;
    for (int k = 0; k < Kernel::kDim * tangent; ++k)
      largest = std::max(largest, std::abs(storage[s][k]));
    for (int c = 0; c < tangent; ++c) {
      // Intrinsics range from distortion (1e-2) to focal lengths (1e3): a step that suits each.
      const double h = slots[s].manifold->ambient == tangent
                           ? 1e-6 * std::max(1.0, std::abs(slots[s].values[c]))
                           : 1e-6;
      std::array<std::vector<double>, 2> moved;
      for (int side = 0; side < 2; ++side) {
        std::vector<double> delta(tangent, 0.0);
        delta[c] = side ? -h : h;
        std::vector<Slot> there = slots;
        slots[s].manifold->plus(slots[s].values.data(), delta.data(), there[s].values.data());
        const auto value = Value(kernel, datum, there);
        ASSERT_TRUE(value.has_value()) << what;
        moved[side] = *value;
      }
      for (int k = 0; k < Kernel::kDim; ++k) {
        const double numeric = (moved[0][k] - moved[1][k]) / (2 * h);
        EXPECT_NEAR(storage[s][k * tangent + c], numeric,
                    2e-6 * largest + 1e-5 * std::abs(numeric) + 3e-7)
            << what << ", slot " << s << ", row " << k << ", column " << c;
      }
    }
  }
}

std::vector<double> ParamsOf(const CameraModel& model) {
  static const std::map<std::string_view, std::vector<double>> params = {
      {"SIMPLE_PINHOLE", {700, 500, 480}},
      {"PINHOLE", {700, 720, 500, 480}},
      {"SIMPLE_RADIAL", {700, 500, 480, -0.1}},
      {"OPENCV", {700, 720, 500, 480, -0.1, 0.02, 0.001, -0.002}},
      {"OPENCV_FISHEYE", {700, 720, 500, 480, 0.02, -0.01, 0.003, 0.001}},
      {"FULL_OPENCV", {700, 720, 500, 480, -0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.005}}};
  return params.at(model.name);
}

struct Scene {
  Random random{7};
  Eigen::Vector3d Vector(double s) {
    return {random.Normal(s), random.Normal(s), random.Normal(s)};
  }
  Slot Pose() {
    const Eigen::Quaterniond q = ExpRotation(Vector(0.2));
    const Eigen::Vector3d t = Eigen::Vector3d(0, 0, 8) + Vector(0.3);
    return {&OpsOf<PoseManifold>(), {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()}};
  }
  Slot Point() {
    const Eigen::Vector3d X = Vector(1.0);
    return {&OpsOf<Euclidean<3>>(), {X.x(), X.y(), X.z()}};
  }
  Slot Line() {
    const Eigen::Vector3d d = Vector(1.0).normalized(), p = Vector(1.0);
    return {&OpsOf<LineManifold>(), {d.x(), d.y(), d.z(), p.x(), p.y(), p.z()}};
  }
  Slot Camera(const CameraModel& model) {
    return {&EuclideanOps(model.num_params), ParamsOf(model)};
  }
  Slot Group(const GroupType& type) {
    static const std::map<std::string_view, std::vector<double>> plain = {
        {"VP", {0.6, 0.0, 0.8}},
        {"PLANE", {0.36, 0.48, 0.8, 0.5}},
        {"SPHERE", {0.1, -0.2, 0.3, 1.7}},
        {"CYLINDER", {0.6, 0.0, 0.8, 0.16, 0.1, -0.12, 0.9}},
        {"CONE", {0.1, 0.2, -3.0, 0.0, 0.6, 0.8, 0.5}},
        {"ELLIPSOID", {0.5, 0.5, -0.5, 0.5, 0.2, 0.1, 0.0, 1.0, 1.5, 0.7}},
        {"CUBOID", {0.5, 0.5, -0.5, 0.5, -1.0, -1.2, -0.9, -1.1, -1.3, -0.8}},
        {"TORUS", {0.1, -0.2, 0.3, 0.6, 0.0, 0.8, 1.4, 0.5}},
        {"BEZIER_CURVE", {-2.0, 0.3, 0.1, -0.8, -0.9, 0.4, 0.9, 1.1, -0.5, 2.1, 0.2, 0.3}}};
    std::vector<double> g(type.manifold->ambient);
    EXPECT_TRUE(type.from_file(plain.at(type.name).data(), g.data())) << type.name;
    return {type.manifold, g};
  }
  Eigen::Vector2d Pixel() { return {500 + random.Normal(150), 480 + random.Normal(150)}; }
  SegmentDatum Segment(const CameraModel& model, const std::vector<double>& params,
                       const SensorPose* sensor) {
    return {IdealObservation(model, params.data(), Pixel()),
            IdealObservation(model, params.data(), Pixel()), sensor};
  }
};

const SensorPose kSensor{ExpRotation({0.1, -0.2, 0.05}).toRotationMatrix(), {0.2, -0.1, 0.3}};

// Cameras with and without distortion, in the reference sensor of a rig and beside it.
class ResidualsOfCamera : public testing::TestWithParam<std::tuple<const char*, bool>> {
 protected:
  const CameraModel& model = *FindCameraModel(std::string_view(std::get<0>(GetParam())));
  const SensorPose* sensor = std::get<1>(GetParam()) ? &kSensor : nullptr;
  const LineCamera line_camera{&model, !model.is_pinhole};
  Scene scene;
};

TEST_P(ResidualsOfCamera, HaveTheJacobiansOfTheirFormulas) {
  for (int repeat = 0; repeat < 5; ++repeat) {
    const Slot camera = scene.Camera(model);
    ExpectJacobians(PointResidual{&model}, {scene.Pixel(), sensor},
                    {scene.Point(), scene.Pose(), camera}, "point");
    ExpectJacobians(LineResidual{line_camera}, scene.Segment(model, camera.values, sensor),
                    {scene.Line(), scene.Pose(), camera}, "line");
    ExpectJacobians(WireframePointResidual{line_camera},
                    scene.Segment(model, camera.values, sensor),
                    {scene.Point(), scene.Pose(), camera}, "wireframe_point");
    ExpectJacobians(WireframeLineResidual{line_camera},
                    {IdealObservation(model, camera.values.data(), scene.Pixel()), sensor},
                    {scene.Line(), scene.Pose(), camera}, "wireframe_line");
    for (const GroupType* type : AllGroupTypes()) {
      if (type->project_point) {
        ExpectJacobians(GroupPointResidual{&model, type}, {sensor},
                        {scene.Point(), scene.Pose(), camera, scene.Group(*type)},
                        "group_point " + std::string(type->name));
      }
      if (type->project_line) {
        ExpectJacobians(GroupLineResidual{line_camera, type},
                        scene.Segment(model, camera.values, sensor),
                        {scene.Line(), scene.Pose(), camera, scene.Group(*type)},
                        "group_line " + std::string(type->name));
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Models, ResidualsOfCamera,
                         testing::Combine(testing::Values("SIMPLE_PINHOLE", "PINHOLE",
                                                          "SIMPLE_RADIAL", "OPENCV",
                                                          "OPENCV_FISHEYE", "FULL_OPENCV"),
                                          testing::Bool()));

TEST(ResidualsWithoutCamera, HaveTheJacobiansOfTheirFormulas) {
  Scene scene;
  for (const GroupType* type : AllGroupTypes()) {
    const std::string name(type->name);
    if (type->IsParallelism()) {
      ExpectJacobians(VanishingPointResidual{type}, {}, {scene.Line(), scene.Group(*type)}, "vp");
    }
    if (type->project_point) {
      ExpectJacobians(GroupPoint3dResidual{type}, {}, {scene.Point(), scene.Group(*type)},
                      "group_point_3d " + name);
      ExpectJacobians(GroupLine3dResidual{type}, {{-0.4, 0.7}}, {scene.Line(), scene.Group(*type)},
                      "group_line_3d " + name);
    }
    if (!type->HasDirection()) continue;
    ExpectJacobians(GroupMeasurementResidual{type},
                    {Eigen::Vector3d(0.6, 0.64, 0.48), 0.02, &kSensor},
                    {scene.Group(*type), scene.Pose()}, "group_measurement " + name);
    for (const GroupType* other : AllGroupTypes()) {
      if (!other->HasDirection()) continue;
      std::vector<Slot> both{scene.Group(*type), scene.Group(*other)};
      both[1].manifold->plus(scene.Group(*other).values.data(), std::vector<double>(16, 0.1).data(),
                             both[1].values.data());
      ExpectJacobians(OrthogonalResidual{{type, other}}, {}, both, "orthogonal " + name);
      ExpectJacobians(ParallelResidual{{type, other}}, {}, both, "parallel " + name);
    }
  }
  ExpectJacobians(Wireframe3dResidual{}, {}, {scene.Point(), scene.Line()}, "wireframe_3d");
}

TEST(PrincipalPointPrior, IsTheDistanceInStandardDeviations) {
  const CameraModel& model = *FindCameraModel("OPENCV");
  const std::vector<double> params = {700, 710, 503, 390, 0.1, -0.02, 0.001, 0.002};
  const PrincipalPointPrior prior{&model};
  const double* values[] = {params.data()};
  double residual[2], J[16];
  double* jacobians[] = {J};
  ASSERT_TRUE(prior.Evaluate({{500, 400}, {10, 8}}, values, residual, jacobians));
  EXPECT_DOUBLE_EQ(residual[0], 0.3);
  EXPECT_DOUBLE_EQ(residual[1], -1.25);
  for (int i = 0; i < 16; ++i) EXPECT_DOUBLE_EQ(J[i], i == 2 ? 0.1 : i == 8 + 3 ? 0.125 : 0.0) << i;
}

// A kernel with the sensor's pose as a block: its Jacobians, and that it is the kernel that sees
// through this pose held.
template <typename Kernel>
void ExpectAsHeld(const Kernel& kernel, typename Kernel::Datum datum, std::vector<Slot> slots,
                  Scene* scene, const std::string& what) {
  const Eigen::Quaterniond q = ExpRotation(scene->Vector(0.2));
  const Eigen::Vector3d t = scene->Vector(0.3);
  const SensorPose held{q.toRotationMatrix(), t};
  datum.sensor = &held;
  double expected[Kernel::kDim], by_frame[6 * Kernel::kDim];
  const double* values[kMaxSlots] = {};
  double* jacobians[kMaxSlots] = {};
  for (size_t s = 0; s < slots.size(); ++s) values[s] = slots[s].values.data();
  jacobians[1] = by_frame;
  ASSERT_TRUE(kernel.Evaluate(datum, values, expected, jacobians)) << what;

  datum.sensor = nullptr;
  slots.push_back({&OpsOf<PoseManifold>(), {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()}});
  const WithSensorPose<Kernel> with_sensor{kernel};
  ExpectJacobians(with_sensor, datum, slots, what);
  double r[Kernel::kDim], by_frame_too[6 * Kernel::kDim];
  for (size_t s = 0; s < slots.size(); ++s) values[s] = slots[s].values.data();
  jacobians[1] = by_frame_too;
  ASSERT_TRUE(with_sensor.Evaluate(datum, values, r, jacobians)) << what;
  for (int k = 0; k < Kernel::kDim; ++k) {
    EXPECT_NEAR(r[k], expected[k], 1e-9 * (1.0 + std::abs(expected[k]))) << what;
    for (int c = 6 * k; c < 6 * k + 6; ++c)
      EXPECT_NEAR(by_frame_too[c], by_frame[c], 1e-9 * (1e3 + std::abs(by_frame[c]))) << what;
  }
}

TEST(WithSensorPose, IsTheResidualThroughThatPoseWithItsJacobians) {
  Scene scene;
  for (const char* name : {"PINHOLE", "OPENCV", "OPENCV_FISHEYE"}) {
    const CameraModel& model = *FindCameraModel(std::string_view(name));
    const LineCamera line_camera{&model, !model.is_pinhole};
    const Slot camera = scene.Camera(model);
    const auto segment = [&] { return scene.Segment(model, camera.values, nullptr); };
    ExpectAsHeld(PointResidual{&model}, {scene.Pixel(), nullptr},
                 {scene.Point(), scene.Pose(), camera}, &scene, "point");
    ExpectAsHeld(LineResidual{line_camera}, segment(), {scene.Line(), scene.Pose(), camera}, &scene,
                 "line");
    ExpectAsHeld(WireframePointResidual{line_camera}, segment(),
                 {scene.Point(), scene.Pose(), camera}, &scene, "wireframe_point");
    ExpectAsHeld(WireframeLineResidual{line_camera},
                 {IdealObservation(model, camera.values.data(), scene.Pixel()), nullptr},
                 {scene.Line(), scene.Pose(), camera}, &scene, "wireframe_line");
    for (const GroupType* type : AllGroupTypes()) {
      const std::string of_type(type->name);
      if (type->project_point) {
        ExpectAsHeld(GroupPointResidual{&model, type}, {nullptr},
                     {scene.Point(), scene.Pose(), camera, scene.Group(*type)}, &scene,
                     "group_point " + of_type);
      }
      if (type->project_line) {
        ExpectAsHeld(GroupLineResidual{line_camera, type}, segment(),
                     {scene.Line(), scene.Pose(), camera, scene.Group(*type)}, &scene,
                     "group_line " + of_type);
      }
      if (type->HasDirection()) {
        ExpectAsHeld(GroupMeasurementResidual{type},
                     {Eigen::Vector3d(0.6, 0.64, 0.48), 0.02, nullptr},
                     {scene.Group(*type), scene.Pose()}, &scene, "group_measurement " + of_type);
      }
    }
  }
}

TEST(GroupLine3dResidual, IsTheDistanceOfBothEndsFromTheProjectedLineWhereOnlyLinesAreProjected) {
  Scene scene;
  const GroupType& type = TableOf<LinesInPlane>();
  const Slot plane = scene.Group(*FindGroupType("PLANE"));
  for (int repeat = 0; repeat < 5; ++repeat) {
    const Slot line = scene.Line();
    ExpectJacobians(GroupLine3dResidual{&type}, {{-0.4, 0.7}}, {line, plane}, "group_line_3d");
    const auto r = Value(GroupLine3dResidual{&type}, {{-0.4, 0.7}}, {line, plane});
    // A plane's projection of a line is that of its points.
    const auto by_points =
        Value(GroupLine3dResidual{FindGroupType("PLANE")}, {{-0.4, 0.7}}, {line, plane});
    ASSERT_TRUE(r && by_points);
    for (const int e : {0, 3}) {
      EXPECT_NEAR(std::hypot((*r)[e], (*r)[e + 1], (*r)[e + 2]),
                  std::hypot((*by_points)[e], (*by_points)[e + 1], (*by_points)[e + 2]), 1e-12);
    }
  }
}

TEST(LineResidual, VanishesExactlyWhereBothEndsLieOnTheProjectedLine) {
  const CameraModel& model = *FindCameraModel("OPENCV");
  Scene scene;
  const Slot camera = scene.Camera(model), pose = scene.Pose(), line = scene.Line();
  const Rigid3d cam_from_world(
      Eigen::Quaterniond(pose.values[3], pose.values[0], pose.values[1], pose.values[2]),
      {pose.values[4], pose.values[5], pose.values[6]});
  const Eigen::Map<const Eigen::Vector3d> d(line.values.data()), p(line.values.data() + 3);
  Eigen::Vector2d start, end;
  ASSERT_TRUE(model.project(camera.values.data(), cam_from_world * (p - 0.5 * d), &start));
  ASSERT_TRUE(model.project(camera.values.data(), cam_from_world * (p + 0.8 * d), &end));
  const SegmentDatum datum{IdealObservation(model, camera.values.data(), start),
                           IdealObservation(model, camera.values.data(), end), nullptr};
  const auto r = Value(LineResidual{{&model, true}}, datum, {line, pose, camera});
  ASSERT_TRUE(r);
  EXPECT_THAT(*r, testing::Each(testing::DoubleNear(0.0, 1e-9)));
}

TEST(LineResidual, StaysWellConditionedForLinesThroughTheOrigin) {
  const CameraModel& model = *FindCameraModel("PINHOLE");
  Scene scene;
  const Slot camera = scene.Camera(model);
  for (const double distance : {1.0, 1e-2, 1e-8, 0.0}) {
    Slot line = scene.Line();
    Eigen::Map<Eigen::Vector3d> d(line.values.data()), p(line.values.data() + 3);
    d = Eigen::Vector3d(0.6, 0.8, 0.0);
    p = distance * Eigen::Vector3d(-0.8, 0.6, 0.0);
    Eigen::Matrix<double, 16, 4> stacked;
    for (int view = 0; view < 4; ++view) {
      const Slot pose = scene.Pose();
      double r[4], J[16];
      const double* values[] = {line.values.data(), pose.values.data(), camera.values.data()};
      double* jacobians[] = {J, nullptr, nullptr};
      ASSERT_TRUE(
          LineResidual({{&model, false}})
              .Evaluate(scene.Segment(model, camera.values, nullptr), values, r, jacobians));
      stacked.middleRows<4>(4 * view) = Eigen::Map<RowMajor<4, 4>>(J);
    }
    const Eigen::Vector4d singular = Eigen::JacobiSVD<Eigen::MatrixXd>(stacked).singularValues();
    EXPECT_GT(singular[3], 1.0) << "at distance " << distance;
  }
}

TEST(PointResidual, IsAbsentBehindTheCamera) {
  const CameraModel& model = *FindCameraModel("SIMPLE_PINHOLE");
  Scene scene;
  Slot pose = scene.Pose();
  pose.values[6] = -8;
  EXPECT_FALSE(Value(PointResidual{&model}, {scene.Pixel(), nullptr},
                     {scene.Point(), pose, scene.Camera(model)}));
}

}  // namespace
}  // namespace holba
