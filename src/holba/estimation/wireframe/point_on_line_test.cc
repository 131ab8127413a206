// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/point_on_line.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

#include "holba/base/random.h"
#include "holba/estimation/points/wireframe_testing.h"

namespace holba {
namespace {

// The place of a line at x = 0.3 from segments with noise, across the line, by least squares in
// which the two coordinates of two points of the line are free.
PlueckerLine FitLine(const Reconstruction& model, const ViewMap& views,
                     const PlueckerLine& start) {
  // Points of the line at x = -1 and x = 1; their y and z.
  const auto at = [&](double x) {
    const Eigen::Vector3d foot = start.Foot();
    return Eigen::Vector3d(foot + start.direction * (x - foot.x()) / start.direction.x());
  };
  Eigen::Vector4d p;
  p << at(-1.0).tail<2>(), at(1.0).tail<2>();
  const auto line = [](const Eigen::Vector4d& q) {
    return PlueckerLine::FromPoints({-1.0, q[0], q[1]}, {1.0, q[2], q[3]});
  };
  const auto residuals = [&](const Eigen::Vector4d& q) {
    Eigen::VectorXd r(2 * views.size());
    for (size_t i = 0; i < views.size(); ++i) {
      const Eigen::Vector3d l = *views[i].Project(line(q));
      const LineSegment2d& s = model.images.begin()[i].second.lines2D[0].segment;
      r[2 * i] = l.dot(s.start.homogeneous());
      r[2 * i + 1] = l.dot(s.end.homogeneous());
    }
    return r;
  };
  for (int iteration = 0; iteration < 6; ++iteration) {
    const Eigen::VectorXd r = residuals(p);
    Eigen::MatrixXd J(r.size(), 4);
    for (int k = 0; k < 4; ++k) {
      J.col(k) = (residuals(p + 1e-6 * Eigen::Vector4d::Unit(k)) -
                  residuals(p - 1e-6 * Eigen::Vector4d::Unit(k))) /
                 2e-6;
    }
    p -= (J.transpose() * J).ldlt().solve(J.transpose() * r);
  }
  return line(p);
}

TEST(PointOnLine, RefusesOneTruePairInAHundred) {
  // A point and a line through it, both estimated from noisy observations: without a bound in
  // pixels the test is one of 99 %.
  constexpr double kSigmaPx = 0.4;
  constexpr int kRuns = 1500;
  Random random(17);
  const Eigen::Vector3d X(0.3, 0.2, 0.1), along(1.0, 0.3, -0.4);
  PointOnLineOptions options{
      .max_gap_gsd = 0.0, .max_uncertain_gap_gsd = 1e9, .sigma_px = kSigmaPx};
  const Reconstruction exact = [&] {
    Reconstruction model = ArcOfCameras(5);
    AddLineWithSegments(X - 1.2 * along, X + 0.5 * along, 0.0, 0.0, &model);
    return model;
  }();
  int num_refused = 0;
  for (int run = 0; run < kRuns; ++run) {
    Reconstruction model = exact;
    const ViewMap views(model);
    std::vector<PointView> seen;
    for (size_t i = 0; i < views.size(); ++i) {
      LineSegment2d& s = model.images.begin()[i].second.lines2D[0].segment;
      for (Eigen::Vector2d* x : {&s.start, &s.end}) {
        x->x() += random.Normal(kSigmaPx);
        x->y() += random.Normal(kSigmaPx);
      }
      const double dx = random.Normal(kSigmaPx), dy = random.Normal(kSigmaPx);
      seen.push_back({&views[i], *views[i].Project(X) + Eigen::Vector2d(dx, dy)});
    }
    const auto point = RefinePoint(seen, X);
    ASSERT_TRUE(point.has_value());
    Line3D& line = model.lines3D.at(1);
    line.line = FitLine(model, views, line.line);
    num_refused += TestPointOnLine(model, views, options, *point, PointCovariance(seen, *point),
                                   PixelsPerLength(seen, *point), line) == PointOnLine::kApart;
  }
  // 15 expected, standard deviation 3.9.
  EXPECT_GE(num_refused, 4);
  EXPECT_LE(num_refused, 30);
}

TEST(PointOnLine, IsNearWithinTheBoundInPixelsAndApartWithoutACovariance) {
  Reconstruction model = ArcOfCameras(5);
  AddLineWithSegments({-1, 0, 0}, {1, 0, 0}, 0.0, 0.0, &model);
  const ViewMap views(model);
  const Line3D& line = model.lines3D.at(1);
  // 100 pixels for a unit of length.
  const auto test = [&](double distance, const std::optional<Eigen::Matrix3d>& covariance) {
    return TestPointOnLine(model, views, {}, {0.2, 0.0, distance}, covariance, 100.0, line);
  };
  const Eigen::Matrix3d wide = Eigen::Matrix3d::Identity();
  EXPECT_EQ(test(0.019, std::nullopt), PointOnLine::kNear);
  EXPECT_EQ(test(0.021, std::nullopt), PointOnLine::kApart);
  EXPECT_EQ(test(0.021, wide), PointOnLine::kAllowed);
  EXPECT_EQ(test(0.099, wide), PointOnLine::kAllowed);
  EXPECT_EQ(test(0.101, wide), PointOnLine::kApart);
}

}  // namespace
}  // namespace holba
