// SPDX-License-Identifier: BSD-3-Clause
// Poses of sensors in their rigs that are adjusted.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <optional>
#include <vector>

#include "holba/base/random.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/adjust_local.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/bundle/uncertainty.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

// A reference and two sensors, whose poses are some degrees and centimetres off.
Reconstruction PerturbedRig(const BundleProblemOptions& options) {
  Reconstruction model = MakeBundleProblem(options).perturbed;
  Random random(5);
  for (auto& [id, rig] : model.rigs) {
    for (Rig::Sensor& sensor : rig.sensors) {
      const auto noise = [&](double s) {
        return Eigen::Vector3d(random.Normal(s), random.Normal(s), random.Normal(s));
      };
      sensor.sensor_from_rig->rotation =
          ExpRotation(noise(0.02)) * sensor.sensor_from_rig->rotation;
      sensor.sensor_from_rig->translation += noise(0.03);
    }
  }
  for (const auto& [id, frame] : model.frames)
    model.SetFramePose(id, Rigid3d(frame.rig_from_world));
  return model;
}

BundleProblemOptions ThreeSensors(double noise_px) {
  return {.seed = 3,
          .num_images = 24,
          .observation_noise_px = noise_px,
          .vps = true,
          .camera_model = "OPENCV",
          .rig_size = 3};
}

BundleOptions HeldIntrinsicsOptions() {
  BundleOptions options = PlainOptions();
  options.refine_focal_length = options.refine_extra_params = false;
  return options;
}

const std::vector<Rig::Sensor>& SensorsOf(const Reconstruction& model) {
  return std::find_if(model.rigs.begin(), model.rigs.end(),
                      [](const auto& entry) { return !entry.second.sensors.empty(); })
      ->second.sensors;
}

// Distance of two frames: what the gauge may leave of the scale.
double Size(const Reconstruction& model) {
  const auto first = model.frames.begin();
  double farthest = 0.0;
  for (const auto& [id, frame] : model.frames) {
    farthest = std::max(
        farthest,
        (frame.rig_from_world.OriginInA() - first->second.rig_from_world.OriginInA()).norm());
  }
  return farthest;
}

constexpr Backend kBackends[] = {
    Backend::kNative,
#ifdef HOLBA_WITH_CERES
    Backend::kCeres,
#endif
};

class SensorPoses : public testing::TestWithParam<Backend> {
 protected:
  SolverOptions Solver() const {
    SolverOptions options = TightSolver();
    options.backend = GetParam();
    return options;
  }
};

TEST_P(SensorPoses, AreFoundFromObservationsWithoutNoise) {
  const Reconstruction truth = MakeBundleProblem(ThreeSensors(0.0)).truth;
  for (const BundleConfig config : {BundleConfig::kPoint, BundleConfig::kHolistic}) {
    Reconstruction model = PerturbedRig(ThreeSensors(0.0));
    BundleOptions options = HeldIntrinsicsOptions();
    options.config = config;
    const BundleSummary summary = AdjustBundle(options, Solver(), &model);
    EXPECT_EQ(summary.num_sensors, 2u);
    EXPECT_TRUE(summary.held_sensors.empty());
    EXPECT_LT(summary.solver.final_cost, 1e-9 * summary.solver.initial_cost);
    const double scale = Size(truth) / Size(model);
    ASSERT_EQ(SensorsOf(model).size(), 2u);
    for (size_t s = 0; s < 2; ++s) {
      const Rigid3d &found = *SensorsOf(model)[s].sensor_from_rig,
                    &expected = *SensorsOf(truth)[s].sensor_from_rig;
      EXPECT_LT(found.rotation.angularDistance(expected.rotation), 1e-6);
      EXPECT_LT((scale * found.translation - expected.translation).norm(), 1e-5);
    }
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  }
}

TEST_P(SensorPoses, LowerTheCostAndLeaveItWhereTheyAreHeld) {
  const Reconstruction start = PerturbedRig(ThreeSensors(1.0));
  BundleOptions options = HeldIntrinsicsOptions();
  Reconstruction model = start;
  const double cost = AdjustBundle(options, Solver(), &model).solver.final_cost;
  for (const bool by_fixed_poses : {false, true}) {
    options.refine_sensor_from_rig = by_fixed_poses;
    options.fix_poses = by_fixed_poses;
    Reconstruction held = start;
    const BundleSummary summary = AdjustBundle(options, Solver(), &held);
    EXPECT_EQ(summary.num_sensors, 0u);
    EXPECT_GT(summary.solver.final_cost, 2.0 * cost);
    for (size_t s = 0; s < 2; ++s) {
      const Rigid3d &a = *SensorsOf(held)[s].sensor_from_rig,
                    &b = *SensorsOf(start)[s].sensor_from_rig;
      EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
      EXPECT_EQ(a.translation, b.translation);
    }
  }
}

