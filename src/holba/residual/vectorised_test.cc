// SPDX-License-Identifier: BSD-3-Clause
// Residuals evaluated in packs against the same evaluated one by one, for every instruction set.
#include "holba/residual/vectorised.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "holba/base/random.h"
#include "holba/camera/snavely.h"
#include "holba/problem/residual_batch.h"
#include "holba/residual/group_line.h"
#include "holba/residual/group_point.h"
#include "holba/residual/line.h"
#include "holba/residual/point.h"
#include "holba/residual/vanishing_point.h"
#include "holba/residual/wireframe_line.h"
#include "holba/residual/wireframe_point.h"
#include "holba/residual/with_sensor_pose.h"

namespace holba {
namespace {

// Doubles at a 64-byte boundary.
class AlignedDoubles {
 public:
  explicit AlignedDoubles(size_t size)
      : data_(static_cast<double*>(std::aligned_alloc(64, (size * 8 + 63) / 64 * 64))) {
    std::fill_n(data_.get(), size, std::numeric_limits<double>::quiet_NaN());
  }
  double* data() { return data_.get(); }

 private:
  struct Free {
    void operator()(double* p) const { std::free(p); }
  };
  std::unique_ptr<double[], Free> data_;
};

// One panel for a range of a batch.
struct Panel {
  ResidualPanel panel;
  std::vector<AlignedDoubles> storage;
  std::unique_ptr<bool[]> present;

  Panel(const ResidualBatch& batch, size_t stride, const std::vector<bool>& wanted) {
    panel.stride = stride;
    present = std::make_unique<bool[]>(stride);
    panel.present = present.get();
    storage.emplace_back(batch.dim() * stride);
    panel.residuals = storage.back().data();
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (!wanted[s]) continue;
      storage.emplace_back(batch.dim() * batch.tangent(s) * stride);
      panel.jacobians[s] = storage.back().data();
    }
  }
};

// Parameters of a scene: blocks of each kind, some poses with the scene behind them.
struct State {
  Random random{11};
  std::vector<double> values;
  std::vector<size_t> offsets;

  BlockId Add(const std::vector<double>& block) {
    offsets.push_back(values.size());
    values.insert(values.end(), block.begin(), block.end());
    return static_cast<BlockId>(offsets.size() - 1);
  }
  Eigen::Vector3d Vector(double s) {
    return {random.Normal(s), random.Normal(s), random.Normal(s)};
  }
  BlockId AddPose(bool behind) {
    const Eigen::Quaterniond q = ExpRotation(Vector(0.2));
    const Eigen::Vector3d t = Eigen::Vector3d(0, 0, behind ? -8 : 8) + Vector(0.3);
    return Add({q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()});
  }
  BlockId AddPoint() {
    const Eigen::Vector3d X = Vector(1.0);
    return Add({X.x(), X.y(), X.z()});
  }
  BlockId AddLine(const Eigen::Vector3d& d) {
    const Eigen::Vector3d p = Vector(1.0);
    return Add({d.x(), d.y(), d.z(), p.x(), p.y(), p.z()});
  }
};

// No sensors; some residuals through one that is held; all through sensors whose poses are blocks.
enum class Sensors { kNone, kMixed, kBlocks };

const SensorPose kSensor{ExpRotation({0.1, -0.2, 0.05}).toRotationMatrix(), {0.2, -0.1, 0.3}};

std::vector<double> ParamsOf(std::string_view model, double f) {
  if (model == "SIMPLE_PINHOLE") return {f, 500, 480};
  if (model == "PINHOLE") return {f, 1.1 * f, 500, 480};
  if (model == "SIMPLE_RADIAL") return {f, 500, 480, -0.1};
  if (model == "RADIAL") return {f, 500, 480, -0.1, 0.03};
  if (model == "OPENCV") return {f, 1.1 * f, 500, 480, -0.1, 0.02, 0.001, -0.002};
  // It sees to 109 degrees from its axis.
  if (model == "OPENCV_FISHEYE") return {f, 1.1 * f, 500, 480, 0.02, -0.01, 0.003, -0.001};
  return {f, 1.1 * f, 500, 480, -0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.005};
}

// A batch of 61 residuals of a kernel over the blocks of a scene, and what is needed to draw its
// data.
struct Case {
  std::string name;
  State state;
  std::unique_ptr<ResidualBatch> batch;
  bool expect_absent = true;
};

constexpr size_t kResiduals = 61;

class CaseBuilder {
 public:
  CaseBuilder(const CameraModel& model, Sensors sensors, bool shared_camera)
      : model_(model), sensors_(sensors) {
    for (int i = 0; i < 9; ++i) points_.push_back(state_.AddPoint());
    for (int i = 0; i < 9; ++i) lines_.push_back(state_.AddLine(state_.Vector(1.0).normalized()));
    for (int i = 0; i < 5; ++i) poses_.push_back(state_.AddPose(i == 3));
    for (int i = 0; i < (shared_camera ? 1 : 3); ++i) {
      cameras_.push_back(state_.Add(ParamsOf(model.name, 700 + 10 * i)));
    }
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d n = state_.Vector(1.0).normalized();
      planes_.push_back(state_.Add({n.x(), n.y(), n.z(), 0.3 * i}));
      vps_.push_back(state_.Add({n.x(), n.y(), n.z()}));
      if (i == 1) lines_.push_back(state_.AddLine(n));  // has no projection on that plane
    }
  }

