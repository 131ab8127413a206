// SPDX-License-Identifier: BSD-3-Clause
// The contract of a group type, held by every type of the list on its examples.
#include <algorithm>
#include <cmath>
#include <limits>

#include "holba/group/group_testing.h"

namespace holba {
namespace {

constexpr int kNumFeatures = 40;  // per example

template <typename G>
class GroupContract : public ::testing::Test {
 protected:
  Random random_{7};
};
TYPED_TEST_SUITE(GroupContract, TestedGroups);

Sim3d RandomSimilarity(Random* random) {
  Sim3d sim;
  sim.scale = std::exp(random->Uniform(-2, 2));
  sim.rotation = RandomRotation(random);
  sim.translation = 20.0 * RandomVector(random);
  return sim;
}

TYPED_TEST(GroupContract, HasAtLeastThreeExamplesThatItsFilesHold) {
  using G = TypeParam;
  EXPECT_GE(G::Examples().size(), 3u);
  for (const auto& g : G::Examples()) {
    double plain[G::kNumFileParams], again[G::kNumFileParams];
    G::ToFile(g.data(), plain);
    const auto back = G::FromFile(plain);
    ASSERT_TRUE(back.has_value());
    G::ToFile(back->data(), again);
    const double largest =
        Eigen::Map<Eigen::VectorXd>(plain, G::kNumFileParams).cwiseAbs().maxCoeff();
    for (int i = 0; i < G::kNumFileParams; ++i) {
      // Logarithms of 1e-6 to 1e5 resolve 1e-15; components of a moment have the error of the
      // largest.
      EXPECT_NEAR(again[i], plain[i], 3e-15 * std::abs(plain[i]) + 4e-16 * largest) << i;
    }
  }
}

TYPED_TEST(GroupContract, ReadingAndWritingManyTimesDoesNotDrift) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    double first[G::kNumFileParams], plain[G::kNumFileParams];
    G::ToFile(g.data(), first);
    std::copy(first, first + G::kNumFileParams, plain);
    for (int round = 0; round < 100; ++round) {
      const auto read = G::FromFile(plain);
      ASSERT_TRUE(read.has_value());
      G::ToFile(read->data(), plain);
    }
    const double largest =
        Eigen::Map<Eigen::VectorXd>(first, G::kNumFileParams).cwiseAbs().maxCoeff();
    for (int i = 0; i < G::kNumFileParams; ++i) {
      EXPECT_NEAR(plain[i], first[i], 1e-14 * std::abs(first[i]) + 1e-15 * largest) << i;
    }
  }
}

TYPED_TEST(GroupContract, ParametersThatAreNotFiniteAreRejected) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    for (int i = 0; i < G::kNumFileParams; ++i) {
      for (const double bad :
           {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
            -std::numeric_limits<double>::infinity()}) {
        double plain[G::kNumFileParams];
        G::ToFile(g.data(), plain);
        plain[i] = bad;
        EXPECT_FALSE(G::FromFile(plain).has_value()) << i << " " << bad;
      }
    }
  }
}

TYPED_TEST(GroupContract, ProjectingAPointTwiceChangesNothing) {
  using G = TypeParam;
  if constexpr (ProjectsPoints<G>) {
    for (const auto& g : G::Examples()) {
      for (const Eigen::Vector3d& X : PointsAround<G>(g, kNumFeatures, &this->random_)) {
        const auto once = G::ProjectPoint(g.data(), X);
        ASSERT_TRUE(once.has_value());
        const auto twice = G::ProjectPoint(g.data(), *once);
        ASSERT_TRUE(twice.has_value());
        EXPECT_THAT(*twice, EigenNear(*once, 1e-14 * (X.norm() + once->norm()) + 1e-20));
      }
    }
  }
}

TYPED_TEST(GroupContract, ProjectingALineTwiceChangesNothing) {
  using G = TypeParam;
  if constexpr (ProjectsLines<G>) {
    for (const auto& g : G::Examples()) {
      for (const PlueckerLine& line : LinesAround<G>(g, kNumFeatures, &this->random_)) {
        const auto once = G::ProjectLine(g.data(), line.direction, line.moment);
        ASSERT_TRUE(once.has_value());
        EXPECT_NEAR(once->first.norm(), 1.0, 1e-12);
        EXPECT_NEAR(once->first.dot(once->second), 0.0, 1e-10 * (1.0 + once->second.norm()));
        const auto twice = G::ProjectLine(g.data(), once->first, once->second);
        ASSERT_TRUE(twice.has_value());
        EXPECT_THAT(twice->first, EigenNear(once->first, 1e-12));
        EXPECT_THAT(twice->second, EigenNear(once->second, 1e-11 * (1.0 + once->second.norm())));
      }
    }
  }
}

