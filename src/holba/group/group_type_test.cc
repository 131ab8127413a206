// SPDX-License-Identifier: BSD-3-Clause
// The tables of the group types, and what their files accept.
#include "holba/group/group_type.h"

#include <cmath>
#include <fstream>
#include <numbers>
#include <regex>
#include <set>
#include <string>

#include "holba/group/group_testing.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

// Rows of the table of types in docs/FORMAT.md.
struct FormatRow {
  std::string name, params, features;
  int code;
};
std::vector<FormatRow> FormatRows() {
  std::ifstream file(HOLBA_FORMAT_PAGE);
  EXPECT_TRUE(file) << HOLBA_FORMAT_PAGE;
  const std::regex row(R"(\| `([A-Z_]+)` \| ([0-9]+) \| `([^`]*)`.* \| ([a-z, ]+) \|)");
  std::vector<FormatRow> rows;
  std::string line;
  while (std::getline(file, line)) {
    std::smatch match;
    if (std::regex_match(line, match, row))
      rows.push_back({match[1], match[3], match[4], std::stoi(match[2])});
  }
  return rows;
}

// A type that is added has its row there; that the two agree is all that this test asks of it.
TEST(GroupType, TablesAreThoseOfTheFormatPage) {
  const std::vector<FormatRow> rows = FormatRows();
  ASSERT_EQ(AllGroupTypes().size(), rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    const GroupType& type = *AllGroupTypes()[i];
    SCOPED_TRACE(rows[i].name);
    EXPECT_EQ(type.name, rows[i].name);
    EXPECT_EQ(type.code, rows[i].code);
    EXPECT_EQ(type.file_params, rows[i].params);
    EXPECT_EQ(type.TakesPoints(), rows[i].features.find("points") != std::string::npos);
    EXPECT_EQ(type.TakesLines(), rows[i].features.find("lines") != std::string::npos);
    EXPECT_FALSE(type.requirement.empty());
    EXPECT_EQ(FindGroupType(type.code), &type);
    EXPECT_EQ(FindGroupType(type.name), &type);
  }
}

TEST(GroupType, SizesOfThePapersTypes) {
  struct Row {
    int code;
    std::string_view name, params;
    int ambient, tangent;
    bool points, lines, direction, jacobians;
    int min_points, min_lines;
  };
  const std::vector<Row> expected{
      {0, "VP", "vx vy vz", 3, 2, false, true, true, false, 0, 1},
      {1, "PLANE", "nx ny nz w", 4, 3, true, true, true, true, 3, 2},
      {2, "SPHERE", "cx cy cz r", 4, 4, true, false, false, true, 4, 0},
      {3, "CYLINDER", "dx dy dz mx my mz r", 7, 5, true, false, false, true, 5, 0},
      {4, "CONE", "ax ay az dx dy dz alpha", 7, 6, true, false, false, true, 6, 0},
      {5, "ELLIPSOID", "qw qx qy qz cx cy cz sx sy sz", 10, 9, true, false, false, true, 9, 0},
      {6, "CUBOID", "qw qx qy qz w0 w1 w2 w3 w4 w5", 10, 9, true, true, false, true, 9, 5}};
  ASSERT_GE(AllGroupTypes().size(), expected.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    const GroupType& type = *AllGroupTypes()[i];
    const Row& row = expected[i];
    SCOPED_TRACE(row.name);
    EXPECT_EQ(type.code, row.code);
    EXPECT_EQ(type.name, row.name);
    EXPECT_EQ(type.file_params, row.params);
    EXPECT_EQ(type.num_file_params, std::count(row.params.begin(), row.params.end(), ' ') + 1);
    EXPECT_EQ(type.manifold->ambient, row.ambient);
    EXPECT_EQ(type.manifold->tangent, row.tangent);
    EXPECT_EQ(type.TakesPoints(), row.points);
    EXPECT_EQ(type.TakesLines(), row.lines);
    EXPECT_EQ(type.HasDirection(), row.direction);
    EXPECT_EQ(type.IsParallelism(), row.code == 0);
    EXPECT_EQ(type.project_point_with_jacobian != nullptr, row.points);
    EXPECT_EQ(type.project_line_with_jacobian != nullptr, row.lines && row.jacobians);
    EXPECT_EQ(type.min_points, row.min_points);
    EXPECT_EQ(type.min_lines, row.min_lines);
  }
}

