// SPDX-License-Identifier: BSD-3-Clause
// Each surface against its own equation, written from the plain parameters of its file and
// independent of the projection: on the surface, nearest, undefined where it must be; lines on
// planes and cuboids; meshes.
#include <cmath>
#include <numbers>

#include "holba/geometry/angle.h"
#include "holba/group/group_testing.h"

namespace holba {
namespace {

template <typename G>
std::vector<double> Plain(const typename G::Params& g) {
  std::vector<double> plain(G::kNumFileParams);
  G::ToFile(g.data(), plain.data());
  return plain;
}
Eigen::Vector3d At(const std::vector<double>& p, int i) { return {p[i], p[i + 1], p[i + 2]}; }
Eigen::Matrix3d RotationOf(const std::vector<double>& p) {
  return Eigen::Quaterniond(p[0], p[1], p[2], p[3]).toRotationMatrix();
}

// Distance of X to the surface (ellipsoid: along the ray from the centre; cuboid: to the nearest
// face plane).
double Distance(const Plane&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  return At(p, 0).dot(X) + p[3];
}
double Distance(const Sphere&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  return (X - At(p, 0)).norm() - p[3];
}
double Distance(const Cylinder&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  return (X.cross(At(p, 0)) - At(p, 3)).norm() - p[6];
}
double Distance(const Cone&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  const Eigen::Vector3d u = X - At(p, 0);
  const double angle = std::atan2(u.cross(At(p, 3)).norm(), u.dot(At(p, 3))) - p[6];
  return angle > std::numbers::pi / 2 ? u.norm() : u.norm() * std::sin(angle);
}
double Distance(const Ellipsoid&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  const Eigen::Vector3d local = RotationOf(p).transpose() * (X - At(p, 4));
  return local.norm() * (1.0 - 1.0 / local.cwiseQuotient(At(p, 7)).norm());
}
double Distance(const Cuboid&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  double least = 1e300;
  for (int face = 0; face < 6; ++face) {
    const Eigen::Vector3d n = (face % 2 ? -1.0 : 1.0) * RotationOf(p).col(face / 2);
    least = std::min(least, std::abs(n.dot(X) + p[4 + face]));
  }
  return least;
}
double Distance(const Torus&, const std::vector<double>& p, const Eigen::Vector3d& X) {
  const Eigen::Vector3d u = X - At(p, 0);
  const double h = u.dot(At(p, 3));
  return std::hypot(u.cross(At(p, 3)).norm() - p[6], h) - p[7];
}

template <typename G>
class Surface : public ::testing::Test {
 protected:
  Random random_{5};
};
using Surfaces = ::testing::Types<Plane, Sphere, Cylinder, Cone, Ellipsoid, Cuboid, Torus>;
TYPED_TEST_SUITE(Surface, Surfaces);

TYPED_TEST(Surface, HoldsTheProjectedPointAtTheDistanceOfItsEquation) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    const std::vector<double> plain = Plain<G>(g);
    const double size = Eigen::Map<const Eigen::VectorXd>(plain.data(), plain.size()).norm();
    for (const Eigen::Vector3d& X : PointsAround<G>(g, 100, &this->random_)) {
      const Eigen::Vector3d projected = *G::ProjectPoint(g.data(), X);
      const double rounding = 1e-13 * (X.norm() + size);
      EXPECT_NEAR(Distance(G(), plain, projected), 0.0, rounding);
      EXPECT_NEAR((X - projected).norm(), std::abs(Distance(G(), plain, X)), rounding);
    }
  }
}

template <typename G>
class NearestSurface : public Surface<G> {};
using NearestSurfaces = ::testing::Types<Plane, Sphere, Cylinder, Cone, Torus, BezierCurve>;
TYPED_TEST_SUITE(NearestSurface, NearestSurfaces);

TYPED_TEST(NearestSurface, HasNoPointNearerThanTheProjection) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    const auto samples = SurfacePoints<G>(g, 300, &this->random_);
    for (const Eigen::Vector3d& X : PointsAround<G>(g, 100, &this->random_)) {
      const Eigen::Vector3d projected = *G::ProjectPoint(g.data(), X);
      const double distance = (X - projected).norm();
      const double rounding = 1e-13 * (X.norm() + g.cwiseAbs().maxCoeff());
      for (const Eigen::Vector3d& Y : samples) EXPECT_LE(distance, (X - Y).norm() + rounding);
      // Near the foot as well.
      for (int i = 0; i < 20; ++i) {
        const auto Y = G::ProjectPoint(
            g.data(), Eigen::Vector3d(projected + 0.1 * distance * RandomVector(&this->random_)));
        if (Y) {
          EXPECT_LE(distance, (X - *Y).norm() + rounding);
        }
      }
    }
  }
}

