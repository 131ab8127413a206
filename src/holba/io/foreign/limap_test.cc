// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/limap.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/io/foreign/limap_database.h"
#include "holba/io/foreign/limap_groups.h"
#include "holba/io/model_io.h"
#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

using testing::HasSubstr;

RandomModelOptions Plain(bool with_rigs) {
  return {.with_rigs = with_rigs, .extreme_reals = false};
}

// Without the types that LIMAP lacks.
Reconstruction RandomLimapModel(uint64_t seed, bool with_rigs) {
  Reconstruction model = RandomModel(seed, Plain(with_rigs));
  DeleteTypesUnknownToLimap(&model);
  return model;
}

// How far apart the surfaces of two sets of parameters of one type are at some points.
double Difference(const GroupType& type, const std::vector<double>& a,
                  const std::vector<double>& b) {
  double ga[kMaxGroupParams], gb[kMaxGroupParams];
  EXPECT_TRUE(type.from_file(a.data(), ga));
  EXPECT_TRUE(type.from_file(b.data(), gb));
  double worst = 0.0;
  if (type.direction != nullptr) {
    Eigen::Vector3d da, db;
    type.direction(ga, &da, nullptr);
    type.direction(gb, &db, nullptr);
    worst = (da - db).norm();
  }
  Random random(5);
  for (int i = 0; i < 20 && type.project_point != nullptr; ++i) {
    const Eigen::Vector3d X(random.Normal(5.0), random.Normal(5.0), random.Normal(5.0));
    Eigen::Vector3d Xa, Xb;
    if (type.project_point(ga, X, &Xa) && type.project_point(gb, X, &Xb))
      worst = std::max(worst, (Xa - Xb).norm());
  }
  return worst;
}

TEST(LimapGroups, ParametersOfEveryTypeComeBack) {
  const Reconstruction model = RandomLimapModel(2, false);
  std::set<std::string_view> types;
  for (const auto& [id, group] : model.groups3D) {
    types.insert(group.type->name);
    EXPECT_EQ(GroupTypeOfLimap(LimapCodeOf(*group.type)), group.type);
    const std::vector<double> limap = ParamsToLimap(*group.type, group.params);
    ASSERT_EQ(limap.size(), NumLimapParams(*group.type));
    // A point on the axis of a cone says which nappe is meant.
    std::vector<Eigen::Vector3d> inside;
    if (group.type->name == "CONE")
      inside.push_back(Eigen::Vector3d(group.params.data()) +
                       Eigen::Vector3d(group.params.data() + 3));
    const auto back = ParamsFromLimap(*group.type, limap, inside);
    ASSERT_TRUE(back.has_value());
    EXPECT_LT(Difference(*group.type, group.params, *back), 1e-9) << group.type->name;
  }
  EXPECT_EQ(types.size(), 7u);
}

