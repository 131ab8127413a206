// SPDX-License-Identifier: BSD-3-Clause
// Formats of other programs, read by what their specifications say.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "holba/io/dxf.h"
#include "holba/io/floor_plan.h"
#include "holba/io/glb.h"
#include "holba/io/obj.h"
#include "holba/io/shapes.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

using Lines = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;

// A room of 4 x 3 x 2.5 whose up is -y: edges along its three directions and one line aslant, the
// wall x = 4, a camera amid it that looks along +z.
Reconstruction Room(const Eigen::Vector3d& at = Eigen::Vector3d::Zero()) {
  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel("PINHOLE"), 640, 480, {400, 400, 320, 240}});
  model.images.Add(1, {.name = "</text>\"&\xff.jpg", .camera_id = 1});
  model.images.at(1).cam_from_world.translation = -(at + Eigen::Vector3d(2, -1.2, 1));
  model.AddTrivialRigsAndFrames();
  const auto add_line = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return model.AddLine3D(PlueckerLine::FromPoints(at + a, at + b), at + a, at + b);
  };
  const line3D_t along_x = add_line({0, 0, 0}, {4, 0, 0}),
                 along_x2 = add_line({0, 0, 3}, {4, 0, 3});
  const line3D_t along_y = add_line({4, 0, 0}, {4, -2.5, 0}),
                 along_z = add_line({4, 0, 0}, {4, 0, 3});
  add_line({0, 0, 0}, {1, -2, 2});
  const GroupType& vp = *FindGroupType("VP");
  model.AddGroup3D(vp, {1, 0, 0}, {}, {along_x, along_x2});
  model.AddGroup3D(vp, {0, 1, 0}, {}, {along_y});
  model.AddGroup3D(vp, {0, 0, 1}, {}, {along_z});
  const point3D_t p1 = model.AddPoint3D(at + Eigen::Vector3d(4, 0, 0), {}, PointOrigin::kDetected,
                                        {255, 0, 10}),
                  p2 = model.AddPoint3D(at + Eigen::Vector3d(4, -2.5, 3)),
                  p3 = model.AddPoint3D(at + Eigen::Vector3d(4, 0, 3));
  model.AddGroup3D(*FindGroupType("PLANE"), {1, 0, 0, -4 - at.x()}, {p1, p2, p3},
                   {along_y, along_z});
  return model;
}

template <typename Format>
std::string Text(Format format, const Reconstruction& model) {
  std::ostringstream stream;
  format(model, &stream);
  return stream.str();
}

