// SPDX-License-Identifier: BSD-3-Clause
// Fits: minimal samples, more than that, noise, lines, and samples that determine nothing.
#include "holba/group/fit.h"

#include <cmath>
#include <numbers>

#include "holba/group/group_testing.h"

namespace holba {
namespace {

template <typename G>
double RootMeanSquare(const typename G::Params& g, const std::vector<Eigen::Vector3d>& points) {
  double sum = 0.0;
  for (const Eigen::Vector3d& X : points) sum += (X - *G::ProjectPoint(g.data(), X)).squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}

template <typename G>
class MinimalFit : public ::testing::Test {};
TYPED_TEST_SUITE(MinimalFit, TestedPointGroups);

TYPED_TEST(MinimalFit, PassesThroughAMinimalSample) {
  using G = TypeParam;
  Random random(21);
  const auto g = G::Examples()[1];
  int num_exact = 0;
  for (int i = 0; i < 50; ++i) {
    const auto points = SurfacePoints<G>(g, G::kMinPoints, &random);
    const auto fit = G::FitMinimal(points, {});
    num_exact += fit && RootMeanSquare<G>(*fit, points) < 1e-6 * Extent(points);
  }
  // Search by local minimisation misses some of the samples that are nearly degenerate.
  EXPECT_GE(num_exact, 45);
}

TYPED_TEST(MinimalFit, OfNoisyPointsIsAtLeastAsNearToThemAsTheTruth) {
  using G = TypeParam;
  Random random(22);
  for (const int example : {0, 1}) {
    const auto g = G::Examples()[example];
    auto points = SurfacePoints<G>(g, 400, &random);
    const double sigma = 1e-3 * Extent(points);
    for (Eigen::Vector3d& X : points) {
      X += Eigen::Vector3d(random.Normal(sigma), random.Normal(sigma), random.Normal(sigma));
    }
    const auto fit = G::FitMinimal(points, {});
    ASSERT_TRUE(fit.has_value());
    // Sphere: the algebraic error is minimised, not the distance.
    EXPECT_LE(RootMeanSquare<G>(*fit, points), 1.003 * RootMeanSquare<G>(g, points));
    // 400 points average the noise down.
    EXPECT_LT(RootMeanSquare<G>(*fit, SurfacePoints<G>(g, 400, &random)), 0.5 * sigma);
  }
}

TEST(VanishingPointFit, IsTheDominantDirection) {
  Random random(1);
  const Eigen::Vector3d v = Eigen::Vector3d(1, -2, 0.5).normalized();
  std::vector<PlueckerLine> lines;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d d = (i % 3 ? 1.0 : -1.0) * v + 0.01 * RandomVector(&random);
    lines.push_back(PlueckerLine::FromPointDirection(10.0 * RandomVector(&random), d));
  }
  const auto fit = VanishingPoint::FitMinimal({}, lines);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT(fit->cross(v).norm(), 1.5e-3);
  EXPECT_NEAR(fit->norm(), 1.0, 1e-15);
  const auto one = VanishingPoint::FitMinimal({}, std::span(lines).first(1));
  ASSERT_TRUE(one.has_value());
  EXPECT_THAT(*one, EigenNear(lines[0].direction, 1e-15));
  const std::vector<PlueckerLine> crossed{PlueckerLine::FromPointDirection({0, 0, 0}, {1, 0, 0}),
                                          PlueckerLine::FromPointDirection({0, 0, 1}, {0, 1, 0})};
  EXPECT_FALSE(VanishingPoint::FitMinimal({}, crossed).has_value());
}

void ExpectSamePlane(const std::optional<Plane::Params>& actual, const Plane::Params& expected,
                     double tolerance) {
  ASSERT_TRUE(actual.has_value());
  const double sign = actual->head<3>().dot(expected.head<3>()) < 0 ? -1.0 : 1.0;
  EXPECT_THAT(Plane::Params(sign * *actual), EigenNear(expected, tolerance));
}

TEST(PlaneFit, TakesPointsAndLinesInAnyMixThatSpansAPlane) {
  Random random(2);
  for (const int example : {1, 2}) {
    const Plane::Params g = Plane::Examples()[example];
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(g.head<3>());
    const auto point = [&]() -> Eigen::Vector3d {
      return -g[3] * g.head<3>() +
             basis * Eigen::Vector2d(random.Uniform(-3, 3), random.Uniform(-3, 3));
    };
    for (int i = 0; i < 50; ++i) {
      const std::vector<Eigen::Vector3d> points{point(), point(), point(), point()};
      const PlueckerLine a = PlueckerLine::FromPoints(point(), point());
      const PlueckerLine b = PlueckerLine::FromPoints(point(), point());
      const PlueckerLine parallel = PlueckerLine::FromPointDirection(point(), -a.direction);
      const std::vector<PlueckerLine> crossing{a, b}, parallels{a, parallel}, all{a, b, parallel};
      ExpectSamePlane(Plane::FitMinimal(points, {}), g, 1e-8);
      ExpectSamePlane(Plane::FitMinimal(std::span(points).first(3), {}), g, 1e-8);
      ExpectSamePlane(Plane::FitMinimal({}, crossing), g, 1e-8);
      ExpectSamePlane(Plane::FitMinimal({}, parallels), g, 1e-8);
      ExpectSamePlane(Plane::FitMinimal({}, all), g, 1e-8);
      ExpectSamePlane(Plane::FitMinimal(std::span(points).first(1), std::span(crossing).first(1)),
                      g, 1e-7);
      ExpectSamePlane(Plane::FitMinimal(points, all), g, 1e-8);
    }
  }
}

TEST(PlaneFit, OfLinesThroughTheOriginIsTheirPlane) {
  const std::vector<PlueckerLine> lines{PlueckerLine::FromPointDirection({0, 0, 0}, {1, 0, 0}),
                                        PlueckerLine::FromPointDirection({0, 0, 0}, {1, 1, 0})};
  ExpectSamePlane(Plane::FitMinimal({}, lines), Plane::Params(0, 0, 1, 0), 1e-12);
}

TEST(PlaneFit, IsEmptyForOneLineAndForPointsOfOneLine) {
  const PlueckerLine line = PlueckerLine::FromPointDirection({1, 2, 3}, {1, -1, 2});
  EXPECT_FALSE(Plane::FitMinimal({}, std::vector<PlueckerLine>{line}).has_value());
  EXPECT_FALSE(Plane::FitMinimal({}, std::vector<PlueckerLine>{line, line}).has_value());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 3; ++i) points.push_back(line.Foot() + 1.5 * i * line.direction);
  EXPECT_FALSE(Plane::FitMinimal(points, {}).has_value());
  EXPECT_FALSE(Plane::FitMinimal(points, std::vector<PlueckerLine>{line}).has_value());
}