  Case Point() {
    return Make(PointResidual{&model_}, {3, 6, model_.num_params}, points_, {},
                [this](size_t i) { return PointResidual::Datum{Pixel(), Sensor(i)}; });
  }
  Case GroupPoint(const GroupType& type) {
    return Make(GroupPointResidual{&model_, &type}, {3, 6, model_.num_params, 3}, points_, planes_,
                [this](size_t i) { return GroupPointResidual::Datum{Sensor(i)}; });
  }
  Case Line() {
    return Make(LineResidual{{&model_, false}}, {4, 6, model_.num_params}, lines_, {},
                [this](size_t i) { return Segment(i); });
  }
  Case GroupLine(const GroupType& type) {
    return Make(GroupLineResidual{{&model_, false}, &type}, {4, 6, model_.num_params, 3}, lines_,
                planes_, [this](size_t i) { return Segment(i); });
  }
  Case WireframePoint() {
    return Make(WireframePointResidual{{&model_, false}}, {3, 6, model_.num_params}, points_, {},
                [this](size_t i) { return Segment(i); });
  }
  Case WireframeLine() {
    return Make(
        WireframeLineResidual{{&model_, false}}, {4, 6, model_.num_params}, lines_, {},
        [this](size_t i) { return WireframeLineResidual::Datum{Observation(i), Sensor(i)}; });
  }
  Case ParallelLine(const GroupType& type) {
    auto batch = std::make_unique<KernelBatch<VanishingPointResidual>>(
        "vp", 3, std::vector<int>{4, 2}, VanishingPointResidual{&type});
    for (size_t i = 0; i < kResiduals; ++i) {
      batch->Add(std::vector<BlockId>{lines_[i % lines_.size()], vps_[(i / 3) % vps_.size()]}, {});
    }
    return {"vp", std::move(state_), std::move(batch), false};
  }

 private:
  Eigen::Vector2d Pixel() {
    return {500 + state_.random.Normal(150), 480 + state_.random.Normal(150)};
  }
  const SensorPose* Sensor(size_t i) {
    return sensors_ == Sensors::kMixed && i % 3 != 0 ? &kSensor : nullptr;
  }
  IdealObservation Observation(size_t i) {
    IdealObservation observation(model_, &state_.values[state_.offsets[cameras_[0]]], Pixel());
    if (i % 13 == 5) observation.valid = false;
    return observation;
  }
  SegmentDatum Segment(size_t i) {
    const IdealObservation start = Observation(i), end = Observation(i + 1);
    return {start, i % 17 == 3 ? start : end, Sensor(i)};  // also segments without length
  }

  template <typename Kernel, typename MakeDatum>
  Case Make(Kernel kernel, std::vector<int> tangents, const std::vector<BlockId>& features,
            const std::vector<BlockId>& groups, MakeDatum&& datum) {
    if constexpr (Kernel::kNumSlots < kMaxSlots) {
      if (sensors_ == Sensors::kBlocks) {
        sensors_ = Sensors::kNone;
        for (int i = 0; i < 3; ++i) sensor_blocks_.push_back(AddSensor());
        tangents.push_back(6);
        return Make(WithSensorPose<Kernel>{kernel}, std::move(tangents), features, groups, datum);
      }
    }
    auto batch =
        std::make_unique<KernelBatch<Kernel>>("term", Kernel::kDim, std::move(tangents), kernel);
    for (size_t i = 0; i < kResiduals; ++i) {
      std::vector<BlockId> blocks{features[i % features.size()], poses_[(i / 2) % poses_.size()],
                                  cameras_[i % cameras_.size()]};
      if (!groups.empty()) blocks.push_back(groups[(i / 3) % groups.size()]);
      if (!sensor_blocks_.empty()) blocks.push_back(sensor_blocks_[i % sensor_blocks_.size()]);
      batch->Add(blocks, datum(i));
    }
    return {"", std::move(state_), std::move(batch)};
  }

  BlockId AddSensor() {
    const Eigen::Quaterniond q = ExpRotation(state_.Vector(0.1));
    const Eigen::Vector3d t = state_.Vector(0.2);
    return state_.Add({q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()});
  }

