// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/ply_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "holba/base/error.h"
#include "holba/base/random.h"

namespace holba {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class PlyReader : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("holba_ply_reader_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path File(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  template <typename Read>
  static std::string Refusal(const Read& read) {
    try {
      read();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::string PlyRefusal(const std::string& text, GeometryContent content) const {
    return Refusal([&] { ReadPly(File("bad.ply", text), content); });
  }

  static constexpr const char* kSquare =
      "ply\r\nformat ascii 1.0\r\ncomment c\r\nelement vertex 4\r\nproperty float x\r\n"
      "property float z\r\nproperty float y\r\nelement face 1\r\n"
      "property list uchar int vertex_indices\r\nelement edge 1\r\nproperty int vertex1\r\n"
      "property uchar red\r\nproperty int vertex2\r\nend_header\r\n"
      "0 5 0\r\n1 5 0\r\n1 5 1\r\n0 5 +1e0\r\n4 0 1 2 3\r\n0 255 2";
  fs::path folder_;
};

TEST_F(PlyReader, ReadsPropertiesByNameFacesAsFansAndEdges) {
  const FileGeometry geometry = ReadPly(File("a.ply", kSquare), GeometryContent::kTriangles);
  ASSERT_EQ(geometry.vertices.size(), 4u);
  EXPECT_EQ(geometry.vertices[2], Eigen::Vector3d(1, 1, 5));
  EXPECT_EQ(geometry.vertices[3], Eigen::Vector3d(0, 1, 5));
  EXPECT_THAT(geometry.triangles, ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3)));
  EXPECT_THAT(geometry.edges, ElementsAre(ElementsAre(0, 2)));
}

TEST_F(PlyReader, ReadsWhatItWrites) {
  const FileGeometry geometry = ReadPly(File("a.ply", kSquare), GeometryContent::kTriangles);
  std::ostringstream stream;
  WriteTrianglePly(geometry.vertices, geometry.triangles, &stream);
  const FileGeometry again = ReadMesh(File("b.ply", stream.str()));
  EXPECT_EQ(again.vertices, geometry.vertices);
  EXPECT_EQ(again.triangles, geometry.triangles);
}

TEST_F(PlyReader, ReadsObjWithIndicesOfEitherKind) {
  const FileGeometry geometry =
      ReadMesh(File("a.obj",
                    "# a room\no wall\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nvn 0 0 1\nv 1 1 0\nv 0 1 0\n"
                    "f 1/1/1 2//1 3 4\nf -4 -3 -1\n"));
  EXPECT_EQ(geometry.vertices.size(), 4u);
  EXPECT_THAT(geometry.triangles,
              ElementsAre(ElementsAre(0, 1, 2), ElementsAre(0, 2, 3), ElementsAre(0, 1, 3)));
  EXPECT_THAT(Refusal([&] { ReadMesh(File("b.obj", "v 0 0 0\nf 1 2 3\n")); }),
              HasSubstr("b.obj:2: expected the index of a vertex (1 to 1), found '2'"));
}

TEST_F(PlyReader, RefusesDamagedFilesWithTheirPlace) {
  const std::string square = kSquare;
  const auto with = [&](const std::string& old_text, const std::string& new_text) {
    std::string text = square;
    return text.replace(text.find(old_text), old_text.size(), new_text);
  };
  constexpr auto kTriangles = GeometryContent::kTriangles;
  EXPECT_THAT(PlyRefusal("stl\n", kTriangles), HasSubstr("expected a PLY file"));
  EXPECT_THAT(PlyRefusal("ply\nformat ascii 1.0\n", kTriangles), HasSubstr("end_header"));
  EXPECT_THAT(PlyRefusal(with("ascii 1.0", "gzip 1.0"), kTriangles), HasSubstr("bad.ply:2: "));
  EXPECT_THAT(PlyRefusal(with("float z", "quad z"), kTriangles), HasSubstr("bad.ply:6: "));
  EXPECT_THAT(PlyRefusal(with("property float z\r\n", ""), kTriangles),
              HasSubstr("properties x, y and z"));
  EXPECT_THAT(PlyRefusal(with("1 5 0", "1 nan 0"), kTriangles), HasSubstr("bad.ply:16: "));
  EXPECT_THAT(PlyRefusal(with("4 0 1 2 3", "4 0 1 2 4"), kTriangles),
              HasSubstr("faces of vertices 0 to 3, found the index 4"));
  EXPECT_THAT(PlyRefusal(with("4 0 1 2 3", "4 0 1 2 -1"), kTriangles),
              HasSubstr("the index of a vertex, found -1"));
  EXPECT_THAT(PlyRefusal(with("vertex 4", "vertex 400000000"), kTriangles),
              HasSubstr("400000000 vertex elements"));
  EXPECT_THAT(PlyRefusal(with("\r\n0 255 2", ""), kTriangles), HasSubstr("the end of the file"));
  const std::string cloud =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n1 2 3\n";
  EXPECT_THAT(PlyRefusal(cloud, kTriangles), HasSubstr("--point_cloud_path"));
  EXPECT_THAT(PlyRefusal(cloud, GeometryContent::kEdges), HasSubstr("element 'edge'"));
  EXPECT_EQ(PlyRefusal(cloud, GeometryContent::kVertices), "");
}

TEST_F(PlyReader, DamagedBytesEndInARefusalOrInAGeometry) {
  Random random(5);
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (uint32_t i = 0; i < 20; ++i) {
    vertices.emplace_back(random.Normal(), random.Normal(), random.Normal());
    triangles.push_back({i, (i + 1) % 20, (i + 2) % 20});
  }
  std::ostringstream stream;
  WriteTrianglePly(vertices, triangles, &stream);
  size_t num_refused = 0;
  for (const std::string& whole : {stream.str(), std::string(kSquare)}) {
    for (int trial = 0; trial < 3000; ++trial) {
      std::string bytes =
          whole.substr(0, trial % 3 == 0 ? random.Index(whole.size()) : whole.size());
      for (size_t n = random.Index(4); n > 0 && !bytes.empty(); --n) {
        bytes[random.Index(bytes.size())] = static_cast<char>(random.Bits());
      }
      try {
        const FileGeometry geometry = ParsePly(bytes, "x.ply", GeometryContent::kTriangles);
        for (const auto& triangle : geometry.triangles) {
          for (const uint32_t corner : triangle) ASSERT_LT(corner, geometry.vertices.size());
        }
      } catch (const InputError&) {
        ++num_refused;
      }
    }
  }
  EXPECT_GT(num_refused, 2000u);
}

TEST_F(PlyReader, ReadsTheScansOfAMeshLabProject) {
  File("s.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "property float z\nend_header\n1 0 0\n");
  const auto project = [&](const std::string& matrix) {
    return File("p.mlp",
                "<MeshLabProject><MeshGroup><MLMesh label=\"s\" filename=\"s.ply\">\n"
                "<MLMatrix44>\n" +
                    matrix + "</MLMatrix44></MLMesh></MeshGroup>");
  };
  const std::vector<LaserScan> scans =
      ReadMeshLabProject(project("0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n"));
  ASSERT_EQ(scans.size(), 1u);
  EXPECT_LT((scans[0].world_from_scan * scans[0].points[0] - Eigen::Vector3d(5, 7, 7)).norm(),
            1e-12);
  EXPECT_THAT(Refusal([&] { ReadMeshLabProject(project("2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1")); }),
              HasSubstr("must be a rotation"));
  EXPECT_THAT(Refusal([&] { ReadMeshLabProject(project("1 0 0 0")); }), HasSubstr("16 numbers"));
  EXPECT_THAT(Refusal([&] { ReadMeshLabProject(File("q.mlp", "<MeshLabProject>")); }),
              HasSubstr("at least one MLMesh"));
  EXPECT_THAT(Refusal([&] {
                ReadMeshLabProject(File("q.mlp",
                                        "<MLMesh filename=\"none.ply\"><MLMatrix44>1 0 0 0 "
                                        "0 1 0 0 0 0 1 0 0 0 0 1</MLMatrix44>"));
              }),
              HasSubstr("none.ply: there is no such file"));
}

}  // namespace
}  // namespace holba