TEST(SphereProjection, IsUndefinedAtTheCentreOnly) {
  for (const auto& g : Sphere::Examples()) {
    RowMajor<3, 3> by_point;
    RowMajor<3, 4> by_group;
    const Eigen::Vector3d centre = g.head<3>();
    EXPECT_FALSE(Sphere::ProjectPoint(g.data(), centre));
    EXPECT_FALSE(
        Sphere::ProjectPointWithJacobian(g.data(), centre, by_point.data(), by_group.data()));
    const Eigen::Vector3d near = centre + 1e-3 * std::exp(g[3]) * Eigen::Vector3d::UnitX();
    EXPECT_TRUE(Sphere::ProjectPoint(g.data(), near));
  }
}

TEST(EllipsoidProjection, IsUndefinedAtTheCentreOnly) {
  for (const auto& g : Ellipsoid::Examples()) {
    RowMajor<3, 3> by_point;
    RowMajor<3, 10> by_group;
    const Eigen::Vector3d centre = g.segment<3>(4);
    EXPECT_FALSE(Ellipsoid::ProjectPoint(g.data(), centre));
    EXPECT_FALSE(
        Ellipsoid::ProjectPointWithJacobian(g.data(), centre, by_point.data(), by_group.data()));
    const Eigen::Vector3d near = centre + 1e-3 * std::exp(g[7]) * Eigen::Vector3d::UnitX();
    EXPECT_TRUE(Ellipsoid::ProjectPoint(g.data(), near));
  }
}

TEST(CylinderProjection, IsUndefinedOnTheAxisOnly) {
  RowMajor<3, 3> by_point;
  RowMajor<3, 7> by_group;
  Cylinder::Params g;
  g << 0, 0, 1, 1, 2, 3, std::log(0.5);
  for (const double z : {-4.0, 3.0, 1e3}) {
    const Eigen::Vector3d X(1, 2, z);
    EXPECT_FALSE(Cylinder::ProjectPoint(g.data(), X));
    EXPECT_FALSE(Cylinder::ProjectPointWithJacobian(g.data(), X, by_point.data(), by_group.data()));
    EXPECT_THAT(*Cylinder::ProjectPoint(g.data(), Eigen::Vector3d(1 + 1e-6, 2, z)),
                EigenNear(Eigen::Vector3d(1.5, 2, z), 1e-12));
  }
}

TEST(ConeProjection, IsTheApexWhereTheFootLiesBehindItAndUndefinedOnTheAxisInside) {
  Cone::Params g;
  const double alpha = 0.5;
  g << 1, 2, 3, 0, 0, 1, std::log(alpha);
  const Eigen::Vector3d apex(1, 2, 3);
  RowMajor<3, 3> by_point;
  RowMajor<3, 7> by_group, apex_by_group = RowMajor<3, 7>::Zero();
  apex_by_group.leftCols<3>().setIdentity();
  // On the axis and beside it behind the apex; h cos + r sin < 0 although the axial height is
  // positive: no.
  for (const Eigen::Vector3d& u :
       {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.3, 0.1, -1), Eigen::Vector3d(0, 0, 0)}) {
    EXPECT_EQ(*Cone::ProjectPoint(g.data(), Eigen::Vector3d(apex + u)), apex);
    EXPECT_EQ(*Cone::ProjectPointWithJacobian(g.data(), apex + u, by_point.data(), by_group.data()),
              apex);
    EXPECT_EQ(by_point, Eigen::Matrix3d::Zero());
    EXPECT_EQ(by_group, apex_by_group);
  }
  // Below the apex but with its foot on the nappe: s = -.2 cos(.5) + .5 sin(.5) > 0 decides, not
  // the height.
  const double s = -0.2 * std::cos(alpha) + 0.5 * std::sin(alpha);
  ASSERT_GT(s, 0.0);
  EXPECT_THAT(
      *Cone::ProjectPoint(g.data(), Eigen::Vector3d(apex + Eigen::Vector3d(0.5, 0, -0.2))),
      EigenNear(Eigen::Vector3d(apex + s * Eigen::Vector3d(std::sin(alpha), 0, std::cos(alpha))),
                1e-14));
  const Eigen::Vector3d inside = apex + Eigen::Vector3d(0, 0, 2);
  EXPECT_FALSE(Cone::ProjectPoint(g.data(), inside));
  EXPECT_FALSE(Cone::ProjectPointWithJacobian(g.data(), inside, by_point.data(), by_group.data()));
}

template <typename G>
PlueckerLine Projected(const typename G::Params& g, const PlueckerLine& line) {
  const auto result = *G::ProjectLine(g.data(), line.direction, line.moment);
  return {result.first, result.second};
}