// The whole way: measured losses, the gate, the test of what moves the cameras.
TEST_P(SensorPoses, AreAdjustedInAllRounds) {
  Reconstruction model = PerturbedRig(ThreeSensors(1.0));
  BundleOptions options;
  options.refine_focal_length = options.refine_extra_params = false;
  SolverOptions solver;
  solver.backend = GetParam();
  const BundleSummary summary = AdjustBundle(options, solver, &model);
  EXPECT_EQ(summary.num_sensors, 2u);
  const Reconstruction truth = MakeBundleProblem(ThreeSensors(1.0)).truth;
  for (size_t s = 0; s < 2; ++s) {
    EXPECT_LT(SensorsOf(model)[s].sensor_from_rig->rotation.angularDistance(
                  SensorsOf(truth)[s].sensor_from_rig->rotation),
              2e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, SensorPoses, testing::ValuesIn(kBackends));

#ifdef HOLBA_WITH_CERES
TEST(SensorPosesOfBackends, AreTheSame) {
  Reconstruction models[2];
  double cost[2];
  for (const int i : {0, 1}) {
    models[i] = PerturbedRig(ThreeSensors(1.0));
    SolverOptions solver = TightSolver();
    solver.backend = kBackends[i];
    cost[i] = AdjustBundle(HeldIntrinsicsOptions(), solver, &models[i]).solver.final_cost;
  }
  EXPECT_NEAR(cost[0], cost[1], 1e-12 * cost[0]);
  for (size_t s = 0; s < 2; ++s) {
    const Rigid3d &a = *SensorsOf(models[0])[s].sensor_from_rig,
                  &b = *SensorsOf(models[1])[s].sensor_from_rig;
    EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-6);
    EXPECT_LT((a.translation - b.translation).norm(), 1e-5);
  }
}
#endif

// Models without sensors beside the reference know nothing of them.
TEST(SensorPosesOfTrivialRigs, ChangeNoBit) {
  const Reconstruction start = MakeBundleProblem({.seed = 2, .num_images = 10}).perturbed;
  Reconstruction models[2] = {start, start};
  BundleOptions options = PlainOptions();
  for (const int refine : {0, 1}) {
    options.refine_sensor_from_rig = refine == 1;
    const BundleSummary summary = AdjustBundle(options, TightSolver(), &models[refine]);
    EXPECT_EQ(summary.num_sensors + summary.held_sensors.size(), 0u);
  }
  for (const auto& [id, frame] : models[0].frames) {
    const Rigid3d &a = frame.rig_from_world, &b = models[1].frames.at(id).rig_from_world;
    EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
    EXPECT_EQ(a.translation, b.translation);
  }
  for (const auto& [id, point] : models[0].points3D)
    EXPECT_EQ(point.xyz, models[1].points3D.at(id).xyz);
}

// Dimension of the null space of the variable coordinates.
Eigen::Index Nullity(const Problem& problem) {
  std::vector<int> first(problem.num_blocks());
  int size = 0;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    first[id] = size;
    size += problem.block(id).FreeTangent();
  }
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
  for (const auto& batch : problem.batches()) {
    for (size_t i = 0; i < batch->size(); ++i) {
      double residual[kMaxResidualDim], storage[kMaxSlots][kMaxResidualDim * kMaxTangent];
      bool present = false;
      ResidualPanel panel;
      panel.residuals = residual;
      panel.present = &present;
      for (int s = 0; s < batch->num_slots(); ++s) panel.jacobians[s] = storage[s];
      batch->Evaluate(i, i + 1, problem.Reader(), panel);
      Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(batch->dim(), size);
      for (int s = 0; present && s < batch->num_slots(); ++s) {
        const BlockId id = batch->block(i, s);
        int column = first[id];
        for (int k = 0; k < batch->tangent(s); ++k) {
          if (!(problem.block(id).FreeMask() >> k & 1)) continue;
          for (int r = 0; r < batch->dim(); ++r)
            rows(r, column) += storage[s][r * batch->tangent(s) + k];
          ++column;
        }
      }
      H += rows.transpose() * rows;
    }
  }
  // Unit diagonal: coordinates of all kinds count alike.
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseMax(1e-12).cwiseInverse();
  const Eigen::VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(scale.asDiagonal() * H * scale.asDiagonal())
          .eigenvalues();
  return (eigenvalues.array() < 1e-11).count();
}

