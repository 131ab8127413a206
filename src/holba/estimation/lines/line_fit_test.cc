// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "holba/estimation/lines/line_support_testing.h"
#include "holba/estimation/lines/line_uncertainty.h"

namespace holba {
namespace {

AnchoredLine LineOfEdge(const Edge3d& edge) {
  return {(edge.second - edge.first).normalized(), 0.5 * (edge.first + edge.second)};
}

TEST(LineSupport, ImageIsThatOfTheView) {
  const TestHouse house = MakeTestHouse({});
  const AnchoredLine line = LineOfEdge(house.edges[3]);
  for (const LineSupport& s : SupportsOfEdge(house, 3)) {
    const Eigen::Vector3d seen = *s.Image(line);
    const Eigen::Vector3d reference =
        *IdealView(house.model, static_cast<image_t>(s.view)).Project(line.Pluecker());
    EXPECT_LT((seen - reference).norm(), 1e-9 * reference.norm());
    // Of one sense with the segment.
    EXPECT_GT(seen.head<2>().dot(LineSegment2d{s.start, s.end}.Line().head<2>()), 0.999);
  }
}

TEST(FitLine, ComesBackToTheExactLine) {
  const TestHouse house = MakeTestHouse({});
  for (size_t e = 0; e < house.edges.size(); ++e) {
    const std::vector<LineSupport> supports = SupportsOfEdge(house, static_cast<int>(e));
    AnchoredLine line = LineOfEdge(house.edges[e]);
    line.direction = (line.direction + Eigen::Vector3d(0.03, -0.02, 0.04)).normalized();
    line.point += Eigen::Vector3d(0.02, 0.03, -0.03);
    ASSERT_TRUE(FitLine(supports, {}, 1.0, &line));
    EXPECT_LT(line.Pluecker().Distance(house.edges[e].first), 1e-7);
    EXPECT_LT(line.Pluecker().Distance(house.edges[e].second), 1e-7);
  }
}

TEST(FitLine, OneWildSegmentHardlyMovesIt) {
  TestHouse house = MakeTestHouse({});
  std::vector<LineSupport> supports = SupportsOfEdge(house, 0);
  supports[2].start.y() += 40.0;
  AnchoredLine line = LineOfEdge(house.edges[0]);
  ASSERT_TRUE(FitLine(supports, {}, 1.0, &line));
  EXPECT_LT(line.Pluecker().Distance(house.edges[0].first), 2e-3);
}

TEST(FitLine, PriorsHoldWhatPixelsDoNotSee) {
  const TestHouse house = MakeTestFacade({.noise_px = 0.2});
  const int along_x = 0;
  const std::vector<LineSupport> supports = SupportsOfEdge(house, along_x);
  const Edge3d& edge = house.edges[along_x];
  AnchoredLine start = LineOfEdge(edge);
  // In the plane of the cameras and the line: no pixel sees it.
  const Eigen::Vector3d to_cameras(0, start.point.y() - 0.05, 6.0);
  start.point -= 0.08 * to_cameras;
  start.direction = (start.direction + 0.05 * to_cameras.normalized()).normalized();
  LinePrior prior;
  prior.direction = Eigen::Vector3d::UnitX();
  prior.direction_weight = 500.0;
  AnchoredLine held = start;
  ASSERT_TRUE(FitLine(supports, prior, 1.0, &held));
  EXPECT_LT(held.direction.cross(Eigen::Vector3d::UnitX()).norm(), 2e-3);
  prior.plane = Eigen::Vector4d(0, 0, 1, 0);
  prior.plane_weight = 0.5;
  prior.t_start = -0.5;
  prior.t_end = 0.5;
  ASSERT_TRUE(FitLine(supports, prior, 1.0, &held));
  EXPECT_LT(held.Pluecker().Distance(edge.first), 0.01);
  EXPECT_LT(held.Pluecker().Distance(edge.second), 0.01);
}

TEST(FitLine, NeedsTwoSegments) {
  const TestHouse house = MakeTestHouse({});
  std::vector<LineSupport> supports = SupportsOfEdge(house, 0);
  supports.resize(1);
  AnchoredLine line = LineOfEdge(house.edges[0]);
  EXPECT_FALSE(FitLine(supports, {}, 1.0, &line));
  EXPECT_FALSE(FitLine({}, {}, 1.0, &line));
}

TEST(Uncertainty, IsTheSpreadOfFitsToNoisySegments) {
  const TestHouse exact = MakeTestHouse({});
  constexpr double kSigmaPx = 0.5;
  constexpr int kTrials = 1500;
  for (int e : {0, 4, 8, 13}) {
    const std::vector<LineSupport> supports = SupportsOfEdge(exact, e);
    const Edge3d& edge = exact.edges[e];
    const AnchoredLine truth = LineOfEdge(edge);
    const double half = 0.5 * (edge.second - edge.first).norm();
    const auto predicted = UncertaintyOfFit(supports, {}, kSigmaPx, truth, -half, half);
    ASSERT_TRUE(predicted.has_value());
    double depth_start = 0.0, depth_end = 0.0;
    for (const LineSupport& s : supports) {
      depth_start += s.Depth(truth.At(-half)) / supports.size();
      depth_end += s.Depth(truth.At(half)) / supports.size();
    }
    // Covariance of the ends' shift, of which the worst direction counts.
    Random random(11);
    Eigen::Matrix3d at_start = Eigen::Matrix3d::Zero(), at_end = Eigen::Matrix3d::Zero();
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<LineSupport> noisy = supports;
      for (LineSupport& s : noisy) {
        for (Eigen::Vector2d* x : {&s.start, &s.end}) {
          x->x() += random.Normal(kSigmaPx);
          x->y() += random.Normal(kSigmaPx);
        }
      }
      AnchoredLine line = truth;
      // Wide loss: least squares, which the covariance is of.
      ASSERT_TRUE(FitLine(noisy, {}, 100.0, &line));
      const PlueckerLine pluecker = line.Pluecker();
      const Eigen::Vector3d ds = pluecker.ClosestPoint(truth.At(-half)) - truth.At(-half);
      const Eigen::Vector3d de = pluecker.ClosestPoint(truth.At(half)) - truth.At(half);
      at_start += ds * ds.transpose() / kTrials;
      at_end += de * de.transpose() / kTrials;
    }
    const auto worst = [](const Eigen::Matrix3d& m) {
      return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()[2]);
    };
    EXPECT_NEAR(predicted->relative_sigma_start / (worst(at_start) / depth_start), 1.0, 0.1) << e;
    EXPECT_NEAR(predicted->relative_sigma_end / (worst(at_end) / depth_end), 1.0, 0.1) << e;
  }
}

