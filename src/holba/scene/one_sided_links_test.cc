// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/one_sided_links.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/scene/random_model.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::Pair;

// Three images of three points and a line each; point i is feature i of every image.
Reconstruction Scene() {
  Reconstruction model;
  model.cameras.Add(
      1,
      {.model = FindCameraModel("SIMPLE_PINHOLE"), .width = 8, .height = 8, .params = {8, 4, 4}});
  for (image_t image_id = 1; image_id <= 3; ++image_id) {
    Image image;
    image.name = std::to_string(image_id);
    image.camera_id = 1;
    for (point3D_t id = 1; id <= 3; ++id) {
      image.points2D.push_back({{1.0, 2.0}, id});
      model.points3D.Add(id, {});
      model.points3D.at(id).track.push_back({image_id, static_cast<point2D_t>(id - 1)});
    }
    image.lines2D.push_back({{{0, 0}, {1, 1}}, 7});
    model.images.Add(image_id, image);
  }
  Line3D line;
  line.line.direction = Eigen::Vector3d::UnitX();
  line.line.moment = Eigen::Vector3d::Zero();
  for (image_t image_id = 1; image_id <= 3; ++image_id) line.track.push_back({image_id, 0});
  model.lines3D.Add(7, line);
  model.AddTrivialRigsAndFrames();
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  return model;
}

TEST(DropOneSidedLinks, LeavesASoundModelAsItIs) {
  Reconstruction model = Scene();
  const OneSidedLinks found = DropOneSidedLinks(true, &model);
  EXPECT_TRUE(found.empty());
  EXPECT_EQ(found.num_sound, 12u);
  Reconstruction random = RandomModel(3, {});
  EXPECT_TRUE(DropOneSidedLinks(true, &random).empty());
}

TEST(DropOneSidedLinks, TakesALinkOutOfTheEndThatKnowsIt) {
  Reconstruction model = Scene();
  model.points3D.at(1).track.push_back({9, 0});       // no such image
  model.points3D.at(1).track.push_back({1, 0});       // again
  model.images.at(2).points2D[0].point3D_id = kNoId;  // a free point
  model.points3D.at(2).track.pop_back();              // image 3 still names the point
  model.images.at(3).points2D[2].point3D_id = 99;     // no such point, and not point 3
  model.lines3D.at(7).track.push_back({1, 5});        // no such segment
  const OneSidedLinks found = DropOneSidedLinks(true, &model);
  EXPECT_THAT(found.dropped,
              ElementsAre(Pair("2D features that name a 3D feature that does not name them", 1),
                          Pair("2D features that name a missing 3D feature", 1),
                          Pair("3D features that name a 2D feature that does not name them", 3),
                          Pair("3D features that name a 2D feature twice", 1),
                          Pair("3D features that name a missing image", 1)));
  EXPECT_EQ(found.NumDropped(), 7u);
  EXPECT_EQ(found.num_corrected, 0u);
  EXPECT_THAT(found.list,
              ElementsAre("3D point 1 names point 0 of image 2, which names no 3D point",
                          "3D point 1 names point 0 of image 9, which is not in the model",
                          "3D point 1 names point 0 of image 1 twice",
                          "3D point 3 names point 2 of image 3, which names 3D point 99",
                          "point 1 of image 3 names 3D point 2, which does not name it back",
                          "point 2 of image 3 names 3D point 99, which is not in the model",
                          "3D line 7 names line 5 of image 1, which has 1 of them"));
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(model.points3D.at(1).track.size(), 2u);
  EXPECT_EQ(model.points3D.at(2).track.size(), 2u);
  EXPECT_EQ(model.points3D.at(3).track.size(), 2u);
  EXPECT_EQ(model.lines3D.at(7).track.size(), 3u);
}

TEST(DropOneSidedLinks, CorrectsAnIndexWhereOneFeatureOfTheImageNamesThePoint) {
  Reconstruction model = Scene();
  const Reconstruction sound = model;
  // As an exporter does that writes 0 for every index.
  for (auto& [id, point] : model.points3D) {
    for (PointObservation& observation : point.track) observation.point2D_idx = 0;
  }
  const OneSidedLinks found = DropOneSidedLinks(false, &model);
  EXPECT_EQ(found.num_corrected, 6u);
  EXPECT_EQ(found.NumDropped(), 0u);
  EXPECT_TRUE(found.list.empty());
  for (const auto& [id, point] : sound.points3D)
    EXPECT_EQ(model.points3D.at(id).track, point.track);

  // Two that name the point: which one is meant is not known.
  model.points3D.at(2).track[0].point2D_idx = 0;
  model.images.at(1).points2D.push_back({{3.0, 4.0}, 2});
  EXPECT_EQ(DropOneSidedLinks(false, &model).NumDropped(), 3u);
  EXPECT_EQ(model.points3D.at(2).track.size(), 2u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
}

}  // namespace
}  // namespace holba
