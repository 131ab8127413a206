// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/dense_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/random.h"
#include "holba/frontend/importers/import_dense_maps.h"
#include "holba/frontend/importers/import_testing.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

using namespace std::string_literals;
using testing::ElementsAre;
using testing::HasSubstr;

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegPerRad;
}

Camera TestCamera(const char* model, std::vector<double> params) {
  Camera camera;
  camera.model = FindCameraModel(model);
  camera.width = 800;
  camera.height = 600;
  camera.params = std::move(params);
  return camera;
}

LabelMap OnePlane(int width, int height) {
  LabelMap map;
  map.width = width;
  map.height = height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      map.labels.push_back(x > width / 5 && x < width * 4 / 5 ? 3 : 0);
  }
  map.types[3] = FindGroupType("PLANE");
  return map;
}

// Depth of the plane n.X + w = 0 at each pixel of a map of this size; fails the test where a ray
// is missing.
DepthMap DepthOfPlane(const Camera& camera, int width, int height, const Eigen::Vector3d& n,
                      double w, bool along_ray) {
  DepthMap map{width, height, {}, along_ray};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d pixel((x + 0.5) * 800.0 / width, (y + 0.5) * 600.0 / height);
      const auto ray = camera.model->unproject(camera.params.data(), pixel);
      EXPECT_TRUE(ray);
      const double length = -w / n.dot(*ray);
      map.depth.push_back(static_cast<float>(along_ray ? length : length * ray->z()));
    }
  }
  return map;
}

TEST(NormalsOfRegions, DepthsOfAPlaneGiveItsNormalTowardsTheCamera) {
  const Eigen::Vector3d n = Eigen::Vector3d(0.3, -0.5, -1.0).normalized();
  for (const Camera& camera : {TestCamera("PINHOLE", {700, 710, 400, 300}),
                               TestCamera("SIMPLE_RADIAL", {700, 400, 300, -0.15})}) {
    for (const bool along_ray : {false, true}) {
      const DepthMap depths = DepthOfPlane(camera, 320, 240, n, 4.0, along_ray);
      std::map<std::string, size_t> dropped;
      const auto normals = NormalsOfRegions(OnePlane(160, 120), depths, camera, {}, &dropped);
      ASSERT_EQ(normals.size(), 1u);
      EXPECT_LT(AngleDeg(normals.at(3).normal_in_cam, n), 0.02);
      EXPECT_EQ(normals.at(3).sigma_deg, RegionNormalOptions().min_sigma_deg);
      EXPECT_TRUE(dropped.empty());
    }
  }
}

TEST(NormalsOfRegions, TheScaleOfDepthsDoesNotMatter) {
  const Camera camera = TestCamera("PINHOLE", {700, 700, 400, 300});
  const Eigen::Vector3d n = Eigen::Vector3d(-0.2, 0.1, -1.0).normalized();
  DepthMap depths = DepthOfPlane(camera, 320, 240, n, 4.0, false);
  for (float& depth : depths.depth) depth *= 1000.0f;
  std::map<std::string, size_t> dropped;
  const auto normals = NormalsOfRegions(OnePlane(320, 240), depths, camera, {}, &dropped);
  EXPECT_LT(AngleDeg(normals.at(3).normal_in_cam, n), 0.02);
}

// A network's map of normals: of either side, with noise and wrong ones.
NormalMap NoisyNormals(const Eigen::Vector3d& n, double sigma_deg, double share_wrong,
                       Random* random) {
  NormalMap map{200, 150, {}};
  for (int i = 0; i < 200 * 150; ++i) {
    Eigen::Vector3d v =
        n + sigma_deg / kDegPerRad * Eigen::Vector3d(random->Normal(), random->Normal(), 0.0);
    if (random->Uniform() < share_wrong) v = Eigen::Vector3d(1.0, 0.2, -0.3);
    if (random->Uniform() < 0.1) v.setZero();  // unknown
    map.normals_in_cam.push_back((random->Uniform(0.5, 2.0) * v).cast<float>());
  }
  return map;
}

TEST(NormalsOfRegions, TheMeanIsRobustAndTheSpreadIsThatOfTheNoise) {
  const Camera camera = TestCamera("PINHOLE", {700, 700, 400, 300});
  Random random(7);
  const Eigen::Vector3d n(0.0, 0.0, -1.0);
  std::map<std::string, size_t> dropped;
  const auto clean = NormalsOfRegions(OnePlane(200, 150), NoisyNormals(n, 5.0, 0.0, &random),
                                      camera, {}, &dropped);
  EXPECT_LT(AngleDeg(clean.at(3).normal_in_cam, n), 0.2);
  EXPECT_NEAR(clean.at(3).sigma_deg, 5.0, 0.15);
  // The share of wrong ones cannot pull it far.
  const auto some = NormalsOfRegions(OnePlane(200, 150), NoisyNormals(n, 5.0, 0.2, &random), camera,
                                     {}, &dropped);
  EXPECT_LT(AngleDeg(some.at(3).normal_in_cam, n), 2.5);
  EXPECT_TRUE(dropped.empty());
  // Half of them are wrong: no mean of the region.
  EXPECT_TRUE(
      NormalsOfRegions(OnePlane(200, 150), NoisyNormals(n, 5.0, 0.5, &random), camera, {}, &dropped)
          .empty());
  EXPECT_EQ(dropped.at("the normals of the region disagree"), 1u);
}