TEST(SphereFit, IsEmptyForPointsOfAPlaneAndExactForFourPoints) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 8; ++i) points.push_back({std::cos(i), std::sin(i), 2.0});
  EXPECT_FALSE(Sphere::FitMinimal(points, {}).has_value());
  const std::vector<Eigen::Vector3d> four{{3, 0, 1}, {-1, 0, 1}, {1, 2, 1}, {1, 0, 3}};
  const auto fit = Sphere::FitMinimal(four, {});
  ASSERT_TRUE(fit.has_value());
  EXPECT_THAT(*fit, EigenNear(Sphere::Params(1, 0, 1, std::log(2.0)), 1e-14));
}

// Shape parameters themselves, from patches that cover part of the surface.
TEST(CylinderFit, RecoversAxisAndRadiusFromAThirdOfTheSide) {
  Random random(4);
  for (int trial = 0; trial < 30; ++trial) {
    const Eigen::Quaterniond q = RandomRotation(&random);
    const Eigen::Vector3d p = 50.0 * RandomVector(&random);
    const double radius = std::exp(random.Uniform(-2, 2)), length = std::exp(random.Uniform(-1, 2));
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 30; ++i) {
      const double angle = random.Uniform(0, 2.1);
      points.push_back(q * Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle),
                                           random.Uniform(0, length)) +
                       p);
    }
    const auto fit = Cylinder::FitMinimal(points, {});
    ASSERT_TRUE(fit.has_value());
    const Eigen::Vector3d axis = q * Eigen::Vector3d::UnitZ();
    EXPECT_LT(fit->head<3>().cross(axis).norm(), 1e-6) << trial;
    EXPECT_NEAR(std::exp((*fit)[6]), radius, 1e-6 * radius) << trial;
    EXPECT_LT(PlueckerLine::FromPointDirection(p, axis).Distance(fit->segment<3>(3)),
              1e-6 * radius);
  }
}

