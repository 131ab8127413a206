// SPDX-License-Identifier: BSD-3-Clause
// What fixes the gauge, against the rank of the Jacobian of all residuals: without the gauge's
// coordinates held, as many directions are free as it holds; with them, none.
#include "holba/bundle/gauge.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <bit>

#include "holba/base/random.h"
#include "holba/bundle/bundle_testing.h"
#include "holba/synthetic/bundle_problem.h"

namespace holba {
namespace {

// Directions of all that is variable that no residual resists.
int Nullity(const Problem& problem) {
  std::vector<int> first_column(problem.num_blocks(), -1);
  int num_columns = 0;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    first_column[id] = num_columns;
    num_columns += problem.block(id).FreeTangent();
  }
  std::vector<Eigen::RowVectorXd> rows;
  for (const auto& batch : problem.batches()) {
    for (size_t i = 0; i < batch->size(); ++i) {
      double residual[kMaxResidualDim];
      double storage[kMaxSlots][kMaxResidualDim * kMaxTangent];
      bool present = false;
      ResidualPanel panel;
      panel.residuals = residual;
      panel.present = &present;
      for (int s = 0; s < batch->num_slots(); ++s) panel.jacobians[s] = storage[s];
      batch->Evaluate(i, i + 1, problem.Reader(), panel);
      EXPECT_TRUE(present);
      for (int r = 0; r < batch->dim(); ++r) {
        Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(num_columns);
        for (int s = 0; s < batch->num_slots(); ++s) {
          const ParameterBlock& block = problem.block(batch->block(i, s));
          int column = first_column[batch->block(i, s)];
          for (int k = 0; k < batch->tangent(s); ++k) {
            if (block.FreeMask() >> k & 1) row[column++] += storage[s][r * batch->tangent(s) + k];
          }
        }
        rows.push_back(row);
      }
    }
  }
  Eigen::MatrixXd J(rows.size(), num_columns);
  for (size_t r = 0; r < rows.size(); ++r) J.row(r) = rows[r];
  for (int c = 0; c < num_columns; ++c) J.col(c) /= std::max(J.col(c).norm(), 1e-300);
  const Eigen::VectorXd singular = Eigen::BDCSVD<Eigen::MatrixXd>(J).singularValues();
  return static_cast<int>((singular.array() < 1e-8 * singular[0]).count());
}

// Six cameras that all see everything: twelve points, of which six lie on z = 0, four skew lines,
// two parallel ones on z = 0, and groups of them.
class GaugeTest : public testing::Test {
 protected:
  GaugeTest() {
    for (int i = 0; i < 6; ++i) {
      images_.push_back(maker_.AddImage(
          {7.0 * std::cos(1.0 * i), 6.0 * std::sin(1.0 * i), 4.0 + 0.3 * i}, {0, 0, 0}));
    }
    maker_.Finish();
    Random random(3);
    const auto draw = [&] {
      return Eigen::Vector3d(random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(0.5, 2));
    };
    for (int k = 0; k < 12; ++k) {
      Eigen::Vector3d X = draw();
      if (k < 6) X.z() = 0.0;
      points_.push_back(maker_.AddPoint(X, images_));
    }
    for (int k = 0; k < 4; ++k) lines_.push_back(maker_.AddLine(draw(), draw(), images_));
    for (const double y : {-1.0, 1.5})
      lines_.push_back(maker_.AddLine({-1, y, 0}, {1.5, y, 0}, images_));
    options_ = PlainOptions();
    options_.refine_focal_length = options_.refine_extra_params = false;
  }

  BundleSelection Select() const { return BundleSelection::Everything(maker_.model, options_); }
  void ExpectFree(int expected, BundleSelection selection, const std::string& what) const {
    selection.gauge = ChooseGauge(maker_.model, options_, selection);
    const FixedGauge& gauge = selection.gauge;
    EXPECT_EQ(std::popcount(gauge.origin_held) + std::popcount(gauge.scale_held), expected) << what;
    EXPECT_EQ(Nullity(BuildProblem(maker_.model, options_, selection).problem), 0) << what;
    selection.gauge = {};
    EXPECT_EQ(Nullity(BuildProblem(maker_.model, options_, selection).problem), expected) << what;
  }
  // With a group of this type that is held.
  void ExpectFreeWithGroup(int expected, std::string_view type, std::vector<double> params,
                           std::vector<point3D_t> points, std::vector<line3D_t> lines) {
    maker_.AddGroup(type, std::move(params), std::move(points), std::move(lines));
    options_.fix_groups = true;
    ExpectFree(expected, Select(), std::string(type));
    EXPECT_TRUE(Select().gauge.needs_structure);
  }