  State state_;
  const CameraModel& model_;
  Sensors sensors_;
  std::vector<BlockId> points_, lines_, poses_, cameras_, planes_, vps_, sensor_blocks_;
};

// Evaluates the range in packs and one by one.
void ExpectAgreement(const Case& c, const ResidualRange& range, const std::vector<bool>& wanted,
                     int* absent, int* present) {
  const ResidualBatch& batch = *c.batch;
  const size_t stride = (range.count + kPanelLanes - 1) / kPanelLanes * kPanelLanes;
  Panel packs(batch, stride, wanted);
  batch.EvaluateRange(range, ParameterReader(c.state.values.data(), c.state.offsets.data()),
                      packs.panel);
  for (size_t j = 0; j < range.count; ++j) {
    const size_t i = range[j];
    Panel one(batch, 1, wanted);
    const double* slots[kMaxSlots] = {};
    for (int s = 0; s < batch.num_slots(); ++s) {
      slots[s] = &c.state.values[c.state.offsets[batch.block(i, s)]];
    }
    batch.EvaluateRange({i, 1}, ParameterReader(slots), one.panel);
    ASSERT_EQ(packs.panel.present[j], one.panel.present[0]) << c.name << ", residual " << i;
    one.panel.present[0] ? ++*present : ++*absent;
    for (int k = 0; k < batch.dim(); ++k) {
      // Differences of pixels, which are of the order of 1000, or of unit vectors.
      const double scale = c.name == "vp" ? 1.0 : 1e3 + std::abs(one.panel.residuals[k]);
      ASSERT_NEAR(packs.panel.residuals[k * stride + j], one.panel.residuals[k], 1e-12 * scale)
          << c.name << ", residual " << i << ", row " << k;
    }
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (!wanted[s]) continue;
      const int entries = batch.dim() * batch.tangent(s);
      double largest = 1.0;
      for (int k = 0; k < entries; ++k) {
        largest = std::max(largest, std::abs(one.panel.jacobians[s][k]));
      }
      for (int k = 0; k < entries; ++k) {
        ASSERT_NEAR(packs.panel.jacobians[s][k * stride + j], one.panel.jacobians[s][k],
                    1e-12 * largest)
            << c.name << ", residual " << i << ", slot " << s << ", entry " << k;
      }
    }
  }
}

// Ranges and lists of counts around the lanes, all Jacobians, some, none.
void ExpectAgreementOnRanges(const Case& c) {
  std::vector<uint32_t> list(kResiduals);
  std::iota(list.begin(), list.end(), 0);
  Random random(5);
  for (size_t i = kResiduals - 1; i > 0; --i) {
    std::swap(list[i], list[random.Uniform(0.0, 1.0) * (i + 1)]);
  }
  const int slots = c.batch->num_slots();
  std::vector<std::vector<bool>> choices{std::vector<bool>(slots, true),
                                         std::vector<bool>(slots, false)};
  for (int s = 0; s < slots; ++s) {
    choices.emplace_back(slots, true);
    choices.back()[s] = false;
  }
  for (const std::vector<bool>& wanted : choices) {
    int absent = 0, present = 0;
    for (size_t count : {size_t{1}, size_t{2}, size_t{7}, size_t{8}, size_t{9}, kResiduals - 3}) {
      ExpectAgreement(c, {3, count, nullptr}, wanted, &absent, &present);
      ExpectAgreement(c, {0, count, list.data()}, wanted, &absent, &present);
      if (testing::Test::HasFatalFailure()) return;
    }
    EXPECT_GT(present, 0) << c.name;
    EXPECT_EQ(absent > 0, c.expect_absent) << c.name;
  }
}

class Packs : public testing::TestWithParam<SimdTarget> {
 protected:
  void SetUp() override {
    if (!IsSupported(GetParam())) GTEST_SKIP() << "this CPU has no " << NameOf(GetParam());
    SetSimdTarget(GetParam());
  }
  void TearDown() override { SetSimdTarget(before_); }

  template <typename MakeCase>
  static void ForEachCamera(const std::string& name, MakeCase&& make,
                            std::vector<const CameraModel*> models = {}) {
    if (models.empty()) {
      for (const char* model : {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV",
                                "OPENCV_FISHEYE", "FULL_OPENCV"}) {
        models.push_back(FindCameraModel(std::string_view(model)));
      }
    }
    for (const CameraModel* model : models) {
      for (const Sensors sensors : {Sensors::kNone, Sensors::kMixed, Sensors::kBlocks}) {
        for (const bool shared : {true, false}) {
          CaseBuilder builder(*model, sensors, shared);
          Case c = make(builder);
          c.name = name + ", " + std::string(model->name) +
                   (sensors == Sensors::kMixed ? ", sensors" : "") +
                   (sensors == Sensors::kBlocks ? ", sensors as blocks" : "") +
                   (shared ? ", shared" : "");
          ExpectAgreementOnRanges(c);
        }
      }
    }
  }