TEST(ConeFit, RecoversApexAxisAndAngleFromAThirdOfTheSide) {
  Random random(5);
  for (int trial = 0; trial < 30; ++trial) {
    const Eigen::Quaterniond q = RandomRotation(&random);
    const Eigen::Vector3d apex = 50.0 * RandomVector(&random);
    const double alpha = random.Uniform(0.15, 1.3);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 40; ++i) {
      const double angle = random.Uniform(0, 2.1), s = random.Uniform(0.5, 2);
      points.push_back(
          q * (s * Eigen::Vector3d(std::sin(alpha) * std::cos(angle),
                                   std::sin(alpha) * std::sin(angle), std::cos(alpha))) +
          apex);
    }
    const auto fit = Cone::FitMinimal(points, {});
    ASSERT_TRUE(fit.has_value());
    EXPECT_THAT(Eigen::Vector3d(fit->head<3>()), EigenNear(apex, 1e-6)) << trial;
    EXPECT_THAT(Eigen::Vector3d(fit->segment<3>(3)),
                EigenNear(Eigen::Vector3d(q * Eigen::Vector3d::UnitZ()), 1e-6));
    EXPECT_NEAR(std::exp((*fit)[6]), alpha, 1e-6) << trial;
  }
}

TEST(EllipsoidFit, RecoversCentreAndSemiAxes) {
  Random random(6);
  for (const int example : {0, 1, 2}) {
    const auto g = Ellipsoid::Examples()[example];
    for (const size_t num : {9, 12, 200}) {
      const auto fit = Ellipsoid::FitMinimal(SurfacePoints<Ellipsoid>(g, num, &random), {});
      ASSERT_TRUE(fit.has_value()) << example << " " << num;
      Eigen::Vector3d axes = fit->tail<3>(), expected = g.tail<3>();
      std::sort(axes.begin(), axes.end());
      std::sort(expected.begin(), expected.end());
      EXPECT_THAT(axes, EigenNear(expected, 1e-5));
      EXPECT_LT((fit->segment<3>(4) - g.segment<3>(4)).norm(), 1e-5 * std::exp(expected[2]));
    }
  }
}

// Sizes and centre of a box, whatever the order of its faces.
struct BoxShape {
  Eigen::Vector3d centre, sizes;
};
BoxShape ShapeOf(const Cuboid::Params& g) {
  BoxShape shape{Cuboid::Centre(g.data()), {}};
  for (int axis = 0; axis < 3; ++axis) shape.sizes[axis] = -g[4 + 2 * axis] - g[5 + 2 * axis];
  std::sort(shape.sizes.begin(), shape.sizes.end());
  return shape;
}
void ExpectSameBox(const std::optional<Cuboid::Params>& actual, const Cuboid::Params& expected,
                   double tolerance) {
  ASSERT_TRUE(actual.has_value());
  EXPECT_THAT(ShapeOf(*actual).centre, EigenNear(ShapeOf(expected).centre, tolerance));
  EXPECT_THAT(ShapeOf(*actual).sizes, EigenNear(ShapeOf(expected).sizes, tolerance));
}

// Of the cuboid with half sizes h along the columns of R.
Cuboid::Params MakeBox(const Eigen::Quaterniond& q, const Eigen::Vector3d& centre,
                       const Eigen::Vector3d& h) {
  Cuboid::Params g;
  const Eigen::Vector3d local = q.conjugate() * centre;
  g << q.coeffs(), -local.x() - h.x(), local.x() - h.x(), -local.y() - h.y(), local.y() - h.y(),
      -local.z() - h.z(), local.z() - h.z();
  return g;
}

TEST(CuboidFit, RecoversTheBoxOfPointsOnAllFaces) {
  Random random(7);
  for (const int num_per_face : {4, 6, 40}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::Vector3d h(random.Uniform(0.5, 2), random.Uniform(0.5, 2),
                              random.Uniform(0.5, 2));
      const Eigen::Quaterniond q = RandomRotation(&random);
      const Eigen::Vector3d centre = 20.0 * RandomVector(&random);
      std::vector<Eigen::Vector3d> points;
      for (int i = 0; i < 6 * num_per_face; ++i) {
        Eigen::Vector3d u = RandomVector(&random);
        u[i % 3] = i % 2 ? 1.0 : -1.0;
        points.push_back(centre + q * h.cwiseProduct(u));
      }
      SCOPED_TRACE(trial);
      ExpectSameBox(Cuboid::FitMinimal(points, {}), MakeBox(q, centre, h), 1e-7);
    }
  }
}