TEST(PlaneLine, IsTheLineThroughTheProjectionsOfAnyTwoOfItsPoints) {
  Random random(9);
  for (const auto& g : Plane::Examples()) {
    for (const PlueckerLine& line : LinesAround<Plane>(g, 100, &random)) {
      const PlueckerLine projected = Projected<Plane>(g, line);
      const Eigen::Vector3d near = *Plane::ProjectPoint(g.data(), Eigen::Vector3d(0, 0, 0));
      for (int i = 0; i < 5; ++i) {
        const Eigen::Vector3d X = line.ClosestPoint(near) + random.Uniform(-5, 5) * line.direction;
        const Eigen::Vector3d on_plane = *Plane::ProjectPoint(g.data(), X);
        EXPECT_LT(projected.Distance(on_plane), 1e-12 * (1.0 + line.moment.norm() + X.norm()));
      }
      EXPECT_GT(projected.direction.dot(line.direction), 0.0);
      EXPECT_NEAR(projected.direction.dot(g.head<3>()), 0.0, 1e-12);
      EXPECT_NEAR(g.head<3>().dot(projected.Foot()) + g[3], 0.0, 1e-10 * (1.0 + std::abs(g[3])));
    }
  }
}

TEST(PlaneLine, HasNoProjectionWithinADegreeOfTheNormal) {
  const Plane::Params g(0, 0, 1, -2);
  RowMajor<6, 6> by_line;
  RowMajor<6, 4> by_group;
  const auto at_angle = [](double angle_deg) {
    const double angle = DegToRad(angle_deg);
    return PlueckerLine::FromPointDirection({1, 2, 3}, {std::sin(angle), 0, std::cos(angle)});
  };
  for (const double angle_deg : {0.0, 0.5, 0.99, 179.5}) {
    const PlueckerLine line = at_angle(angle_deg);
    EXPECT_FALSE(Plane::ProjectLine(g.data(), line.direction, line.moment)) << angle_deg;
    EXPECT_FALSE(Plane::ProjectLineWithJacobian(g.data(), line.direction, line.moment,
                                                by_line.data(), by_group.data()));
  }
  for (const double angle_deg : {1.01, 90.0, 178.9}) {
    const PlueckerLine line = at_angle(angle_deg);
    EXPECT_TRUE(Plane::ProjectLine(g.data(), line.direction, line.moment)) << angle_deg;
    EXPECT_TRUE(Plane::ProjectLineWithJacobian(g.data(), line.direction, line.moment,
                                               by_line.data(), by_group.data()));
  }
}

TEST(CuboidLine, IsProjectedOnTheFaceNearestToItsPointNearestToTheCentre) {
  Random random(13);
  std::array<int, 6> used{};
  for (const auto& g : Cuboid::Examples()) {
    const std::vector<double> plain = Plain<Cuboid>(g);
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& corner : Cuboid::Mesh(g.data(), {}).vertices) {
      centre += corner / 8.0;
    }
    for (const PlueckerLine& line : LinesAround<Cuboid>(g, 100, &random)) {
      const Eigen::Vector3d X = line.ClosestPoint(centre);
      int nearest = -1;
      double least = 1e300;
      for (int face = 0; face < 6; ++face) {
        const Eigen::Vector3d n = (face % 2 ? -1.0 : 1.0) * RotationOf(plain).col(face / 2);
        const double distance = std::abs(n.dot(X) + plain[4 + face]);
        if (distance < least) {
          least = distance;
          nearest = face;
        }
      }
      ++used[nearest];
      const Eigen::Vector3d n = (nearest % 2 ? -1.0 : 1.0) * RotationOf(plain).col(nearest / 2);
      const Plane::Params plane(n.x(), n.y(), n.z(), plain[4 + nearest]);
      const PlueckerLine expected = Projected<Plane>(plane, line);
      const PlueckerLine actual = Projected<Cuboid>(g, line);
      EXPECT_THAT(actual.direction, EigenNear(expected.direction, 1e-12));
      EXPECT_THAT(actual.moment, EigenNear(expected.moment, 1e-11 * (1.0 + line.moment.norm())));
    }
  }
  for (const int num : used) EXPECT_GT(num, 0);
}

TEST(CuboidPoint, ChoosesTheNearestOfAllSixUnboundedFaces) {
  const double plain[] = {1, 0, 0, 0, -1, -1, -2, -2, -3, -3};  // |x| <= 1, |y| <= 2, |z| <= 3
  const Cuboid::Params g = *Cuboid::FromFile(plain);
  const auto expect = [&g](const Eigen::Vector3d& X, const Eigen::Vector3d& projected) {
    EXPECT_EQ(*Cuboid::ProjectPoint(g.data(), X), projected);
  };
  expect({0.9, 0, 0}, {1, 0, 0});
  expect({-1.2, 0, 0}, {-1, 0, 0});
  expect({0.1, 1.75, 0}, {0.1, 2, 0});
  expect({0.1, -2.25, 0}, {0.1, -2, 0});
  expect({0.1, 0.1, 3.5}, {0.1, 0.1, 3});
  expect({0.1, 0.1, -2.75}, {0.1, 0.1, -3});
  expect({9, 2.25, 0}, {9, 2, 0});  // beyond the bounded face
}