TYPED_TEST(GroupContract, ProjectionCommutesWithSimilarities) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    for (int i = 0; i < 5; ++i) {
      const Sim3d sim = RandomSimilarity(&this->random_);
      const auto moved = G::Transform(sim, g.data());
      if constexpr (ProjectsPoints<G>) {
        for (const Eigen::Vector3d& X : PointsAround<G>(g, kNumFeatures, &this->random_)) {
          const Eigen::Vector3d new_X = sim * X;
          const auto projected = G::ProjectPoint(g.data(), X);
          const auto new_projected = G::ProjectPoint(moved.data(), new_X);
          ASSERT_TRUE(projected && new_projected);
          const double size = new_X.norm() + sim.translation.norm() + g.cwiseAbs().maxCoeff();
          EXPECT_THAT(*new_projected, EigenNear(Eigen::Vector3d(sim * *projected), 1e-12 * size));
        }
      }
      if constexpr (ProjectsLines<G>) {
        for (const PlueckerLine& line : LinesAround<G>(g, kNumFeatures, &this->random_)) {
          const PlueckerLine new_line = Transform(sim, line);
          const auto projected = G::ProjectLine(g.data(), line.direction, line.moment);
          const auto new_projected =
              G::ProjectLine(moved.data(), new_line.direction, new_line.moment);
          ASSERT_TRUE(projected && new_projected);
          const PlueckerLine expected =
              Transform(sim, PlueckerLine{projected->first, projected->second});
          const double size = 1.0 + expected.moment.norm() + std::abs(g.cwiseAbs().maxCoeff());
          EXPECT_THAT(new_projected->first, EigenNear(expected.direction, 1e-11));
          EXPECT_THAT(new_projected->second, EigenNear(expected.moment, 1e-10 * size));
        }
      }
      if constexpr (HasDirection<G>) {
        const Eigen::Vector3d expected = sim.rotation * G::Direction(g.data());
        EXPECT_THAT(G::Direction(moved.data()), EigenNear(expected, 1e-14));
      }
    }
  }
}

TYPED_TEST(GroupContract, TransformingThereAndBackIsTheIdentity) {
  using G = TypeParam;
  for (const auto& g : G::Examples()) {
    const Sim3d sim = RandomSimilarity(&this->random_);
    const auto back = G::Transform(sim.Inverse(), G::Transform(sim, g.data()).data());
    double delta[G::Manifold::kTangent];
    G::Manifold::Minus(back.data(), g.data(), delta);
    for (const double d : delta) EXPECT_NEAR(d, 0.0, 1e-11 * (20.0 + g.cwiseAbs().maxCoeff()));
  }
}

TYPED_TEST(GroupContract, FileJacobianAgreesWithCentralDifferences) {
  using G = TypeParam;
  constexpr int kTangent = G::Manifold::kTangent;
  const double step = 1e-6;
  for (const auto& g : G::Examples()) {
    const Sim3d sim = RandomSimilarity(&this->random_);
    RowMajor<G::kNumFileParams, kTangent> exact, numeric;
    FileJacobianByDuals<G>(sim, g.data(), exact.data());
    for (int c = 0; c < kTangent; ++c) {
      std::array<double, G::kNumFileParams> plain[2];
      for (int side = 0; side < 2; ++side) {
        std::array<double, kTangent> delta{};
        delta[c] = side == 0 ? -step : step;
        typename G::Params moved;
        G::Manifold::Plus(g.data(), delta.data(), moved.data());
        G::ToFile(G::Transform(sim, moved.data()).data(), plain[side].data());
      }
      for (int r = 0; r < G::kNumFileParams; ++r)
        numeric(r, c) = (plain[1][r] - plain[0][r]) / (2.0 * step);
    }
    const double size = std::max(1.0, exact.cwiseAbs().maxCoeff());
    const double rounding = 1e-9 * g.cwiseAbs().maxCoeff() * sim.scale;
    EXPECT_THAT(numeric, EigenNear(exact, 1e-8 * size + rounding));
  }
}

