// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <sstream>

#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

// What a reader of PLY makes of the bytes, by the header alone.
struct Ply {
  size_t num_vertices = 0, num_faces = 0, num_edges = 0;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<uint8_t, 3>> colours;
  std::vector<std::array<int32_t, 3>> faces;
  std::vector<std::array<int32_t, 2>> edges;
  size_t num_bytes_left = 0;
};

Ply Parse(const std::string& bytes) {
  Ply ply;
  std::istringstream stream(bytes);
  std::string line;
  std::getline(stream, line);
  EXPECT_EQ(line, "ply");
  std::getline(stream, line);
  EXPECT_EQ(line, "format binary_little_endian 1.0");
  while (std::getline(stream, line) && line != "end_header") {
    std::istringstream words(line);
    std::string keyword, name;
    size_t count = 0;
    words >> keyword >> name >> count;
    if (keyword != "element") continue;
    (name == "vertex" ? ply.num_vertices : name == "face" ? ply.num_faces : ply.num_edges) = count;
  }
  const auto get = [&](auto* value) {
    stream.read(reinterpret_cast<char*>(value), sizeof(*value));
    EXPECT_TRUE(stream.good());
  };
  for (size_t i = 0; i < ply.num_vertices; ++i) {
    std::array<double, 3> xyz;
    std::array<uint8_t, 3> rgb;
    get(&xyz);
    get(&rgb);
    ply.vertices.emplace_back(xyz[0], xyz[1], xyz[2]);
    ply.colours.push_back(rgb);
  }
  for (size_t i = 0; i < ply.num_faces; ++i) {
    uint8_t size;
    std::array<int32_t, 3> face;
    get(&size);
    EXPECT_EQ(size, 3);
    get(&face);
    ply.faces.push_back(face);
  }
  for (size_t i = 0; i < ply.num_edges; ++i) {
    std::array<int32_t, 2> edge;
    std::array<uint8_t, 3> rgb;
    get(&edge);
    get(&rgb);
    ply.edges.push_back(edge);
  }
  ply.num_bytes_left = bytes.size() - static_cast<size_t>(stream.tellg());
  return ply;
}

TEST(Ply, HoldsPointsLinesAndGroupMeshes) {
  const Reconstruction model = RandomModel(3, {.extreme_reals = false});
  std::ostringstream stream;
  FormatPly(model, {}, &stream);
  const Ply ply = Parse(stream.str());
  EXPECT_EQ(ply.num_bytes_left, 0u);
  ASSERT_GE(ply.num_vertices, model.points3D.size() + 2 * model.lines3D.size());
  size_t i = 0;
  for (const auto& [id, point] : model.points3D) {
    EXPECT_EQ(ply.vertices[i], point.xyz);
    EXPECT_EQ(ply.colours[i], point.rgb);
    ++i;
  }
  ASSERT_EQ(ply.edges.size(), model.lines3D.size());
  size_t k = 0;
  for (const auto& [id, line] : model.lines3D) {
    EXPECT_EQ(ply.vertices[ply.edges[k][0]], line.start);
    EXPECT_EQ(ply.vertices[ply.edges[k][1]], line.end);
    EXPECT_EQ(ply.colours[ply.edges[k][0]], line.rgb);
    ++k;
  }
  EXPECT_GT(ply.num_faces, 0u);
  const auto first = static_cast<int32_t>(model.points3D.size() + 2 * model.lines3D.size());
  for (const auto& face : ply.faces) {
    for (const int32_t vertex : face) {
      ASSERT_GE(vertex, first);
      ASSERT_LT(vertex, static_cast<int32_t>(ply.num_vertices));
      ASSERT_TRUE(ply.vertices[vertex].allFinite());
    }
  }
}

TEST(Ply, APointCloudHasNoFacesAndNoEdges) {
  const TestFolder folder;
  WritePly(RandomModel(1), folder / "new" / "points.ply", {.lines = false, .groups = false});
  const std::string bytes = ReadFileBytes(folder / "new" / "points.ply");
  EXPECT_THAT(bytes, testing::Not(testing::HasSubstr("element face")));
  EXPECT_THAT(bytes, testing::Not(testing::HasSubstr("element edge")));
  EXPECT_EQ(Parse(bytes).num_vertices, RandomModel(1).points3D.size());
}

}  // namespace
}  // namespace holba