TEST(GroupType, KnownTypesAreThoseOfTheTable) {
  EXPECT_EQ(&PlaneType(), FindGroupType("PLANE"));
  EXPECT_EQ(&VanishingPointType(), FindGroupType("VP"));
  EXPECT_EQ(&CuboidType(), FindGroupType("CUBOID"));
  for (const GroupType* type : AllGroupTypes()) {
    EXPECT_EQ(IsPlane(*type), type->name == "PLANE");
    EXPECT_EQ(IsVanishingPoint(*type), type->name == "VP");
    EXPECT_EQ(IsCuboid(*type), type->name == "CUBOID");
  }
}

TEST(GroupType, UnknownCodesAndNamesAreNull) {
  EXPECT_EQ(FindGroupType(-1), nullptr);
  EXPECT_EQ(FindGroupType(255), nullptr);
  EXPECT_EQ(FindGroupType("KLEIN_BOTTLE"), nullptr);
  EXPECT_EQ(FindGroupType("sphere"), nullptr);
  EXPECT_EQ(FindGroupType(""), nullptr);
}

template <typename G>
class GroupTable : public ::testing::Test {
 protected:
  Random random_{11};
};
TYPED_TEST_SUITE(GroupTable, TestedGroups);

TYPED_TEST(GroupTable, AnswersAsTheTypeDoes) {
  using G = TypeParam;
  constexpr int kAmbient = G::Manifold::kAmbient;
  const GroupType& type = *FindGroupType(G::kTypeCode);
  for (const auto& g : G::Examples()) {
    double plain[G::kNumFileParams], expected_plain[G::kNumFileParams];
    type.to_file(g.data(), plain);
    G::ToFile(g.data(), expected_plain);
    EXPECT_TRUE(std::equal(plain, plain + G::kNumFileParams, expected_plain));
    typename G::Params read;
    ASSERT_TRUE(type.from_file(plain, read.data()));
    EXPECT_EQ(read, *G::FromFile(plain));
    plain[0] = std::nan("");
    EXPECT_FALSE(type.from_file(plain, read.data()));

    Sim3d sim;
    sim.scale = 2.5;
    sim.translation << 1, -2, 3;
    typename G::Params moved = g;
    type.transform(sim, moved.data(), moved.data());  // in place
    EXPECT_EQ(moved, G::Transform(sim, g.data()));

    if constexpr (ProjectsPoints<G>) {
      for (const Eigen::Vector3d& X : PointsAround<G>(g, 10, &this->random_)) {
        Eigen::Vector3d projected, projected_again;
        RowMajor<3, 3> by_point, expected_by_point;
        RowMajor<3, kAmbient> by_group, expected_by_group;
        ASSERT_TRUE(type.project_point(g.data(), X, &projected));
        EXPECT_EQ(projected, *G::ProjectPoint(g.data(), X));
        ASSERT_TRUE(type.project_point_with_jacobian(g.data(), X, &projected_again, by_point.data(),
                                                     by_group.data()));
        EXPECT_EQ(projected_again,
                  *G::ProjectPointWithJacobian(g.data(), X, expected_by_point.data(),
                                               expected_by_group.data()));
        EXPECT_EQ(by_point, expected_by_point);
        EXPECT_EQ(by_group, expected_by_group);
      }
      const auto members = SurfacePoints<G>(g, 40, &this->random_);
      EXPECT_EQ(type.mesh(g.data(), members).vertices, G::Mesh(g.data(), members).vertices);
      typename G::Params fit;
      ASSERT_TRUE(type.fit_minimal(members, {}, fit.data()));
      EXPECT_EQ(fit, *G::FitMinimal(members, {}));
    }
    if constexpr (ProjectsLines<G>) {
      for (const PlueckerLine& line : LinesAround<G>(g, 10, &this->random_)) {
        Vector6d projected, projected_again;
        RowMajor<6, 6> by_line;
        RowMajor<6, kAmbient> by_group;
        ASSERT_TRUE(type.project_line(g.data(), Stacked(line), &projected));
        const auto expected = *G::ProjectLine(g.data(), line.direction, line.moment);
        EXPECT_EQ(projected, Stacked({expected.first, expected.second}));
        ASSERT_TRUE(type.project_line_with_jacobian(g.data(), Stacked(line), &projected_again,
                                                    by_line.data(), by_group.data()));
        EXPECT_THAT(projected_again, EigenNear(projected, 1e-11 * (1.0 + line.moment.norm())));
      }
    }
    if constexpr (HasDirection<G>) {
      Eigen::Vector3d direction, direction_again;
      RowMajor<3, kAmbient> by_group;
      type.direction(g.data(), &direction, nullptr);
      type.direction(g.data(), &direction_again, by_group.data());
      EXPECT_EQ(direction, G::Direction(g.data()));
      EXPECT_EQ(direction_again, direction);
      EXPECT_EQ(by_group.template leftCols<3>(), Eigen::Matrix3d::Identity());
    }
  }
}