double SignedVolume(const GroupMesh& mesh, const Eigen::Vector3d& origin) {
  double volume = 0.0;
  for (const auto& [i, j, k] : mesh.triangles) {
    volume += (mesh.vertices[i] - origin)
                  .dot((mesh.vertices[j] - origin).cross(mesh.vertices[k] - origin)) /
              6.0;
  }
  return volume;
}

TEST(GroupMeshes, EncloseTheirVolumeFacingOutwards) {
  for (const auto& g : Sphere::Examples()) {
    const double volume = 4.0 / 3.0 * std::numbers::pi * std::exp(3.0 * g[3]);
    const double mesh_volume = SignedVolume(Sphere::Mesh(g.data(), {}), g.head<3>());
    EXPECT_LT(mesh_volume, volume);
    EXPECT_GT(mesh_volume, 0.98 * volume);
  }
  for (const auto& g : Ellipsoid::Examples()) {
    const double volume = 4.0 / 3.0 * std::numbers::pi * std::exp(g.tail<3>().sum());
    const double mesh_volume = SignedVolume(Ellipsoid::Mesh(g.data(), {}), g.segment<3>(4));
    EXPECT_LT(mesh_volume, volume);
    EXPECT_GT(mesh_volume, 0.98 * volume);
  }
  const double plain[] = {0.5, 0.5, -0.5, 0.5, -1, -2, -3, -4, -5, -6};
  const GroupMesh box = Cuboid::Mesh(Cuboid::FromFile(plain)->data(), {});
  EXPECT_EQ(box.vertices.size(), 8u);
  EXPECT_EQ(box.triangles.size(), 12u);
  EXPECT_NEAR(SignedVolume(box, {0, 0, 0}), 3.0 * 7.0 * 11.0, 1e-12);
}

TEST(GroupMeshes, OfUnboundedSurfacesReachAsFarAsTheMembers) {
  const Plane::Params plane(0, 0, 1, -2);
  const std::vector<Eigen::Vector3d> members{{0, 0, 2.5}, {4, 0, 2}, {4, 1, 1}, {0, 1, 2}};
  const GroupMesh rectangle = Plane::Mesh(plane.data(), members);
  ASSERT_EQ(rectangle.vertices.size(), 4u);
  ASSERT_EQ(rectangle.triangles.size(), 2u);
  double area = 0.0;
  for (const auto& [i, j, k] : rectangle.triangles) {
    const Eigen::Vector3d normal = (rectangle.vertices[j] - rectangle.vertices[i])
                                       .cross(rectangle.vertices[k] - rectangle.vertices[i]);
    EXPECT_GT(normal.z(), 0.0);
    area += 0.5 * normal.norm();
  }
  EXPECT_NEAR(area, 4.0, 1e-12);
  EXPECT_TRUE(Plane::Mesh(plane.data(), std::span(members).first(2)).triangles.empty());

  Cylinder::Params cylinder;
  cylinder << 0, 0, 1, 0, 0, 0, std::log(2.0);
  for (const Eigen::Vector3d& X : Cylinder::Mesh(cylinder.data(), members).vertices) {
    EXPECT_NEAR(X.head<2>().norm(), 2.0, 1e-12);
    EXPECT_TRUE(std::abs(X.z() - 1.0) < 1e-12 || std::abs(X.z() - 2.5) < 1e-12);
  }
  EXPECT_TRUE(Cylinder::Mesh(cylinder.data(), {}).triangles.empty());

  Cone::Params cone;
  cone << 0, 0, 0, 0, 0, 1, std::log(0.25 * std::numbers::pi);
  const std::vector<Eigen::Vector3d> on_cone{{0, 0, 0}, {3, 0, 3}};
  const GroupMesh tip = Cone::Mesh(cone.data(), on_cone);
  EXPECT_EQ(tip.vertices.size(), 1u + tip.triangles.size());
  EXPECT_THAT(tip.vertices[0], EigenNear(Eigen::Vector3d(0, 0, 0), 1e-15));
  for (size_t i = 1; i < tip.vertices.size(); ++i) EXPECT_NEAR(tip.vertices[i].z(), 3.0, 1e-12);
  EXPECT_TRUE(VanishingPoint::Mesh(VanishingPoint::Examples()[0].data(), members).vertices.empty());
}

}  // namespace
}  // namespace holba