void ExpectGauge(const Reconstruction& model, const BundleOptions& options, Eigen::Index free) {
  BundleSelection selection = BundleSelection::Everything(model, options);
  EXPECT_EQ(Nullity(BuildProblem(model, options, selection).problem), 0);
  selection.SetGauges(std::vector<FixedGauge>(1));
  EXPECT_EQ(Nullity(BuildProblem(model, options, selection).problem), free);
}

class SensorGauge : public testing::Test {
 protected:
  SensorGauge() { options_.config = BundleConfig::kPoint; }

  // Of `num_sensors` cameras each, 0.4 apart, whose frames are `step` apart.
  void MakeRigs(int num_frames, int num_sensors, double step, int num_points = 30) {
    ModelMaker maker;
    std::vector<image_t> images;
    for (int s = 0; s < num_sensors; ++s) {
      for (int f = 0; f < num_frames; ++f) {
        const double x = 0.4 * s + step * f;
        const image_t id = maker.AddImage({x, -8.0 + 0.3 * step * f, 0.1 * s}, {0.3 * x, 0, 0});
        if (f == 0 && s > 0) maker.model.cameras.Add(100 + s, maker.model.cameras.at(1));
        maker.model.images.at(id).camera_id = s == 0 ? 1 : 100 + s;
        images.push_back(id);
      }
    }
    Rig rig;
    rig.ref_sensor = SensorId{SensorType::kCamera, 1};
    const auto image_of = [&](int f, int s) { return images[s * num_frames + f]; };
    for (int s = 1; s < num_sensors; ++s) {
      rig.sensors.push_back({{SensorType::kCamera, static_cast<camera_t>(100 + s)},
                             maker.model.images.at(image_of(0, s)).cam_from_world *
                                 maker.model.images.at(image_of(0, 0)).cam_from_world.Inverse()});
    }
    maker.model.rigs.Add(1, rig);
    for (int f = 0; f < num_frames; ++f) {
      Frame frame;
      frame.rig_id = 1;
      frame.rig_from_world = maker.model.images.at(image_of(f, 0)).cam_from_world;
      for (int s = 0; s < num_sensors; ++s) {
        Image& image = maker.model.images.at(image_of(f, s));
        image.frame_id = f + 1;
        frame.data.push_back({{SensorType::kCamera, image.camera_id}, image_of(f, s)});
      }
      maker.model.frames.Add(f + 1, frame);
      maker.model.SetFramePose(f + 1, frame.rig_from_world);
    }
    Random random(1);
    for (int k = 0; k < num_points; ++k) {
      maker.AddPoint({random.Uniform(-1.5, 1.5), random.Uniform(-1.5, 1.5), random.Uniform(-1, 1)},
                     images);
    }
    model_ = maker.model;
    images_ = images;
  }
  // Takes all observations of a camera but those of the first points.
  void TakeObservations(camera_t camera_id, size_t but) {
    for (const auto& [id, point] : model_.points3D) {
      if (but > 0 && but-- > 0) continue;
      const std::vector<PointObservation> track = point.track;
      for (const PointObservation& observation : track) {
        if (model_.images.at(observation.image_id).camera_id == camera_id)
          model_.DeleteObservation(observation);
      }
    }
  }
  BundleSelection Select() const { return BundleSelection::Everything(model_, options_); }

  Reconstruction model_;
  std::vector<image_t> images_;
  BundleOptions options_ = HeldIntrinsicsOptions();
};

TEST_F(SensorGauge, IsThatOfTwoFramesWhereTheseAreFarther) {
  MakeRigs(4, 3, 1.0);
  const FixedGauge gauge = Select().gauge;
  EXPECT_EQ(gauge.origin_held, FixedGauge::kWholePose);
  EXPECT_EQ(gauge.scale_frame, 4u);
  EXPECT_EQ(gauge.scale_rig, kInvalidId32);
  ExpectGauge(model_, options_, 7);
}

