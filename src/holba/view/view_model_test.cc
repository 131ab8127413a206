// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/view_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "holba/scene/random_model.h"
#include "holba/view/view_page.h"
#include "holba/view/view_testing.h"
#include "holba/view/viewer_page.h"

namespace holba {
namespace {

TEST(ViewModel, HoldsEveryPointAndLineWithWhatSeesThem) {
  const Reconstruction model = RandomModel(3, {.extreme_reals = false});
  const ReadBundle read(MakeViewModel(model, {.title = "t", .report = "r"}).bytes);
  const Eigen::Vector3d origin(read.meta["origin"][0], read.meta["origin"][1],
                               read.meta["origin"][2]);
  const auto xyz = read.Get<float>("point_xyz");
  const auto lengths = read.Get<uint32_t>("point_obs_length");
  const auto images = read.Get<uint16_t>("point_obs_image");
  const auto rgb = read.Get<uint8_t>("point_rgb");
  const auto steps = read.Get<uint32_t>("point_id_steps");
  const auto high = read.Get<uint32_t>("point_id_high");
  ASSERT_EQ(lengths.size(), model.points3D.size());
  size_t i = 0, k = 0;
  uint32_t low = 0;
  for (const auto& [id, point] : model.points3D) {
    low += steps[i];
    EXPECT_EQ(uint64_t{high[i]} << 32 | low, id);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(xyz[3 * i + c] + origin[c], point.xyz[c], 1e-5 * (1.0 + point.xyz.norm()));
      EXPECT_EQ(rgb[3 * i + c], point.rgb[c]);
    }
    ASSERT_EQ(lengths[i], point.track.size());
    for (const PointObservation& observation : point.track) {
      EXPECT_EQ(read.meta["images"][images[k]]["id"], observation.image_id);
      ++k;
    }
    ++i;
  }
  EXPECT_EQ(k, images.size());
  const auto ends = read.Get<float>("line_ends");
  ASSERT_EQ(ends.size(), 6 * model.lines3D.size());
  i = 0;
  for (const auto& [id, line] : model.lines3D) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(ends[6 * i + c] + origin[c], line.start[c], 1e-5 * (1.0 + line.start.norm()));
      EXPECT_NEAR(ends[6 * i + 3 + c] + origin[c], line.end[c], 1e-5 * (1.0 + line.end.norm()));
    }
    ++i;
  }
  ASSERT_EQ(read.meta["groups"].size(), model.groups3D.size());
  EXPECT_EQ(read.Get<uint32_t>("wireframe").size(), 3 * model.wireframe.size());
  EXPECT_EQ(read.meta["relations"].size(), model.relations.size());
}

// A point one unit beside the axis at depth 4 in a camera of focal length 400, seen 3 px too far
// right and 4 px too low.
Reconstruction OnePoint() {
  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel("PINHOLE"), 640, 480, {400, 400, 320, 240}});
  for (const image_t id : {1u, 2u}) {
    model.images.Add(id, {.name = std::to_string(id), .camera_id = 1});
    model.images.at(id).cam_from_world.translation = Eigen::Vector3d(id == 1 ? 0.0 : -1.0, 0, 0);
  }
  model.AddTrivialRigsAndFrames();
  model.images.at(1).points2D.push_back({{423.0, 244.0}, 7});
  model.images.at(2).points2D.push_back({{320.0, 240.0}, 7});
  Point3D point;
  point.xyz = {1.0, 0.0, 4.0};
  point.track = {{1, 0}, {2, 0}};
  model.points3D.Add(7, point);
  return model;
}

TEST(ViewModel, ErrorsAndPositionsAreThoseOfTheObservations) {
  const ReadBundle read(MakeViewModel(OnePoint(), {}).bytes);
  EXPECT_THAT(
      read.GetHalves("point_obs_error"),
      testing::ElementsAre(testing::FloatNear(5.0f, 5e-3f), testing::FloatNear(0.0f, 1e-3f)));
  const auto positions = read.Get<uint16_t>("point_obs_position");
  ASSERT_EQ(positions.size(), 4u);
  const auto pixel = [](uint16_t stored) { return (stored / 65535.0 * 1.25 - 0.125) * 640.0; };
  EXPECT_NEAR(pixel(positions[0]), 423.0, 0.01);
  EXPECT_NEAR(pixel(positions[1]), 244.0, 0.01);
}

TEST(ViewModel, WithoutPositionsItKeepsTheErrors) {
  const ViewModel view = MakeViewModel(OnePoint(), {.max_num_bytes = 10});
  EXPECT_FALSE(view.has_observed_positions);
  const ReadBundle read(view.bytes);
  EXPECT_FALSE(read.arrays.contains("point_obs_position"));
  EXPECT_EQ(read.GetHalves("point_obs_error").size(), 2u);
}

TEST(ViewModel, IsFiniteOfModelsThatAreNot) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const ReadBundle read(MakeViewModel(RandomModel(seed), {}).bytes);
    for (const std::string name : {"point_xyz", "line_ends", "image_centre", "camera_rays"}) {
      for (const float value : read.Get<float>(name)) ASSERT_TRUE(std::isfinite(value)) << name;
    }
  }
  const ReadBundle empty(MakeViewModel(Reconstruction(), {}).bytes);
  EXPECT_TRUE(empty.Get<float>("point_xyz").empty());
}

TEST(ViewModel, IsTheSameForAnyNumberOfThreads) {
  const Reconstruction model = RandomModel(4, {.extreme_reals = false});
  EXPECT_EQ(MakeViewModel(model, {.num_threads = 1}).bytes,
            MakeViewModel(model, {.num_threads = 7}).bytes);
}

TEST(ViewPage, GivesTheModelBackAndNoNameIsAPartOfIt) {
  Reconstruction model = OnePoint();
  const std::string hostile = "</script><script>alert('1')</script>\"&\xff<!--";
  model.images.at(1).name = hostile;
  const std::string bytes =
      MakeViewModel(model, {.title = hostile, .report = hostile + "\n<b>"}).bytes;
  std::ostringstream stream;
  FormatViewPage({.model = bytes, .photographs = {{1, "\xff\xd8 jpeg </script>"}}}, &stream);
  const std::string page = stream.str();
  EXPECT_EQ(page.find("alert('1')"), std::string::npos);
  EXPECT_EQ(page.find(kDataPlace), std::string::npos);
  const auto block = [&](const std::string& id) {
    const std::string begin = "<script type=\"application/octet-stream\" id=\"holba-" + id + "\">";
    const size_t at = page.find(begin) + begin.size();
    return FromBase64(page.substr(at, page.find("</script>", at) - at));
  };
  EXPECT_EQ(Inflated(block("model")), bytes);
  EXPECT_EQ(block("photograph-1"), "\xff\xd8 jpeg </script>");
  EXPECT_EQ(ReadBundle(bytes).meta["images"][0]["name"].get<std::string>().substr(0, 9),
            "</script>");
}

TEST(ViewerPage, IsAsciiWithOnePlaceForData) {
  const std::string_view page = ViewerPage();
  for (const char c : page) ASSERT_TRUE(static_cast<unsigned char>(c) < 0x80);
  const size_t place = page.find(kDataPlace);
  ASSERT_NE(place, std::string_view::npos);
  EXPECT_EQ(page.find(kDataPlace, place + 1), std::string_view::npos);
  // It needs nothing from elsewhere.
  for (const std::string_view attribute : {"src=\"http", "href=\"http", "@import", "url(http"})
    EXPECT_EQ(page.find(attribute), std::string_view::npos) << attribute;
}

}  // namespace
}  // namespace holba