TEST(NormalsOfRegions, TheSideOfANormalIsTheCameras) {
  const Camera camera = TestCamera("PINHOLE", {700, 700, 400, 300});
  Random random(8);
  std::map<std::string, size_t> dropped;
  const auto normals = NormalsOfRegions(
      OnePlane(200, 150), NoisyNormals({0, 0, 1}, 1.0, 0.0, &random), camera, {}, &dropped);
  EXPECT_LT(AngleDeg(normals.at(3).normal_in_cam, {0, 0, -1}), 0.2);
}

TEST(NormalsOfRegions, OnlyPlanesWithEnoughPixelsHaveOne) {
  const Camera camera = TestCamera("PINHOLE", {700, 700, 400, 300});
  Random random(9);
  const NormalMap normals = NoisyNormals({0, 0, 1}, 1.0, 0.0, &random);
  std::map<std::string, size_t> dropped;
  LabelMap map = OnePlane(200, 150);
  map.types[3] = FindGroupType("SPHERE");
  EXPECT_TRUE(NormalsOfRegions(map, normals, camera, {}, &dropped).empty());
  EXPECT_TRUE(dropped.empty());
  map.types[3] = FindGroupType("PLANE");
  map.labels.assign(map.labels.size(), 0);
  map.labels[5000] = map.labels[5001] = 3;
  EXPECT_TRUE(NormalsOfRegions(map, normals, camera, {}, &dropped).empty());
  EXPECT_EQ(dropped.at("too few pixels with a normal"), 1u);
}

TEST(DepthFiles, EveryFormGivesTheSame) {
  const TestFolder folder;
  const std::vector<float> values = {1, 2, 3, 4, 5, 6};
  const auto check = [&](const std::string& name, const std::string& bytes,
                         const DepthFormat& format = {}) {
    const DepthMap map = ReadDepthMap(folder.Write(name, bytes), format);
    EXPECT_EQ(map.width, 3) << name;
    EXPECT_EQ(map.height, 2) << name;
    EXPECT_THAT(map.depth, testing::Pointwise(testing::FloatEq(), values)) << name;
  };
  check("a.npy", Npy("<f4", "(2, 3)", values));
  check("b.npy", Npy("<f4", "(1, 2, 3, )", values));
  check("c.npy", Npy("<f4", "(2, 3, 1)", values));
  check("d.npz", Zip({{"depth.npy", Npy("<f4", "(2, 3)", values)},
                      {"mask.npy", Npy("<f4", "(2, 3)", values)}}));
  check("e.npz", Zip({{"anything.npy", Npy("<f4", "(2, 3)", values)}}));
  std::string colmap = "3&2&1&";
  colmap.append(reinterpret_cast<const char*>(values.data()), 24);
  check("f.geometric.bin", colmap);
  // Thousandths, by itself.
  check("g.png", Png(3, 2, 16, 0, {"\x03\xe8\x07\xd0\x0b\xb8"s, "\x0f\xa0\x13\x88\x17\x70"s}));
  const DepthFormat format = ParseDepthFormat(R"({"scale": 0.5, "along": "ray"})", "depth.json");
  EXPECT_TRUE(format.along_ray);
  check("h.png", Png(3, 2, 16, 0, {"\0\2\0\4\0\6"s, "\0\x08\0\x0a\0\x0c"s}), format);
}

TEST(NormalFiles, EveryFormGivesTheSame) {
  const TestFolder folder;
  // Two pixels: x, then -z.
  const auto check = [&](const std::string& name, const std::string& bytes,
                         const NormalFormat& format = {}) {
    const NormalMap map = ReadNormalMap(folder.Write(name, bytes), format);
    ASSERT_EQ(map.normals_in_cam.size(), 2u) << name;
    EXPECT_EQ(map.width, 2) << name;
    EXPECT_LT((map.normals_in_cam[0] - Eigen::Vector3f(1, 0, 0)).norm(), 0.01) << name;
    EXPECT_LT((map.normals_in_cam[1] - Eigen::Vector3f(0, 0, -1)).norm(), 0.01) << name;
  };
  check("a.npy", Npy("<f4", "(1, 2, 3)", std::vector<float>{1, 0, 0, 0, 0, -1}));
  check("b.npy", Npy("<f4", "(3, 1, 2)", std::vector<float>{1, 0, 0, 0, 0, -1}));
  check("c.npz",
        Zip({{"normals.npy", Npy("<f4", "(1, 2, 3)", std::vector<float>{1, 0, 0, 0, 0, -1})}}));
  const std::vector<float> planes = {1, 0, 0, 0, 0, -1};
  std::string colmap = "2&1&3&";
  colmap.append(reinterpret_cast<const char*>(planes.data()), 24);
  check("d.bin", colmap);
  check("e.png", Png(2, 1, 8, 2, {"\xff\x80\x80\x80\x80\x00"s}));
  check("f.png", Png(2, 1, 16, 2, {"\xff\xff\x80\x00\x80\x00\x80\x00\x80\x00\x00\x00"s}));
  // y up and z towards the camera, as in OpenGL, with the axes exchanged for good measure.
  const NormalFormat format = ParseNormalFormat(R"({"axes": ["-z", "+x", "-y"]})", "n.json");
  check("g.npy", Npy("<f4", "(1, 2, 3)", std::vector<float>{0, 1, 0, 1, 0, 0}), format);
}