  ModelMaker maker_;
  std::vector<image_t> images_;
  std::vector<point3D_t> points_;
  std::vector<line3D_t> lines_;
  BundleOptions options_;
};

TEST_F(GaugeTest, IsTwoCamerasWhereNothingIsHeld) {
  ExpectFree(7, Select(), "nothing");
  const FixedGauge gauge = Select().gauge;
  EXPECT_EQ(gauge.origin_frame, maker_.model.images.begin()->second.frame_id);
  EXPECT_EQ(gauge.origin_held, FixedGauge::kWholePose);
  EXPECT_FALSE(gauge.needs_structure);
}

TEST_F(GaugeTest, CountsHeldPoints) {
  options_.config = BundleConfig::kPoint;
  const int free[] = {7, 4, 1, 0};
  for (size_t n = 0; n < std::size(free); ++n) {
    BundleSelection selection = Select();
    for (size_t k = 0; k < n; ++k) selection.points[k].constant = true;
    ExpectFree(free[n], selection, std::to_string(n) + " points");
  }
}

TEST_F(GaugeTest, CountsHeldFrames) {
  for (int n = 1; n <= 2; ++n) {
    BundleSelection selection = Select();
    for (int k = 0; k < n; ++k) selection.frames[2 * k].constant = true;
    ExpectFree(2 - n, selection, std::to_string(n) + " frames");
  }
}

TEST_F(GaugeTest, CountsHeldLines) {
  const auto expect = [&](int free, std::vector<size_t> held) {
    BundleSelection selection = Select();
    for (const size_t k : held) selection.lines[k].constant = true;
    ExpectFree(free, selection, std::to_string(held.size()) + " lines");
  };
  expect(3, {0});     // turning about it, sliding along it, scaling about one of its points
  expect(0, {0, 1});  // skew
  expect(1, {4, 5});  // parallel: sliding along them
  // Lines take no part in points alone.
  options_.config = BundleConfig::kPoint;
  expect(7, {0, 1});
}

TEST_F(GaugeTest, CountsAHeldPlane) {
  // Turning about its normal, sliding along it, scaling about one of its points.
  ExpectFreeWithGroup(4, "PLANE", {0, 0, 1, 0}, {points_.begin(), points_.begin() + 6}, {});
}

TEST_F(GaugeTest, CountsAHeldPlaneOfLines) {
  ExpectFreeWithGroup(4, "PLANE", {0, 0, 1, 0}, {}, {lines_[4], lines_[5]});
}

TEST_F(GaugeTest, CountsAHeldDirection) {
  ExpectFreeWithGroup(5, "VP", {1, 0, 0}, {}, {lines_[4], lines_[5]});
}

TEST_F(GaugeTest, CountsOnlyWhatTheMembersOfAHeldGroupResist) {
  // One point on the plane says nothing about how it is turned.
  ExpectFreeWithGroup(6, "PLANE", {0, 0, 1, 0}, {points_[0]}, {});
}

TEST_F(GaugeTest, CountsAHeldSphere) {
  std::vector<point3D_t> on_sphere;
  Random random(5);
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d u(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
    on_sphere.push_back(
        maker_.AddPoint(Eigen::Vector3d(0.3, 0.2, 1) + 1.2 * u.normalized(), images_));
  }
  ExpectFreeWithGroup(3, "SPHERE", {0.3, 0.2, 1, 1.2}, on_sphere, {});
}

TEST_F(GaugeTest, IsTheSameWhereverTheSceneLies) {
  maker_.AddGroup("PLANE", {0, 0, 1, 0}, {points_.begin(), points_.begin() + 6}, {});
  const auto masks = [&] {
    std::vector<uint32_t> list;
    for (const bool held_plane : {false, true}) {
      options_.fix_groups = held_plane;
      const FixedGauge gauge = Select().gauge;
      list.insert(list.end(), {gauge.origin_frame, gauge.origin_held, gauge.scale_frame,
                               gauge.scale_held});
    }
    return list;
  };
  const std::vector<uint32_t> here = masks();
  maker_.model.Transform({1.0, Eigen::Quaterniond::Identity(), Eigen::Vector3d(1e5, -2e5, 3e4)});
  EXPECT_EQ(masks(), here);
  maker_.model.Transform({1e3, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()});
  EXPECT_EQ(masks(), here);
}

TEST_F(GaugeTest, IsTheFirstFrameAloneWhereABaselineFixesTheScale) {
  const Reconstruction model = MakeBundleProblem({.num_images = 10, .rig_size = 2}).perturbed;
  options_.refine_sensor_from_rig = false;
  const FixedGauge gauge = BundleSelection::Everything(model, options_).gauge;
  EXPECT_EQ(gauge.origin_frame, model.images.begin()->second.frame_id);
  EXPECT_EQ(gauge.origin_held, FixedGauge::kWholePose);
  EXPECT_EQ(gauge.scale_held, 0u);
}

TEST_F(GaugeTest, IsNothingWhereItIsFreeOrNoFrameMoves) {
  options_.gauge = Gauge::kFree;
  EXPECT_EQ(Select().gauge.origin_frame, kInvalidId32);
  options_.gauge = Gauge::kTwoCams;
  options_.fix_poses = true;
  EXPECT_EQ(Select().gauge.origin_frame, kInvalidId32);
}

TEST_F(GaugeTest, StaysAsChosenWhereTheModelMoves) {
  const BundleSelection selection = Select();
  Reconstruction moved = maker_.model;
  for (const frame_t id : {frame_t{2}, frame_t{3}, frame_t{4}, frame_t{5}}) {
    Rigid3d pose = moved.frames.at(id).rig_from_world;
    pose.translation += Eigen::Vector3d(0, 0, 100.0 * id);
    moved.SetFramePose(id, pose);
    const BundleProblem bundle = BuildProblem(moved, options_, selection);
    for (const auto& [frame_id, block_id] : bundle.poses) {
      const ParameterBlock& block = bundle.problem.block(block_id);
      EXPECT_EQ(block.constant, frame_id == selection.gauge.origin_frame);
      EXPECT_EQ(block.held,
                frame_id == selection.gauge.scale_frame ? selection.gauge.scale_held : 0u);
    }
  }
}

// Two rings of cameras, each around points of its own.
class PartsTest : public testing::Test {
 protected:
  PartsTest() {
    for (int i = 0; i < 8; ++i) {
      const double x = i < 4 ? 0.0 : 40.0;
      maker_.AddImage({x + 7.0 * std::cos(1.5 * i), 6.0 * std::sin(1.5 * i), 4.0 + 0.3 * i},
                      {x, 0, 0});
    }
    maker_.Finish();
    Random random(5);
    for (int k = 0; k < 24; ++k) {
      const double x = k < 12 ? 0.0 : 40.0;
      maker_.AddPoint({x + random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(0, 2)},
                      k < 12 ? std::vector<image_t>{1, 2, 3, 4} : std::vector<image_t>{5, 6, 7, 8});
    }
    options_ = PlainOptions();
    options_.refine_focal_length = options_.refine_extra_params = false;
  }