// |difference| / max(1, |largest expected|), by tangent directions of the group.
template <typename G, int Rows>
void ExpectSameGroupJacobian(const typename G::Params& g,
                             const RowMajor<Rows, G::Manifold::kAmbient>& actual,
                             const RowMajor<Rows, G::Manifold::kAmbient>& expected) {
  RowMajor<G::Manifold::kAmbient, G::Manifold::kTangent> plus;
  G::Manifold::PlusJacobian(g.data(), plus.data());
  const Eigen::MatrixXd want = expected * plus;
  EXPECT_THAT(Eigen::MatrixXd(actual * plus),
              EigenNear(want, 1e-9 * std::max(1e-6, want.cwiseAbs().maxCoeff())));
}

TYPED_TEST(GroupContract, HandWrittenPointJacobiansAreThoseOfDualNumbers) {
  using G = TypeParam;
  if constexpr (ProjectsPoints<G>) {
    static_assert(HasPointJacobian<G>);
    for (const auto& g : G::Examples()) {
      for (const Eigen::Vector3d& X : PointsAround<G>(g, kNumFeatures, &this->random_)) {
        RowMajor<3, 3> point, point_dual;
        RowMajor<3, G::Manifold::kAmbient> group, group_dual;
        const auto hand = G::ProjectPointWithJacobian(g.data(), X, point.data(), group.data());
        const auto dual = ProjectPointByDuals<G>(g.data(), X, point_dual.data(), group_dual.data());
        const auto plain = G::ProjectPoint(g.data(), X);
        ASSERT_TRUE(hand && dual && plain);
        EXPECT_THAT(*hand, EigenNear(*plain, 1e-14 * (X.norm() + plain->norm())));
        EXPECT_THAT(*dual, EigenNear(*plain, 1e-14 * (X.norm() + plain->norm())));
        EXPECT_THAT(point,
                    EigenNear(point_dual, 1e-9 * std::max(1e-6, point_dual.cwiseAbs().maxCoeff())));
        ExpectSameGroupJacobian<G, 3>(g, group, group_dual);
      }
    }
  }
}

TYPED_TEST(GroupContract, HandWrittenLineJacobiansAreThoseOfDualNumbers) {
  using G = TypeParam;
  if constexpr (ProjectsLines<G>) {
    static_assert(HasLineJacobian<G>);
    for (const auto& g : G::Examples()) {
      for (const PlueckerLine& line : LinesAround<G>(g, kNumFeatures, &this->random_)) {
        RowMajor<6, 6> by_line, by_line_dual;
        RowMajor<6, G::Manifold::kAmbient> group, group_dual;
        const auto hand = G::ProjectLineWithJacobian(g.data(), line.direction, line.moment,
                                                     by_line.data(), group.data());
        const auto dual = ProjectLineByDuals<G>(g.data(), line.direction, line.moment,
                                                by_line_dual.data(), group_dual.data());
        ASSERT_TRUE(hand && dual);
        EXPECT_THAT(*hand, EigenNear(*dual, 1e-11 * (1.0 + line.moment.norm())));
        EXPECT_THAT(by_line, EigenNear(by_line_dual, 1e-9 * by_line_dual.cwiseAbs().maxCoeff()));
        ExpectSameGroupJacobian<G, 6>(g, group, group_dual);
      }
    }
  }
}

// d f(g [+] delta) / d delta by central differences, Rows x kTangent.
template <typename G, int Rows, typename Function>
Eigen::MatrixXd GroupDifferences(const typename G::Params& g, const Function& f) {
  constexpr double kStep = 1e-5;
  Eigen::MatrixXd J(Rows, G::Manifold::kTangent);
  for (int i = 0; i < G::Manifold::kTangent; ++i) {
    Eigen::Matrix<double, G::Manifold::kTangent, 1> delta;
    delta.setZero();
    typename G::Params forward, backward;
    delta[i] = kStep;
    G::Manifold::Plus(g.data(), delta.data(), forward.data());
    delta[i] = -kStep;
    G::Manifold::Plus(g.data(), delta.data(), backward.data());
    J.col(i) = (f(forward) - f(backward)) / (2 * kStep);
  }
  return J;
}