TEST(LimapGroups, AreWhatLimapMeans) {
  const GroupType& cylinder = *FindGroupType("CYLINDER");
  // The axis through (0, 2, 0) along x: d = (1, 0, 0), m = p x d = (0, 0, -2).
  const std::vector<double> limap =
      ParamsToLimap(cylinder, std::vector<double>{1, 0, 0, 0, 0, -2, 3});
  const Eigen::Matrix3d R =
      Eigen::Quaterniond(limap[3], limap[0], limap[1], limap[2]).toRotationMatrix();
  EXPECT_LT((R.col(0) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((R.col(1) * limap[5] / limap[4] - Eigen::Vector3d(0, 0, -2)).norm(), 1e-12);
  EXPECT_NEAR(limap[4] * limap[4] + limap[5] * limap[5], 1.0, 1e-12);
  EXPECT_NEAR(limap[6], std::log(3.0), 1e-12);
  EXPECT_NEAR(ParamsToLimap(*FindGroupType("CONE"),
                            std::vector<double>{0, 0, 0, 0, 0, 1, std::atan(2.0)})[6],
              std::log(2.0), 1e-12);
  // LIMAP's cone opens both ways; its members say which half is meant.
  const std::vector<double> cone = {0, 0, 0, 0, 0, 1, 0};
  const std::vector<Eigen::Vector3d> below = {{0, 1, -1}};
  EXPECT_EQ((*ParamsFromLimap(*FindGroupType("CONE"), cone, below))[5], -1.0);
  // n.x = d there, n.x + w = 0 here.
  const auto cuboid = ParamsFromLimap(*FindGroupType("CUBOID"),
                                      std::vector<double>{0, 0, 0, 1, 1, 2, 3, 4, 5, 6}, {});
  EXPECT_EQ(*cuboid, (std::vector<double>{1, 0, 0, 0, -1, -2, -3, -4, -5, -6}));
}

TEST(Limap, AModelComesBack) {
  for (const bool with_rigs : {false, true}) {
    const Reconstruction whole = RandomModel(11, Plain(with_rigs));
    Reconstruction model = whole;
    EXPECT_EQ(DeleteTypesUnknownToLimap(&model), 4u);  // two each of torus and Bezier curve
    ASSERT_EQ(model.FindInconsistency().value_or(""), "");
    TestFolder folder;
    WriteLimap(whole, folder / "model");
    EXPECT_THAT(ListFolder(folder / "model"), testing::Contains("structures"));
    EXPECT_TRUE(HoldsLimapStructures(folder / "model"));
    const Reconstruction again = ReadModel(folder / "model");
    ASSERT_EQ(again.images.size(), model.images.size());
    for (const auto& [id, image] : model.images) {
      const Image& read = again.images.at(id);
      ASSERT_EQ(read.lines2D.size(), image.lines2D.size());
      for (size_t i = 0; i < image.lines2D.size(); ++i) {
        EXPECT_EQ(read.lines2D[i].line3D_id, image.lines2D[i].line3D_id);
        EXPECT_EQ(read.lines2D[i].segment.start, image.lines2D[i].segment.start);
        EXPECT_EQ(read.lines2D[i].segment.end, image.lines2D[i].segment.end);
      }
      ASSERT_EQ(read.groups2D.size(), image.groups2D.size());
      for (size_t i = 0; i < image.groups2D.size(); ++i) {
        EXPECT_EQ(read.groups2D[i].type, image.groups2D[i].type);
        EXPECT_EQ(read.groups2D[i].group3D_id, image.groups2D[i].group3D_id);
        EXPECT_EQ(read.groups2D[i].point2D_idxs, image.groups2D[i].point2D_idxs);
        EXPECT_EQ(read.groups2D[i].line2D_idxs, image.groups2D[i].line2D_idxs);
      }
    }
    ASSERT_EQ(again.lines3D.size(), model.lines3D.size());
    for (const auto& [id, line] : model.lines3D) {
      const Line3D& read = again.lines3D.at(id);
      EXPECT_EQ(read.track, line.track);
      const double sign = read.line.direction.dot(line.line.direction) < 0 ? -1.0 : 1.0;
      EXPECT_LT((sign * read.line.direction - line.line.direction).norm(), 1e-9);
      EXPECT_LT((sign * read.line.moment - line.line.moment).norm(), 1e-7);
    }
    ASSERT_EQ(again.groups3D.size(), model.groups3D.size());
    for (const auto& [id, group] : model.groups3D) {
      const Group3D& read = again.groups3D.at(id);
      EXPECT_EQ(read.type, group.type);
      EXPECT_EQ(read.point3D_ids, group.point3D_ids);
      EXPECT_EQ(read.line3D_ids, group.line3D_ids);
      EXPECT_EQ(read.observations, group.observations);
    }
    ASSERT_EQ(again.wireframe.size(), model.wireframe.size());
    for (size_t i = 0; i < model.wireframe.size(); ++i) {
      EXPECT_EQ(again.wireframe[i].point3D_id, model.wireframe[i].point3D_id);
      EXPECT_EQ(again.wireframe[i].line3D_id, model.wireframe[i].line3D_id);
    }
    // Written as ours into the same folder, LIMAP's files are gone; others would be read twice.
    WriteModel(again, folder / "model", ModelFormat::kText);
    EXPECT_FALSE(HoldsLimapStructures(folder / "model"));
    EXPECT_EQ(ReadModel(folder / "model").lines3D.size(), model.lines3D.size());
  }
}

TEST(Limap, ItsTextIsReadToo) {
  // Two images that see a point (1) and a line (7) through it.
  TestFolder folder;
  WriteBytes(folder / "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
  WriteBytes(folder / "images.txt",
             "1 1 0 0 0 0 0 5 1 a.jpg\n320 240 1\n2 1 0 0 0 1 0 5 1 b.jpg\n420 240 1\n");
  WriteBytes(folder / "points3D.txt", "1 0 0 0 0 0 0 0.5 1 0 2 0\n");
  WriteBytes(folder / "structures/structures2d.txt",
             "2\n1\n1 2 1 1\n300 240 400 240 -1\n1 2 3 4 -1\n0 0 1 9\n0 1\n1\n0 0 1\n"
             "2\n1 1 2 0\n400 240 500 240 -1\n0 0 1 9\n0 1\n2 0 0 18446744073709551615\n0\n");
  WriteBytes(folder / "structures/lines3D.txt",
             "2\n7\n-0.2 0 0 0.8 0 0\n2\n1 0\n2 0\n0.5\n8\n1 1 1 1 1 1\n0\n-1\n");
  WriteBytes(folder / "structures/groups3D.txt", "1\n9\n0 0 1\n7 1\n2\n1 0\n2 0\n3 1 0 0\n");
  WriteBytes(folder / "structures/wireframe3D.txt", "1\n1 7 1.5\n");
  const Reconstruction model = ReadModel(folder.path());
  ASSERT_EQ(model.lines3D.size(), 1u);  // the second one is a point
  EXPECT_EQ(model.lines3D.at(7).line.direction, Eigen::Vector3d::UnitX());
  EXPECT_EQ(model.images.at(1).lines2D[0].line3D_id, 7u);
  EXPECT_EQ(model.images.at(1).lines2D[1].line3D_id, kNoId);
  ASSERT_EQ(model.images.at(2).groups2D.size(), 1u);  // the second one has no features
  EXPECT_EQ(model.groups3D.at(9).line3D_ids, std::vector<line3D_t>{7});
  EXPECT_EQ(model.groups3D.at(9).observations.size(), 2u);
  ASSERT_EQ(model.wireframe.size(), 1u);
  EXPECT_EQ(model.wireframe[0].num_images, 1u);
}

// Bytes of a written file, damaged; never more than a refusal.
TEST(Limap, DamageIsAtMostRefused) {
  SetLogLevel(LogLevel::kError);
  const Reconstruction model = RandomModel(4, Plain(false));
  TestFolder folder;
  WriteLimap(model, folder / "model");
  size_t num_refused = 0;
  for (const char* name : {"structures2d", "lines3D", "groups3D", "wireframe3D"}) {
    const std::filesystem::path path = folder / fmt::format("model/structures/{}.bin", name);
    const std::string good = ReadFileBytes(path);
    const auto read = [&](const std::string& bytes) {
      WriteBytes(path, bytes);
      try {
        ReadModel(folder / "model");
        return false;
      } catch (const InputError&) {
        ++num_refused;
        return true;
      }
    };
    for (size_t size = 0; size < good.size(); size += good.size() / 20 + 1)
      EXPECT_TRUE(read(good.substr(0, size))) << name << " cut after " << size;
    Random random(9);
    for (int i = 0; i < 100; ++i) {
      std::string bytes = good;
      bytes[random.Index(bytes.size())] = static_cast<char>(random.Index(256));
      read(bytes);
    }
    WriteBytes(path, good);
  }
  EXPECT_GT(num_refused, 80u);
}

TEST(LimapDatabase, ComesBackAndDamageIsRefused) {
  const Reconstruction model = RandomLimapModel(6, false);
  const LimapDatabase limap = LimapDatabaseOf(model);
  EXPECT_FALSE(limap.line_matches.empty());
  TestFolder folder;
  const std::filesystem::path path = folder / "structure # database.db";
  WriteLimapDatabase(limap, path);
  ASSERT_TRUE(IsLimapDatabase(path));
  const LimapDatabase again = ReadLimapDatabase(path);
  EXPECT_EQ(again.line_matches, limap.line_matches);
  EXPECT_EQ(again.group_matches, limap.group_matches);
  ASSERT_EQ(again.structures.size(), model.images.size());
  for (const auto& [id, structure] : limap.structures) {
    const LimapStructure2d& read = again.structures.at(id);
    EXPECT_EQ(read.num_points, structure.num_points);
    ASSERT_EQ(read.lines.size(), structure.lines.size());
    EXPECT_EQ(read.group_params, structure.group_params);
    ASSERT_EQ(read.groups.size(), structure.groups.size());
    for (size_t i = 0; i < read.groups.size(); ++i)
      EXPECT_EQ(read.groups[i].line2D_idxs, structure.groups[i].line2D_idxs);
    EXPECT_EQ(read.edges.size(), structure.edges.size());
  }
  const std::string good = ReadFileBytes(path);
  Random random(1);
  size_t num_refused = 0;
  for (int i = 0; i < 200; ++i) {
    std::string bytes = good;
    bytes[100 + random.Index(bytes.size() - 100)] = static_cast<char>(random.Index(256));
    if (i % 4 == 0) bytes.resize(random.Index(bytes.size()));
    WriteBytes(path, bytes);
    try {
      ReadLimapDatabase(path);
    } catch (const InputError&) {
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 40u);
}

TEST(LimapDatabase, GoesIntoAColmapDatabaseAndOut) {
  TestFolder folder;
  LimapDatabase limap;
  {
    Database database(folder / "database.db");
    const camera_t camera_id =
        database.AddCamera(std::nullopt, {.camera = {.model = FindCameraModel("PINHOLE"),
                                                     .width = 640,
                                                     .height = 480,
                                                     .params = {500, 500, 320, 240}}});
    for (const char* name : {"a.jpg", "b.jpg"}) {
      const image_t id = database.AddImage(std::nullopt, {.name = name, .camera_id = camera_id});
      LimapStructure2d& structure = limap.structures[id];
      structure.lines = {{.segment = {{1, 2}, {3, 4}}}, {.segment = {{5, 6}, {70, 8}}}};
      structure.groups = {{.type = FindGroupType("VP"), .line2D_idxs = {1}}};
      structure.group_params = {{320.0, 240.0, 1.0}};  // straight ahead
    }
    limap.line_matches[{1, 2}] = {{0, 1}, {1, 0}};
    EXPECT_EQ(AddToDatabase(limap, "limap.db", &database), 2u);
    const auto points = database.ReadVanishingPoints(1, "limap");
    ASSERT_TRUE(points.has_value());
    EXPECT_LT((points->points[0].direction_in_cam - Eigen::Vector3d::UnitZ()).norm(), 1e-6);
    const LimapDatabase again = LimapDatabaseOf(database);
    EXPECT_EQ(again.line_matches, limap.line_matches);
    EXPECT_EQ(again.structures.at(2).groups[0].line2D_idxs, std::vector<line2D_t>{1});
    limap.line_matches[{1, 2}] = {{0, 9}};
    EXPECT_THROW(AddToDatabase(limap, "limap.db", &database), InputError);
  }
  // Beside COLMAP's database it is a model of images that wait for their poses.
  limap.line_matches.clear();
  WriteLimapDatabase(limap, folder / "structure_database.db");
  const Reconstruction model = ReadModel(folder / "structure_database.db");
  ASSERT_EQ(model.unregistered_images.size(), 2u);
  EXPECT_EQ(model.unregistered_images.at(2).name, "b.jpg");
  EXPECT_EQ(model.unregistered_images.at(2).lines2D.size(), 2u);
  std::filesystem::remove(folder / "database.db");
  EXPECT_THROW(ReadModel(folder / "structure_database.db"), InputError);
}

}  // namespace
}  // namespace holba