TEST(Uncertainty, OfALineInThePlaneOfItsCamerasIsHugeUntilAPlaneHoldsIt) {
  const TestHouse house = MakeTestFacade({});
  const std::vector<LineSupport> supports = SupportsOfEdge(house, 0);
  const AnchoredLine line = LineOfEdge(house.edges[0]);
  const auto free = UncertaintyOfFit(supports, {}, 0.5, line, -0.5, 0.5);
  ASSERT_TRUE(free.has_value());
  EXPECT_GT(free->RelativeSigma(), 1.0);
  LinePrior prior;
  prior.direction = line.direction;
  prior.direction_weight = 500.0;
  // A direction alone leaves the depth free.
  EXPECT_GT(UncertaintyOfFit(supports, prior, 0.5, line, -0.5, 0.5)->RelativeSigma(), 1.0);
  prior.plane = Eigen::Vector4d(0, 0, 1, 0);
  prior.plane_weight = 0.5;
  prior.t_start = -0.5;
  prior.t_end = 0.5;
  EXPECT_LT(UncertaintyOfFit(supports, prior, 0.5, line, -0.5, 0.5)->RelativeSigma(), 2e-3);
  EXPECT_FALSE(UncertaintyOfFit({}, prior, 0.5, line, -0.5, 0.5).has_value());
}

TEST(ExtentOfLine, DropsOutliersOnlyWhereThereAreEnough) {
  const TestHouse house = MakeTestHouse({});
  const AnchoredLine line = LineOfEdge(house.edges[0]);
  std::vector<LineSupport> all = SupportsOfEdge(house, 0);
  const double half = 0.48 * 4.0;
  const auto near_truth = [&](std::span<const LineSupport> supports) {
    const auto extent = ExtentOfLine(supports, line);
    return extent && std::abs(extent->first + half) < 1e-6 &&
           std::abs(extent->second - half) < 1e-6;
  };
  ASSERT_EQ(all.size(), 8u);
  for (size_t n = 1; n <= 8; ++n) EXPECT_TRUE(near_truth(std::span(all).first(n))) << n;
  // Segments that run on over the end of the edge.
  const auto lengthen = [](LineSupport* s) { s->end += 0.4 * (s->end - s->start); };
  lengthen(&all[0]);
  EXPECT_TRUE(near_truth(std::span(all).first(4)));
  EXPECT_FALSE(near_truth(std::span(all).first(3)));
  lengthen(&all[1]);
  EXPECT_TRUE(near_truth(std::span(all).first(6)));
  EXPECT_FALSE(near_truth(std::span(all).first(5)));
}

TEST(ExtentOfLine, PiecesOfOneImageAreOne) {
  const TestHouse house = MakeTestHouse({});
  const AnchoredLine line = LineOfEdge(house.edges[0]);
  std::vector<LineSupport> pieces;
  for (const LineSupport& s : SupportsOfEdge(house, 0)) {
    pieces.push_back(s);
    pieces.back().end = s.start + 0.4 * (s.end - s.start);
    pieces.push_back(s);
    pieces.back().start = s.start + 0.6 * (s.end - s.start);
  }
  const auto extent = ExtentOfLine(pieces, line);
  ASSERT_TRUE(extent.has_value());
  EXPECT_NEAR(extent->second - extent->first, 0.96 * 4.0, 1e-6);
  EXPECT_FALSE(ExtentOfLine({}, line).has_value());
}

}  // namespace
}  // namespace holba