TEST_F(SensorGauge, HasTheScaleOfTheBaselineInARigThatNearlyStandsStill) {
  MakeRigs(4, 3, 0.05);
  const FixedGauge gauge = Select().gauge;
  EXPECT_EQ(gauge.scale_frame, kInvalidId32);
  EXPECT_EQ(gauge.scale_rig, 1u);
  EXPECT_EQ(gauge.scale_camera, 102u);
  ExpectGauge(model_, options_, 7);
}

TEST_F(SensorGauge, HasTheScaleOfTheBaselineInASingleFrame) {
  MakeRigs(1, 3, 1.0);
  EXPECT_EQ(Select().gauge.scale_rig, 1u);
  ExpectGauge(model_, options_, 7);
}

TEST_F(SensorGauge, IsThatOfTheFirstFrameWhereASensorWithABaselineIsHeld) {
  MakeRigs(4, 3, 1.0);
  TakeObservations(101, 3);
  const BundleSelection selection = Select();
  ASSERT_EQ(selection.held_sensors.size(), 1u);
  EXPECT_EQ(selection.held_sensors[0].camera_id, 101u);
  EXPECT_EQ(selection.held_sensors[0].num_observations, 12u);
  EXPECT_EQ(selection.held_sensors[0].why, HeldSensor::Why::kTooFewObservations);
  ASSERT_EQ(selection.sensors.size(), 1u);
  EXPECT_EQ(selection.sensors[0].camera_id, 102u);
  EXPECT_EQ(selection.gauge.scale_held, 0u);
  ExpectGauge(model_, options_, 6);
}

TEST_F(SensorGauge, HoldsASensorInThePlaceOfAReferenceThatSeesNothing) {
  MakeRigs(4, 3, 1.0);
  TakeObservations(1, 0);
  const BundleSelection selection = Select();
  ASSERT_EQ(selection.held_sensors.size(), 1u);
  EXPECT_EQ(selection.held_sensors[0].why, HeldSensor::Why::kStandsForReference);
  EXPECT_EQ(selection.sensors.size(), 1u);
  EXPECT_NE(selection.gauge.scale_held, 0u);
  ExpectGauge(model_, options_, 7);
}

// Where the rig puts a reference that sees nothing is a convention: a far one is neither the way of
// the frames nor a baseline.
TEST_F(SensorGauge, DoesNotDependOnThePlaceOfAReferenceThatSeesNothing) {
  for (const double step : {1.0, 0.05}) {
    MakeRigs(4, 3, step);
    TakeObservations(1, 0);
    const FixedGauge before = Select().gauge;
    EXPECT_EQ(before.scale_rig == kInvalidId32, step == 1.0);
    const Rigid3d moved_from_rig(ExpRotation({0.2, -0.1, 0.3}), {1, 50, -3});
    for (auto& [id, rig] : model_.rigs) {
      for (Rig::Sensor& sensor : rig.sensors)
        sensor.sensor_from_rig = *sensor.sensor_from_rig * moved_from_rig.Inverse();
    }
    std::vector<frame_t> frames;
    for (const auto& [id, frame] : model_.frames) frames.push_back(id);
    for (const frame_t id : frames)
      model_.SetFramePose(id, moved_from_rig * model_.frames.at(id).rig_from_world);
    const FixedGauge gauge = Select().gauge;
    EXPECT_EQ(gauge.scale_frame, before.scale_frame);
    EXPECT_EQ(gauge.scale_rig, before.scale_rig);
    EXPECT_EQ(gauge.scale_camera, before.scale_camera);
    ExpectGauge(model_, options_, 7);
  }
}

TEST_F(SensorGauge, HasNoScaleOfSensorsThatSeeNothing) {
  for (const bool refine : {true, false}) {
    options_.refine_sensor_from_rig = refine;
    MakeRigs(4, 2, 1.0);
    TakeObservations(101, 0);
    EXPECT_TRUE(Select().sensors.empty());
    EXPECT_TRUE(Select().held_sensors.empty());
    ExpectGauge(model_, options_, 7);
    MakeRigs(4, 3, 1.0);
    TakeObservations(101, 0);
    ExpectGauge(model_, options_, refine ? 7 : 6);
  }
}