TYPED_TEST(GroupContract, DualPointJacobiansAreCentralDifferences) {
  using G = TypeParam;
  if constexpr (ProjectsPoints<G>) {
    for (const auto& example : G::Examples()) {
      const typename G::Params g = AtUnitSize<G>(example, &this->random_);
      RowMajor<G::Manifold::kAmbient, G::Manifold::kTangent> plus;
      G::Manifold::PlusJacobian(g.data(), plus.data());
      int num_agreeing = 0;
      for (const Eigen::Vector3d& X : PointsAround<G>(g, kNumFeatures, &this->random_)) {
        RowMajor<3, 3> by_point;
        RowMajor<3, G::Manifold::kAmbient> by_group;
        ASSERT_TRUE(ProjectPointByDuals<G>(g.data(), X, by_point.data(), by_group.data()));
        const Eigen::MatrixXd tangent = by_group * plus;
        const Eigen::MatrixXd group_differences = GroupDifferences<G, 3>(
            g, [&](const auto& at) { return *G::ProjectPoint(at.data(), X); });
        Eigen::Matrix3d point_differences;
        for (int i = 0; i < 3; ++i) {
          const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(i);
          point_differences.col(i) = (*G::ProjectPoint(g.data(), Eigen::Vector3d(X + step)) -
                                      *G::ProjectPoint(g.data(), Eigen::Vector3d(X - step))) /
                                     2e-5;
        }
        const double error = std::max((tangent - group_differences).cwiseAbs().maxCoeff(),
                                      (by_point - point_differences).cwiseAbs().maxCoeff());
        num_agreeing += error < 1e-5 * (1.0 + tangent.cwiseAbs().maxCoeff());
      }
      // A difference may step over an edge (of a cuboid's faces) or near an axis.
      EXPECT_GE(num_agreeing, kNumFeatures - 2);
    }
  }
}

TYPED_TEST(GroupContract, DualLineJacobiansAreCentralDifferences) {
  using G = TypeParam;
  if constexpr (ProjectsLines<G>) {
    const auto project = [](const typename G::Params& g, const Vector6d& line) {
      const auto result = *G::ProjectLine(g.data(), Eigen::Vector3d(line.template head<3>()),
                                          Eigen::Vector3d(line.template tail<3>()));
      return Stacked({result.first, result.second});
    };
    for (const auto& example : G::Examples()) {
      const typename G::Params g = AtUnitSize<G>(example, &this->random_);
      RowMajor<G::Manifold::kAmbient, G::Manifold::kTangent> plus;
      G::Manifold::PlusJacobian(g.data(), plus.data());
      int num_agreeing = 0;
      for (const PlueckerLine& line : LinesAround<G>(g, kNumFeatures, &this->random_)) {
        RowMajor<6, 6> by_line;
        RowMajor<6, G::Manifold::kAmbient> by_group;
        ASSERT_TRUE(ProjectLineByDuals<G>(g.data(), line.direction, line.moment, by_line.data(),
                                          by_group.data()));
        const Eigen::MatrixXd tangent = by_group * plus;
        const Eigen::MatrixXd group_differences =
            GroupDifferences<G, 6>(g, [&](const auto& at) { return project(at, Stacked(line)); });
        Matrix6d line_differences;
        for (int i = 0; i < 6; ++i) {
          const Vector6d step = 1e-5 * Vector6d::Unit(i);
          line_differences.col(i) =
              (project(g, Stacked(line) + step) - project(g, Stacked(line) - step)) / 2e-5;
        }
        const double error = std::max((tangent - group_differences).cwiseAbs().maxCoeff(),
                                      (by_line - line_differences).cwiseAbs().maxCoeff());
        const double size = std::max(tangent.cwiseAbs().maxCoeff(), by_line.cwiseAbs().maxCoeff());
        num_agreeing += error < 1e-5 * (1.0 + size * size);
      }
      EXPECT_GE(num_agreeing, kNumFeatures - 2);
    }
  }
}