  BundleSelection Select() const { return BundleSelection::Everything(maker_.model, options_); }
  ModelMaker maker_;
  BundleOptions options_;
};

TEST_F(PartsTest, HaveAGaugeEach) {
  BundleSelection selection = Select();
  ASSERT_EQ(selection.gauges_of_other_parts.size(), 1u);
  EXPECT_EQ(selection.gauge.origin_frame, maker_.model.images.at(1).frame_id);
  EXPECT_EQ(selection.gauges_of_other_parts[0].origin_frame, maker_.model.images.at(5).frame_id);
  EXPECT_EQ(Nullity(BuildProblem(maker_.model, options_, selection).problem), 0);
  selection.gauges_of_other_parts.clear();
  EXPECT_EQ(Nullity(BuildProblem(maker_.model, options_, selection).problem), 7);
}

TEST_F(PartsTest, AreOneWhereAPointIsSeenFromBoth) {
  maker_.AddPoint({0, 0, 0.5}, {1, 5});
  EXPECT_TRUE(Select().gauges_of_other_parts.empty());
}

TEST_F(PartsTest, AreOneWhereTheyShareAPlane) {
  maker_.AddGroup("PLANE", {0, 0, 1, 0}, {100, 101, 120, 121}, {});
  EXPECT_TRUE(Select().gauges_of_other_parts.empty());
  options_.config = BundleConfig::kPoint;
  EXPECT_EQ(Select().gauges_of_other_parts.size(), 1u);
}

TEST_F(PartsTest, DoNotCountImagesThatSeeNothing) {
  maker_.AddImage({0, 0, 90}, {0, 0, 0});
  maker_.model.AddTrivialRigsAndFrames();
  EXPECT_EQ(Select().gauges_of_other_parts.size(), 1u);
}

}  // namespace
}  // namespace holba