struct Glb {
  explicit Glb(const std::string& file) {
    const auto word = [&](size_t at) {
      uint32_t value = 0;
      std::memcpy(&value, &file[at], 4);
      return value;
    };
    EXPECT_EQ(file.substr(0, 4), "glTF");
    EXPECT_EQ(word(4), 2u);
    EXPECT_EQ(word(8), file.size());
    EXPECT_EQ(file.substr(16, 4), "JSON");
    EXPECT_EQ(word(12) % 4, 0u);
    json = nlohmann::json::parse(file.substr(20, word(12)));
    const size_t next = 20 + word(12);
    if (next == file.size()) return;
    EXPECT_EQ(file.substr(next + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(next + 8 + word(next), file.size());
    bytes = file.substr(next + 8);
    EXPECT_EQ(json["buffers"][0]["byteLength"], bytes.size());
  }

  template <typename T>
  std::vector<T> Accessor(size_t index) const {
    const auto& accessor = json["accessors"][index];
    const auto& view = json["bufferViews"][accessor["bufferView"].get<size_t>()];
    const size_t width = std::map<std::string, size_t>{
        {"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}}[accessor["type"].get<std::string>()];
    std::vector<T> values(accessor["count"].get<size_t>() * width);
    const size_t offset = view["byteOffset"];
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_EQ(view["byteLength"], values.size() * sizeof(T));
    EXPECT_LE(offset + values.size() * sizeof(T), bytes.size());
    std::memcpy(values.data(), &bytes[offset], values.size() * sizeof(T));
    return values;
  }
  const nlohmann::json& Node(const std::string& name) const {
    for (const auto& node : json["nodes"])
      if (node["name"] == name) return node;
    ADD_FAILURE() << name;
    return json["nodes"][0];
  }
  static Eigen::Affine3d Pose(const nlohmann::json& node) {
    const auto& q = node["rotation"];
    const auto& t = node["translation"];
    return Eigen::Translation3d(t[0], t[1], t[2]) *
           Eigen::Quaterniond(q[3].get<double>(), q[0], q[1], q[2]);
  }
  // In glTF's world, whose y is up.
  std::vector<Eigen::Vector3d> Positions(const std::string& name) const {
    const auto& mesh = json["meshes"][Node(name)["mesh"].get<size_t>()];
    const auto values =
        Accessor<float>(mesh["primitives"][0]["attributes"]["POSITION"].get<size_t>());
    std::vector<Eigen::Vector3d> positions;
    for (size_t i = 0; i < values.size(); i += 3)
      positions.push_back(Pose(Node("model")) *
                          Eigen::Vector3d(values[i], values[i + 1], values[i + 2]));
    return positions;
  }

  nlohmann::json json;
  std::string bytes;
};

TEST(Glb, StandsUpright) {
  for (const double far : {0.0, 4e6}) {
    const Glb glb(Text(FormatGlb, Room({far, -far, far})));
    const auto points = glb.Positions("points");
    ASSERT_EQ(points.size(), 3u);
    EXPECT_NEAR((points[0] - points[2]).norm(), 3.0, 1e-5);
    EXPECT_NEAR(points[1].y() - points[2].y(), 2.5, 1e-5) << "up is +y";
    const auto lines = glb.Positions("direction_1");
    ASSERT_EQ(lines.size(), 4u);
    EXPECT_NEAR(std::abs(lines[1].x() - lines[0].x()), 4.0, 1e-5);
  }
}

TEST(Glb, TransformsGiveTheWorldBack) {
  const Eigen::Vector3d at(4e6, 1e5, -2e6);
  const Reconstruction model = Room(at);
  const Glb glb(Text(FormatGlb, model));
  // A rotation: lengths, angles and handedness are those of the model.
  const Eigen::Affine3d pose = Glb::Pose(glb.Node("model"));
  EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-12);
  const auto points = glb.Positions("points");
  const std::vector<Eigen::Vector3d> expected = {{4, 0, 0}, {4, -2.5, 3}, {4, 0, 3}};
  const auto& q = glb.Node("model")["rotation"];
  const Eigen::Quaterniond rotation(q[3].get<double>(), q[0], q[1], q[2]);
  for (size_t i = 0; i < 3; ++i)
    EXPECT_LT((points[i] - rotation * (at + expected[i])).norm(), 1e-5);
}

TEST(Glb, ColoursSurfacesAndCameras) {
  const Glb glb(Text(FormatGlb, Room()));
  const auto& points =
      glb.json["meshes"][glb.Node("points")["mesh"].get<size_t>()]["primitives"][0];
  EXPECT_EQ(points["mode"], 0);
  const auto colours = glb.Accessor<uint8_t>(points["attributes"]["COLOR_0"].get<size_t>());
  EXPECT_EQ(colours[0], 255);
  EXPECT_EQ(colours[1], 0);
  const auto& wall = glb.json["meshes"][glb.Node("plane_4")["mesh"].get<size_t>()]["primitives"][0];
  EXPECT_EQ(wall["mode"], 4);
  const auto corners = glb.Accessor<uint32_t>(wall["indices"].get<size_t>());
  EXPECT_EQ(corners.size() % 3, 0u);
  EXPECT_EQ(glb.json["materials"][wall["material"].get<size_t>()]["alphaMode"], "BLEND");
  ASSERT_EQ(glb.json["cameras"].size(), 1u);
  const auto& camera = glb.json["cameras"][0]["perspective"];
  EXPECT_NEAR(camera["yfov"], 2.0 * std::atan(240.0 / 400.0), 1e-12);
  EXPECT_NEAR(camera["aspectRatio"], 4.0 / 3.0, 1e-12);
  // glTF's camera looks along its -z: here along the world's +z.
  for (const auto& node : glb.json["nodes"]) {
    if (!node.contains("camera")) continue;
    EXPECT_LT(
        (Glb::Pose(node).linear() * -Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(),
        1e-12);
  }
}

TEST(Glb, AnEmptyModelAndRandomOnesAreWhole) {
  EXPECT_TRUE(Glb(Text(FormatGlb, Reconstruction())).bytes.empty());
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const Reconstruction model = RandomModel(seed, {.extreme_reals = false});
    const Glb glb(Text(FormatGlb, model));
    size_t num_lines = 0;
    for (const auto& mesh : glb.json["meshes"]) {
      const auto& primitive = mesh["primitives"][0];
      if (primitive["mode"] != 1) continue;
      num_lines +=
          glb.Accessor<float>(primitive["attributes"]["POSITION"].get<size_t>()).size() / 6;
    }
    EXPECT_EQ(num_lines, model.lines3D.size());
  }
}

TEST(Obj, HasEachLineInTheObjectOfItsDirection) {
  std::istringstream stream(Text(FormatObj, Room()));
  std::vector<Eigen::Vector3d> vertices;
  std::map<std::string, Lines> lines;
  std::map<std::string, size_t> num_faces;
  std::string row, object;
  while (std::getline(stream, row)) {
    std::istringstream words(row);
    std::string kind;
    words >> kind;
    if (kind == "o") words >> object;
    if (kind == "v") {
      double x, y, z;
      words >> x >> y >> z;
      vertices.emplace_back(x, y, z);
    }
    if (kind == "l") {
      size_t a, b;
      words >> a >> b;
      lines[object].emplace_back(vertices.at(a - 1), vertices.at(b - 1));
    }
    if (kind == "f") {
      size_t corner;
      while (words >> corner) EXPECT_LE(corner, vertices.size());
      ++num_faces[object];
    }
  }
  ASSERT_EQ(lines.size(), 4u);
  ASSERT_EQ(lines["direction_1"].size(), 2u);
  EXPECT_EQ(lines["direction_1"][1].second, Eigen::Vector3d(4, 0, 3));
  EXPECT_EQ(lines["no_direction"].at(0).second, Eigen::Vector3d(1, -2, 2));
  EXPECT_EQ(num_faces["plane_4"], 2u);
}

TEST(Dxf, HasLayersOfDirectionsWithZUp) {
  std::istringstream stream(Text(FormatDxf, Room()));
  std::string code, value;
  std::vector<std::pair<int, std::string>> pairs;
  while (std::getline(stream, code) && std::getline(stream, value))
    pairs.emplace_back(std::stoi(code), value);
  ASSERT_EQ(pairs.back(), std::make_pair(0, std::string("EOF")));
  EXPECT_THAT(pairs, testing::Contains(std::make_pair(1, std::string("AC1009"))));
  std::vector<std::string> layers;
  struct Entity {
    std::string kind, layer;
    std::map<int, double> reals;
  };
  std::vector<Entity> entities;
  std::string kind;
  for (const auto& [number, text] : pairs) {
    if (number == 0) {
      kind = text;
      if (kind == "LINE" || kind == "3DFACE") entities.push_back({kind, "", {}});
    } else if (kind == "LAYER" && number == 2) {
      layers.push_back(text);
    } else if (kind == "LINE" || kind == "3DFACE") {
      if (number == 8) entities.back().layer = text;
      if (number >= 10) entities.back().reals[number] = std::stod(text);
    }
  }
  EXPECT_THAT(layers, testing::ElementsAre("DIRECTION_1", "DIRECTION_2", "DIRECTION_3",
                                           "NO_DIRECTION", "PLANE_4"));
  size_t num_lines = 0;
  for (const Entity& entity : entities) {
    EXPECT_THAT(layers, testing::Contains(entity.layer));
    if (entity.kind != "LINE") continue;
    ++num_lines;
    const Eigen::Vector3d d(entity.reals.at(11) - entity.reals.at(10),
                            entity.reals.at(21) - entity.reals.at(20),
                            entity.reals.at(31) - entity.reals.at(30));
    if (entity.layer == "DIRECTION_1") EXPECT_NEAR(std::abs(d.x()), 4.0, 1e-9);
    if (entity.layer == "DIRECTION_2") EXPECT_NEAR(d.z(), 2.5, 1e-9);  // from the floor upwards
    if (entity.layer == "DIRECTION_3") EXPECT_NEAR(std::abs(d.y()), 3.0, 1e-9);
  }
  EXPECT_EQ(num_lines, 5u);
}

TEST(FloorPlan, ShowsTheRoomFromAboveInItsLengths) {
  const std::string svg = Text(FormatFloorPlan, Room());
  std::smatch match;
  ASSERT_TRUE(std::regex_search(svg, match, std::regex("data-px-per-unit=\"([^\"]+)\"")));
  const double scale = std::stod(match[1]);
  const auto block = [&](const std::string& id) {
    const size_t begin = svg.find("<g id=\"" + id + "\"");
    EXPECT_NE(begin, std::string::npos) << id;
    return svg.substr(begin, svg.find("</g>", begin) - begin);
  };
  const std::regex line("x1=\"([^\"]+)\" y1=\"([^\"]+)\" x2=\"([^\"]+)\" y2=\"([^\"]+)\"");
  const auto lengths = [&](const std::string& text) {
    std::vector<double> result;
    for (std::sregex_iterator it(text.begin(), text.end(), line), end; it != end; ++it) {
      const auto number = [&](int k) { return std::stod((*it)[k]); };
      result.push_back(std::hypot(number(3) - number(1), number(4) - number(2)) / scale);
    }
    return result;
  };
  EXPECT_THAT(lengths(block("direction_1")),
              testing::ElementsAre(testing::DoubleNear(4, 1e-3), testing::DoubleNear(4, 1e-3)));
  EXPECT_THAT(lengths(block("direction_3")), testing::ElementsAre(testing::DoubleNear(3, 1e-3)));
  // Upright lines are dots.
  EXPECT_TRUE(lengths(block("direction_2")).empty());
  EXPECT_NE(block("direction_2").find("<circle"), std::string::npos);
  // The wall is a trace of 3 units.
  EXPECT_THAT(lengths(block("planes")), testing::ElementsAre(testing::DoubleNear(3, 0.05)));
  EXPECT_THAT(lengths(block("bar")), testing::ElementsAre(testing::DoubleNear(1, 1e-3)));
  EXPECT_NE(block("cameras").find("<path"), std::string::npos);
}

TEST(FloorPlan, EmptyAndRandomModelsGivePapers) {
  EXPECT_NE(Text(FormatFloorPlan, Reconstruction()).find("</svg>"), std::string::npos);
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const std::string svg = Text(FormatFloorPlan, RandomModel(seed));
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("inf"), std::string::npos);
  }
}

TEST(LineLayers, EachLineIsInOne) {
  const Reconstruction model = RandomModel(2, {.extreme_reals = false});
  std::multiset<line3D_t> ids;
  for (const LineLayer& layer : LineLayers(model))
    ids.insert(layer.line3D_ids.begin(), layer.line3D_ids.end());
  EXPECT_EQ(ids.size(), model.lines3D.size());
  for (const auto& [id, line] : model.lines3D) EXPECT_EQ(ids.count(id), 1u);
}

}  // namespace
}  // namespace holba