TYPED_TEST(GroupContract, DirectionIsUnitAndItsDerivativeIsTheDifference) {
  using G = TypeParam;
  if constexpr (HasDirection<G>) {
    for (const auto& g : G::Examples()) {
      EXPECT_NEAR(G::Direction(g.data()).norm(), 1.0, 1e-15);
      RowMajor<3, G::Manifold::kAmbient> by_group;
      RowMajor<G::Manifold::kAmbient, G::Manifold::kTangent> plus;
      G::Manifold::PlusJacobian(g.data(), plus.data());
      DirectionByDuals<G>(g.data(), by_group.data());
      const Eigen::MatrixXd differences =
          GroupDifferences<G, 3>(g, [](const auto& at) { return G::Direction(at.data()); });
      EXPECT_THAT(Eigen::MatrixXd(by_group * plus), EigenNear(differences, 1e-9));
    }
  }
}

TYPED_TEST(GroupContract, MeshLiesOnTheSurfaceWithValidTriangles) {
  using G = TypeParam;
  if constexpr (ProjectsPoints<G>) {
    for (const auto& g : G::Examples()) {
      const GroupMesh mesh = ExampleMesh<G>(g, &this->random_);
      ASSERT_FALSE(mesh.triangles.empty());
      const double size = Extent(mesh.vertices);
      for (const Eigen::Vector3d& X : mesh.vertices) {
        const auto projected = G::ProjectPoint(g.data(), X);
        // The tip of a cone projects to itself or, by rounding, lies on the axis.
        if (!projected) continue;
        if constexpr (IsCurve<G>) {
          EXPECT_NEAR((*projected - X).norm(), G::TubeRadius(g.data()), 1e-12 * (X.norm() + size));
        } else {
          EXPECT_THAT(*projected, EigenNear(X, 1e-12 * (X.norm() + size)));
        }
      }
      for (const auto& triangle : mesh.triangles) {
        for (const uint32_t i : triangle) ASSERT_LT(i, mesh.vertices.size());
        EXPECT_GT((mesh.vertices[triangle[1]] - mesh.vertices[triangle[0]])
                      .cross(mesh.vertices[triangle[2]] - mesh.vertices[triangle[0]])
                      .norm(),
                  0.0);
      }
    }
  }
}

TYPED_TEST(GroupContract, FitRecoversTheGroupOfNoiseFreePoints) {
  using G = TypeParam;
  if constexpr (ProjectsPoints<G>) {
    for (const auto& g : G::Examples()) {
      for (const size_t num : {40, 300}) {
        const auto points = SurfacePoints<G>(g, num, &this->random_);
        const auto fit = G::FitMinimal(points, {});
        ASSERT_TRUE(fit.has_value()) << g.transpose();
        const auto others = SurfacePoints<G>(g, 100, &this->random_);
        double centre_distance = 0.0;
        for (const Eigen::Vector3d& X : points) {
          centre_distance = std::max(centre_distance, X.norm());
        }
        // The smallest size of the group matters: points inside it tell its shape.
        for (const Eigen::Vector3d& X : others) {
          const auto projected = G::ProjectPoint(fit->data(), X);
          ASSERT_TRUE(projected.has_value());
          EXPECT_THAT(*projected, EigenNear(X, 1e-7 * Extent(points) + 1e-10 * centre_distance))
              << "example " << g.transpose() << " fit " << fit->transpose() << " num " << num;
        }
      }
    }
  }
}

TYPED_TEST(GroupContract, FitOfTooFewOrEqualFeaturesIsEmpty) {
  using G = TypeParam;
  EXPECT_FALSE(G::FitMinimal({}, {}).has_value());
  const std::vector<Eigen::Vector3d> same(20, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(G::FitMinimal(same, {}).has_value());
  if constexpr (ProjectsPoints<G>) {
    std::vector<Eigen::Vector3d> on_line;
    for (int i = 0; i < 20; ++i) on_line.push_back({1.0 * i, 2.0 * i, 5.0 - i});
    EXPECT_FALSE(G::FitMinimal(on_line, {}).has_value());
    const auto enough = SurfacePoints<G>(G::Examples()[1], G::kMinPoints, &this->random_);
    EXPECT_FALSE(G::FitMinimal(std::span(enough).first(G::kMinPoints - 1), {}).has_value());
  }
}

}  // namespace
}  // namespace holba