struct FileCase {
  std::string name;
  std::vector<double> plain;
  bool valid;
};
void PrintTo(const FileCase& c, std::ostream* out) { *out << c.name << " " << c.valid; }

class GroupFile : public ::testing::TestWithParam<FileCase> {};

TEST_P(GroupFile, IsAcceptedOnlyIfItIsAGroup) {
  const GroupType& type = *FindGroupType(GetParam().name);
  ASSERT_EQ(static_cast<int>(GetParam().plain.size()), type.num_file_params);
  double g[kMaxGroupParams];
  EXPECT_EQ(type.from_file(GetParam().plain.data(), g), GetParam().valid);
}

constexpr double kHalfPi = 0.5 * std::numbers::pi;
INSTANTIATE_TEST_SUITE_P(
    Cases, GroupFile,
    ::testing::Values(
        FileCase{"VP", {0, 0, 1}, true}, FileCase{"VP", {0, 0, 1 + 9e-7}, true},
        FileCase{"VP", {0, 0, 1 + 2e-6}, false}, FileCase{"VP", {0, 0, 0}, false},
        FileCase{"VP", {1, 1, 0}, false}, FileCase{"PLANE", {0.6, 0.8, 0, -1e9}, true},
        FileCase{"PLANE", {0.6, 0.9, 0, 1}, false}, FileCase{"PLANE", {0, 0, 0, 1}, false},
        FileCase{"SPHERE", {1, 2, 3, 1e-9}, true}, FileCase{"SPHERE", {1, 2, 3, 0}, false},
        FileCase{"SPHERE", {1, 2, 3, -1}, false}, FileCase{"CYLINDER", {0, 0, 1, 2, 3, 0, 1}, true},
        FileCase{"CYLINDER", {0, 0, 1, 2, 3, 1e-7, 1}, true},
        FileCase{"CYLINDER", {0, 0, 1, 0, 0, 1e-17, 1}, true},
        FileCase{"CYLINDER", {0, 0, 1, 2, 3, 1e-3, 1}, false},
        FileCase{"CYLINDER", {0, 0, 2, 2, 3, 0, 1}, false},
        FileCase{"CYLINDER", {0, 0, 1, 2, 3, 0, 0}, false},
        FileCase{"CONE", {0, 0, 0, 0, 1, 0, 0.7}, true},
        FileCase{"CONE", {0, 0, 0, 0, 1, 0, std::nextafter(kHalfPi, 0)}, true},
        FileCase{"CONE", {0, 0, 0, 0, 1, 0, kHalfPi}, false},
        FileCase{"CONE", {0, 0, 0, 0, 1, 0, 0}, false},
        FileCase{"CONE", {0, 0, 0, 0, 1, 0, -0.3}, false},
        FileCase{"CONE", {0, 0, 0, 0, 1, 1, 0.3}, false},
        FileCase{"ELLIPSOID", {1, 0, 0, 0, 5, 6, 7, 1, 2, 3}, true},
        FileCase{"ELLIPSOID", {1, 0, 0, 0.1, 5, 6, 7, 1, 2, 3}, false},
        FileCase{"ELLIPSOID", {1, 0, 0, 0, 5, 6, 7, 1, 0, 3}, false},
        FileCase{"ELLIPSOID", {1, 0, 0, 0, 5, 6, 7, 1, 2, -3}, false},
        FileCase{"CUBOID", {1, 0, 0, 0, -1, -1, -1, -1, -1, -1}, true},
        FileCase{"CUBOID", {0, 0, -1, 0, -5, 4, 4, -5, -1, -1}, true},
        FileCase{"CUBOID", {0, 0, 0, 0, -1, -1, -1, -1, -1, -1}, false},
        FileCase{"CUBOID", {1, 0, 0, 0, 1, -1, -1, -1, -1, -1}, false},
        FileCase{"CUBOID", {1, 0, 0, 0, -1, -1, 2, -1, -1, -1}, false},
        FileCase{"CUBOID", {1, 0, 0, 0, -1, -1, -1, -1, 1, 1}, false},
        FileCase{"TORUS", {5, 6, 7, 0, 0.6, 0.8, 2, 1}, true},
        FileCase{"TORUS", {5, 6, 7, 0, 0.6, 0.8, 2, 2}, false},
        FileCase{"TORUS", {5, 6, 7, 0, 0.6, 0.8, 2, 0}, false},
        FileCase{"TORUS", {5, 6, 7, 0, 0.6, 0.9, 2, 1}, false},
        FileCase{"BEZIER_CURVE", {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}, true},
        FileCase{"BEZIER_CURVE", {1, 2, 3, 1, 2, 3, 1, 2, 3, 1, 2, 3}, false}));