TEST_F(SensorGauge, HoldsASensorThatIsAloneInItsFrames) {
  MakeRigs(4, 2, 1.0);
  // The reference in the first two frames, the other camera in the last two.
  for (const auto& [id, point] : model_.points3D) {
    const std::vector<PointObservation> track = point.track;
    for (const PointObservation& observation : track) {
      const Image& image = model_.images.at(observation.image_id);
      if ((image.camera_id == 1) == (image.frame_id > 2)) model_.DeleteObservation(observation);
    }
  }
  const BundleSelection selection = Select();
  EXPECT_TRUE(selection.sensors.empty());
  ASSERT_EQ(selection.held_sensors.size(), 1u);
  EXPECT_EQ(selection.held_sensors[0].num_observations, 0u);
  // No frame has a baseline that images see.
  ExpectGauge(model_, options_, 7);
}

TEST_F(SensorGauge, HasOneScaleForPartsThatShareTheRig) {
  MakeRigs(8, 2, 1.0);
  // Points of the first four frames, points of the last four.
  bool first = false;
  for (const auto& [id, point] : model_.points3D) {
    first = !first;
    const std::vector<PointObservation> track = point.track;
    for (const PointObservation& observation : track) {
      if ((model_.images.at(observation.image_id).frame_id <= 4) != first)
        model_.DeleteObservation(observation);
    }
  }
  const BundleSelection selection = Select();
  ASSERT_EQ(selection.gauges_of_other_parts.size(), 1u);
  EXPECT_NE(selection.gauge.scale_held, 0u);
  EXPECT_EQ(selection.gauges_of_other_parts[0].scale_held, 0u);
  ExpectGauge(model_, options_, 13);
}

TEST_F(SensorGauge, LeavesLocalAdjustmentsTheirRig) {
  MakeRigs(4, 2, 1.0);
  const Reconstruction before = model_;
  for (const bool hold : {true, false}) {
    model_ = before;
    for (auto& [id, rig] : model_.rigs) {
      for (Rig::Sensor& sensor : rig.sensors) sensor.sensor_from_rig->translation.y() += 0.01;
    }
    for (const auto& [id, frame] : before.frames) model_.SetFramePose(id, frame.rig_from_world);
    const Rigid3d moved = *SensorsOf(model_)[0].sensor_from_rig;
    const std::vector<image_t> centre{images_[0], images_[1], images_[2]};
    const BundleSelection part = BundleSelection::Around(
        model_, options_, centre, {.surroundings = true, .hold_cameras = hold});
    EXPECT_EQ(part.sensors.empty(), hold);
    AdjustLocal(options_, TightSolver(), part, nullptr, &model_);
    EXPECT_EQ(SensorsOf(model_)[0].sensor_from_rig->translation == moved.translation, hold);
    EXPECT_EQ(model_.FindInconsistency(), std::nullopt);
  }
}

// (J^T J)^-1 knows neither origin nor unit. The axes of the world it knows: the coordinate of a
// translation that is held for the scale is one of the local frame, whose middle is measured along
// the axes. So the rotation of a sensor is as certain in turned axes, and its translation is not
// quite (1e-4 here).
TEST(SensorCovariances, KnowNeitherOriginNorUnit) {
  const Reconstruction start = PerturbedRig(ThreeSensors(1.0));
  const auto estimate = [&](const Sim3d& by) {
    Reconstruction model = start;
    model.Transform(by);
    const BundleOptions options = HeldIntrinsicsOptions();
    const BundleSummary summary = AdjustBundle(options, TightSolver(), &model);
    return *EstimateUncertainty(model, options, summary, 1);
  };
  const ModelUncertainty here = estimate(Sim3d());
  ASSERT_EQ(here.sensors.size(), 2u);
  for (const double unit : {1e-3, 1e3, 1e6}) {
    for (const bool turned : {false, true}) {
      const ModelUncertainty there =
          estimate({unit, turned ? ExpRotation({0.3, 0.2, -1}) : Eigen::Quaterniond::Identity(),
                    unit * Eigen::Vector3d(4e5, 5e6, 300)});
      for (const auto& [id, C] : here.sensors) {
        Matrix6d by_unit = Matrix6d::Identity();
        by_unit.bottomRightCorner<3, 3>() /= unit;
        const Matrix6d D = by_unit * there.sensors.at(id) * by_unit;
        const int size = turned ? 3 : 6;
        EXPECT_LT((C - D).topLeftCorner(size, size).norm(),
                  1e-6 * C.topLeftCorner(size, size).norm());
        EXPECT_GT(C(0, 0), 0.0);
      }
    }
  }
}

}  // namespace
}  // namespace holba