TEST(DenseMapFiles, BadOnesAreRefusedWithTheReason) {
  const TestFolder folder;
  const std::vector<float> six(6, 1.0f);
  const auto depth = [&](const std::string& name, const std::string& bytes) {
    const auto path = folder.Write(name, bytes);
    return MessageOf([&] { ReadDepthMap(path, {}); });
  };
  const auto normals = [&](const std::string& name, const std::string& bytes) {
    const auto path = folder.Write(name, bytes);
    return MessageOf([&] { ReadNormalMap(path, {}); });
  };
  EXPECT_THAT(depth("a.npy", Npy("<f4", "(6,)", six)),
              HasSubstr("expected a depth map of shape (H, W), found (6,) float32"));
  EXPECT_THAT(
      depth("a.npz", Zip({{"x.npy", Npy("<f4", "(6,)", six)}, {"y.npy", Npy("<f4", "(6,)", six)}})),
      HasSubstr("expected one array, or one named 'depth', found 2"));
  EXPECT_THAT(depth("a.png", LabelPng(2, 2, [](int, int) { return 1; })),
              HasSubstr("expected a PNG of 16-bit grey as depth map, found 1 channels of 8 bits"));
  EXPECT_THAT(depth("a.bin", "2&1&"), HasSubstr("at byte 4: expected WIDTH&HEIGHT&CHANNELS&"));
  EXPECT_THAT(depth("a.bin", "2&1&1&abcd"),
              HasSubstr("expected 8 bytes of numbers for 2 x 1 pixels and 1 channels, found 4"));
  EXPECT_THAT(depth("a.bin", "2&-1&1&abcd"), HasSubstr("expected WIDTH&HEIGHT&CHANNELS&"));
  EXPECT_THAT(depth("a.bin", "1048576&1048576&16&abcd"), HasSubstr("truncated or damaged"));
  EXPECT_THAT(depth("a.bin", "1&1&2&abcdabcd"),
              HasSubstr("expected 1 channel of a depth map, found 2"));
  EXPECT_THAT(normals("a.npy", Npy("<f4", "(2, 3)", six)),
              HasSubstr("expected a normal map of shape (H, W, 3) or (3, H, W), found (2, 3)"));
  EXPECT_THAT(normals("a.png", LabelPng(2, 2, [](int, int) { return 1; })),
              HasSubstr("expected a PNG of RGB as normal map, found 1 channels"));
  EXPECT_THAT(normals("a.bin", "1&1&1&abcd"),
              HasSubstr("expected 3 channels of a normal map, found 1"));
  const auto format = [](const std::string& json) {
    return MessageOf([&] { ParseNormalFormat(json, "normals.json"); });
  };
  EXPECT_THAT(format(R"({"axes": ["x", "y", "y"]})"), HasSubstr("each of x, y, z once"));
  EXPECT_THAT(format(R"({"axes": ["x", "y"]})"), HasSubstr("each of x, y, z once"));
  EXPECT_THAT(format("[]"), HasSubstr("expected an object like"));
  EXPECT_THAT(MessageOf([&] { ParseDepthFormat(R"({"scale": -1})", "depth.json"); }),
              HasSubstr("'scale' is not known or has a wrong value"));
  EXPECT_THAT(MessageOf([&] { ParseDepthFormat(R"({"unit": 1})", "depth.json"); }),
              HasSubstr("'unit' is not known"));
}

TEST(DenseMapFiles, AnImagesMapIsFoundWithItsFoldersFormat) {
  const TestFolder folder;
  folder.Write("dir/a.jpg.geometric.bin", std::string("1&1&1&") + "\0\0\x80\x3f"s);
  folder.Write("b.npy", Npy("<f4", "(1, 1, 3)", std::vector<float>{0, 1, 0}));
  folder.Write("depth.json", R"({"scale": 0.5})");
  folder.Write("normals.json", R"({"axes": ["x", "-y", "-z"]})");
  const auto depth = FindDepthMap(folder.path(), "dir/a.jpg");
  ASSERT_TRUE(depth);
  EXPECT_THAT(depth->depth, ElementsAre(0.5f));
  const auto normals = FindNormalMap(folder.path(), "b.jpg");
  ASSERT_TRUE(normals);
  EXPECT_EQ(normals->normals_in_cam[0], Eigen::Vector3f(0, -1, 0));
  EXPECT_FALSE(FindDepthMap(folder.path(), "c.jpg"));
}

}  // namespace
}  // namespace holba