TEST(GroupFileValues, MemoryHoldsLogarithmsAndQuaternionsWithWLast) {
  const double half = std::sqrt(0.5);
  const double sphere[] = {1, 2, 3, 2.5}, cylinder[] = {0, 0, 1, 2, 3, 0, 0.5};
  const double cone[] = {1, 2, 3, 0, 1, 0, 0.25};
  const double ellipsoid[] = {half, 0, half, 0, 7, 8, 9, 1, 2, 4};
  const double cuboid[] = {half, 0, half, 0, -1, -2, -3, -4, -5, -6};
  EXPECT_EQ(*Sphere::FromFile(sphere), Sphere::Params(1, 2, 3, std::log(2.5)));
  Cylinder::Params expected_cylinder;  // p = d x m
  expected_cylinder << 0, 0, 1, -3, 2, 0, std::log(0.5);
  EXPECT_EQ(*Cylinder::FromFile(cylinder), expected_cylinder);
  Cone::Params expected_cone;
  expected_cone << 1, 2, 3, 0, 1, 0, std::log(0.25);
  EXPECT_EQ(*Cone::FromFile(cone), expected_cone);
  Ellipsoid::Params expected_ellipsoid;
  expected_ellipsoid << 0, half, 0, half, 7, 8, 9, 0, std::log(2), std::log(4);
  EXPECT_EQ(*Ellipsoid::FromFile(ellipsoid), expected_ellipsoid);
  Cuboid::Params expected_cuboid;
  expected_cuboid << 0, half, 0, half, -1, -2, -3, -4, -5, -6;
  EXPECT_EQ(*Cuboid::FromFile(cuboid), expected_cuboid);
}

TEST(GroupFileValues, NearlyUnitVectorsAreNormalisedWithoutMovingTheSurface) {
  const double stretch = 1 + 5e-7;
  const double plane[] = {0.6 * stretch, 0.8 * stretch, 0, 3 * stretch};
  EXPECT_THAT(*Plane::FromFile(plane), EigenNear(Plane::Params(0.6, 0.8, 0, 3), 1e-15));
  const double cylinder[] = {0, 0, stretch, 2 * stretch, 3 * stretch, 0, 0.5};
  Cylinder::Params expected;
  expected << 0, 0, 1, -3, 2, 0, std::log(0.5);
  EXPECT_THAT(*Cylinder::FromFile(cylinder), EigenNear(expected, 1e-15));
}

TEST(GroupFileValues, ConeOpenedBeyondAFlatOneIsWrittenOpeningTheOtherWay) {
  Cone::Params g;
  g << 1, 2, 3, 0, 0, 1, std::log(2.0);
  double plain[7];
  Cone::ToFile(g.data(), plain);
  EXPECT_EQ(plain[5], -1.0);
  EXPECT_NEAR(plain[6], std::numbers::pi - 2.0, 1e-15);
  const Cone::Params same = *Cone::FromFile(plain);
  Random random(3);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d X = Eigen::Vector3d(1, 2, 3) + RandomVector(&random);
    EXPECT_THAT(*Cone::ProjectPoint(g.data(), X),
                EigenNear(*Cone::ProjectPoint(same.data(), X), 1e-14));
  }
}

}  // namespace
}  // namespace holba