 private:
  const SimdTarget before_ = CurrentSimdTarget();
};

const GroupType& kPlane() { return *FindGroupType("PLANE"); }

TEST_P(Packs, GivePointResidualsAsOneByOne) {
  ForEachCamera("point", [](CaseBuilder& b) { return b.Point(); });
}

TEST_P(Packs, GivePointResidualsOfTheBalCameraAlsoBehindIt) {
  ForEachCamera("point",
                [](CaseBuilder& b) {
                  Case c = b.Point();
                  c.expect_absent = false;
                  return c;
                },
                {&SnavelyCameraModel()});
}

TEST_P(Packs, GivePointsOnPlanesAsOneByOne) {
  ForEachCamera("group_point", [](CaseBuilder& b) { return b.GroupPoint(kPlane()); });
}

TEST_P(Packs, GiveLineResidualsAsOneByOne) {
  ForEachCamera("line", [](CaseBuilder& b) { return b.Line(); });
}

TEST_P(Packs, GiveLinesOnPlanesAsOneByOne) {
  ForEachCamera("group_line", [](CaseBuilder& b) { return b.GroupLine(kPlane()); });
}

TEST_P(Packs, GiveWireframePointsAsOneByOne) {
  ForEachCamera("wireframe_point", [](CaseBuilder& b) { return b.WireframePoint(); });
}

TEST_P(Packs, GiveWireframeLinesAsOneByOne) {
  ForEachCamera("wireframe_line", [](CaseBuilder& b) { return b.WireframeLine(); });
}

TEST_P(Packs, GiveVanishingPointsAsOneByOne) {
  CaseBuilder builder(*FindCameraModel("PINHOLE"), Sensors::kNone, true);
  ExpectAgreementOnRanges(builder.ParallelLine(*FindGroupType("VP")));
}

INSTANTIATE_TEST_SUITE_P(All, Packs,
                         testing::Values(SimdTarget::kScalar, SimdTarget::kVec128,
                                         SimdTarget::kVec256, SimdTarget::kVec512),
                         [](const auto& info) { return std::string(NameOf(info.param)); });

// The cases above would also pass if everything were evaluated one by one.
TEST(Vectorised, AreTheKernelsThatMatter) {
  double state[64] = {};
  state[3] = 1.0;  // a pose at the origin
  const size_t offsets[] = {8, 0, 16, 32};
  const uint32_t blocks[] = {0, 1, 2, 3};
  const PointResidual::Datum point{};
  const SegmentDatum segment{};
  const WireframeLineResidual::Datum observation{};
  double residuals[6 * 8];
  bool present[8];
  const auto vectorised = [&](const auto& kernel, const void* datum, size_t bytes, int num_slots) {
    return kernel.EvaluateVectorised({state,
                                      offsets,
                                      blocks,
                                      num_slots,
                                      datum,
                                      bytes,
                                      0,
                                      1,
                                      nullptr,
                                      8,
                                      residuals,
                                      {},
                                      present});
  };
  for (const char* name :
       {"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"}) {
    const CameraModel& model = *FindCameraModel(std::string_view(name));
    EXPECT_TRUE(vectorised(PointResidual{&model}, &point, sizeof(point), 3)) << name;
    const SensorPose* no_sensor = nullptr;
    EXPECT_TRUE(vectorised(GroupPointResidual{&model, &kPlane()}, &no_sensor, sizeof(no_sensor), 4))
        << name;
  }
  EXPECT_TRUE(vectorised(PointResidual{&SnavelyCameraModel()}, &point, sizeof(point), 3));
  for (const CameraModel* model : AllCameraModels()) {
    const bool has_calibration = model->name != "EQUIRECTANGULAR";
    const LineCamera still{model, false}, moving{model, true};
    EXPECT_EQ(vectorised(LineResidual{still}, &segment, sizeof(segment), 3), has_calibration);
    EXPECT_EQ(vectorised(GroupLineResidual{still, &kPlane()}, &segment, sizeof(segment), 4),
              has_calibration);
    EXPECT_EQ(vectorised(WireframePointResidual{still}, &segment, sizeof(segment), 3),
              has_calibration);
    EXPECT_EQ(vectorised(WireframeLineResidual{still}, &observation, sizeof(observation), 3),
              has_calibration);
    EXPECT_FALSE(vectorised(LineResidual{moving}, &segment, sizeof(segment), 3));
  }
}

}  // namespace
}  // namespace holba
