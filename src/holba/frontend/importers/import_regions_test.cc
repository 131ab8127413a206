// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/import_regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/frontend/importers/import_testing.h"

namespace holba {
namespace {

using testing::HasSubstr;

// Label 1 left, 2 right; 50 x 40 for images of 100 x 80.
std::string TwoHalves() {
  return LabelPng(50, 40, [](int x, int) { return x < 25 ? 1 : 2; });
}

std::string FlatNormals(float x, float z) {
  std::vector<float> values;
  for (int i = 0; i < 40 * 50; ++i) {
    for (const float value : {x, 0.0f, z}) values.push_back(value);
  }
  return Npy("<f4", "(40, 50, 3)", values);
}

TEST(ImportRegions, FillsMapsAndNormalsOfTheImagesThatHaveThem) {
  const TestFolder folder;
  folder.Write("labels/dir/a.png", TwoHalves());
  folder.Write("labels/b.jpg.png", TwoHalves());
  folder.Write("labels/labels.json", R"({"labels": {"1": "plane", "2": "sphere"}})");
  folder.Write("normals/b.npy", FlatNormals(0.0f, -1.0f));
  // z = 2 everywhere: a plane that faces the camera; b has normals already.
  folder.Write("depth/dir/a.npy", Npy("<f4", "(40, 50)", std::vector<float>(2000, 2.0f)));
  folder.Write("depth/b.npy", Npy("<f4", "(7,)", std::vector<float>(7)));
  const RegionImportPaths paths{folder.path() / "labels", folder.path() / "normals",
                                folder.path() / "depth"};
  RegionNormalOptions options;
  options.window_px = 48;  // 3 pixels of so small a map
  for (const int num_threads : {1, 4}) {
    ImageFeatureMap features;
    features[2].segments.resize(5);
    RegionImportReport report;
    ImportRegions(paths, SmallImportModel(), options, num_threads, &features, &report);
    ASSERT_EQ(features.size(), 2u);
    EXPECT_EQ(features.at(2).segments.size(), 5u) << "what was there stays";
    EXPECT_EQ(report.num_maps, 2u);
    EXPECT_EQ(report.num_images_without, 1u);
    EXPECT_EQ(report.num_regions, 4u);
    EXPECT_EQ(report.num_normals, 2u);
    for (const image_t id : {1, 2}) {
      EXPECT_EQ(features.at(id).label_map.width, 50);
      ASSERT_EQ(features.at(id).normals.size(), 1u) << "a sphere has none";
      EXPECT_LT((features.at(id).normals.at(1).normal_in_cam - Eigen::Vector3d(0, 0, -1)).norm(),
                1e-6);
    }
  }
}

TEST(ImportRegions, MapsUnderOtherNamesAreFoundByTheEndsOfTheirPaths) {
  const TestFolder folder;
  folder.Write("labels.json", R"({"labels": {"1": "plane"}})");
  folder.Write("A.png", LabelPng(100, 80, [](int, int) { return 1; }));       // dir/a.jpg
  folder.Write("set/b.png", LabelPng(100, 80, [](int, int) { return 1; }));   // b.jpg
  folder.Write("c.jpg.png", LabelPng(100, 80, [](int, int) { return 1; }));   // c.jpg itself
  folder.Write("else/c.png", LabelPng(100, 80, [](int, int) { return 1; }));  // of nobody
  ImageFeatureMap features;
  RegionImportReport report;
  ImportRegions({folder.path(), {}, {}}, SmallImportModel(), {}, 2, &features, &report);
  EXPECT_EQ(report.num_maps, 3u);
  EXPECT_EQ(report.num_images_without, 0u);
}

TEST(ImportRegions, BadFoldersAndMapsAreRefusedWithTheReason) {
  const TestFolder folder;
  const auto message = [&](const RegionImportPaths& paths) {
    ImageFeatureMap features;
    RegionImportReport report;
    return MessageOf([&] { ImportRegions(paths, SmallImportModel(), {}, 2, &features, &report); });
  };
  EXPECT_EQ(message({}), "");
  EXPECT_THAT(message({folder.path() / "none", {}, {}}), HasSubstr("there is no such folder"));
  EXPECT_THAT(message({folder.path(), {}, {}}),
              HasSubstr("expected label maps named as the images of the model, for example "
                        "'dir/a.jpg.png', found none"));
  folder.Write("labels.json", R"({"labels": {"1": "plane"}})");
  folder.Write("b.png", LabelPng(40, 50, [](int, int) { return 1; }));
  EXPECT_THAT(message({folder.path(), {}, {}}),
              HasSubstr("the map of 'b.jpg' is 40 x 50 pixels, the image 100 x 80; it must cover"));
}

}  // namespace
}  // namespace holba