TEST(CuboidFit, RecoversTheThreeVisibleFacesAndEndsTheOthersWhereThePointsEnd) {
  Random random(8);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d h(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2));
    const Eigen::Quaterniond q = RandomRotation(&random);
    const Eigen::Vector3d centre = 20.0 * RandomVector(&random);
    const auto g = MakeBox(q, centre, h);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 60; ++i) {
      Eigen::Vector3d u = RandomVector(&random);
      u[i % 3] = 1.0;
      points.push_back(centre + q * h.cwiseProduct(u));
    }
    // So that the points end where the hidden faces are.
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d u(0.3, 0.2, 0.1);
      u[axis] = -1.0;
      u[(axis + 1) % 3] = 1.0;
      points.push_back(centre + q * h.cwiseProduct(u));
    }
    ExpectSameBox(Cuboid::FitMinimal(points, {}), g, 1e-6);
  }
}

TEST(CuboidFit, RecoversTheBoxOfItsTwelveEdgesAndOfPointsWithLines) {
  Random random(9);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d h(random.Uniform(0.5, 2), random.Uniform(0.5, 2), random.Uniform(0.5, 2));
    const Eigen::Quaterniond q = RandomRotation(&random);
    const Eigen::Vector3d centre = 20.0 * RandomVector(&random);
    const auto g = MakeBox(q, centre, h);
    std::vector<PlueckerLine> edges;
    for (int axis = 0; axis < 3; ++axis) {
      for (int corner = 0; corner < 4; ++corner) {
        Eigen::Vector3d u = Eigen::Vector3d::Zero();
        u[(axis + 1) % 3] = corner & 1 ? 1.0 : -1.0;
        u[(axis + 2) % 3] = corner & 2 ? 1.0 : -1.0;
        edges.push_back(PlueckerLine::FromPointDirection(
            centre + q * h.cwiseProduct(u), q * Eigen::Vector3d(Eigen::Vector3d::Unit(axis))));
      }
    }
    ExpectSameBox(Cuboid::FitMinimal({}, edges), g, 1e-7);
    // Points of all faces with lines across one face.
    const auto points = SurfacePoints<Cuboid>(g, 30, &random);
    std::vector<PlueckerLine> across;
    for (int i = 0; i < 4; ++i) {
      Eigen::Vector3d u = 0.5 * RandomVector(&random), v = 0.5 * RandomVector(&random);
      u.x() = v.x() = 1.0;
      across.push_back(
          PlueckerLine::FromPoints(centre + q * h.cwiseProduct(u), centre + q * h.cwiseProduct(v)));
    }
    ExpectSameBox(Cuboid::FitMinimal(points, across), g, 1e-6);
  }
}

TEST(FitQuadric, IsEmptyForPointsOfAPlane) {
  Random random(10);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 30; ++i) {
    const double x = random.Uniform(-1, 1), y = random.Uniform(-1, 1);
    points.push_back({x, y, 0.3 * x - 0.2 * y + 0.1});
  }
  EXPECT_FALSE(FitQuadric(points).has_value());
  EXPECT_FALSE(Ellipsoid::FitMinimal(points, {}).has_value());
}

TEST(NormalizePoints, CentresAndScalesToUnitSize) {
  Random random(11);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 50; ++i) {
    points.push_back(Eigen::Vector3d(1e5, -2e5, 3) + 0.01 * RandomVector(&random));
  }
  const auto normalized = NormalizePoints(points);
  ASSERT_TRUE(normalized.has_value());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0.0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d& x = normalized->points[i];
    sum += x;
    squares += x.squaredNorm();
    EXPECT_THAT(Eigen::Vector3d(normalized->original_from_normalized * x),
                EigenNear(points[i], 1e-10));
  }
  EXPECT_LT(sum.norm(), 1e-6);
  EXPECT_NEAR(squares, 50.0, 1e-9);
  EXPECT_FALSE(NormalizePoints({}).has_value());
}

}  // namespace
}  // namespace holba
