// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "holba/scene/main_directions.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

constexpr int kWidth = 640, kHeight = 480;  // a diagonal of 800

ColourImage Photograph(int width, int height, uint8_t grey) {
  return {width, height, std::vector<uint8_t>(size_t{3} * width * height, grey)};
}

Rgb Pixel(const ColourImage& image, int x, int y) {
  const uint8_t* p = &image.pixels[3 * (size_t(y) * image.width + x)];
  return {p[0], p[1], p[2]};
}

int Difference(const Rgb& a, const Rgb& b) {
  int most = 0;
  for (int k = 0; k < 3; ++k) most = std::max(most, std::abs(int(a[k]) - int(b[k])));
  return most;
}

bool IsGrey(const Rgb& rgb) { return rgb[0] == rgb[1] && rgb[1] == rgb[2]; }

// Mean position and number of the pixels of about this colour.
std::pair<Eigen::Vector2d, int> Find(const ColourImage& image, const Rgb& colour) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int num = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (Difference(Pixel(image, x, y), colour) > 40) continue;
      sum += Eigen::Vector2d(x + 0.5, y + 0.5);
      ++num;
    }
  }
  return {num > 0 ? Eigen::Vector2d(sum / num) : sum, num};
}

// One camera at the origin that looks along +z.
Reconstruction OneCamera() {
  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel("PINHOLE"), kWidth, kHeight, {500, 500, 320, 240}});
  model.images.Add(1, {.name = "1.jpg", .camera_id = 1});
  return model;
}

void AddVp(group3D_t id, const Eigen::Vector3d& direction, const std::vector<line3D_t>& lines,
           Reconstruction* model) {
  Group3D group;
  group.type = FindGroupType("VP");
  group.params = {direction.x(), direction.y(), direction.z()};
  group.line3D_ids = lines;
  model->groups3D.Add(id, group);
}

void AddLine(line3D_t id, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
             const LineSegment2d& segment, Reconstruction* model) {
  Line3D line;
  line.line = PlueckerLine::FromPoints(start, end);
  line.start = start;
  line.end = end;
  model->lines3D.Add(id, line);
  model->images.at(1).lines2D.push_back({segment, id});
}

void AddPoint(point3D_t id, const Eigen::Vector3d& xyz, const Eigen::Vector2d& xy,
              Reconstruction* model) {
  model->points3D.Add(id, {.xyz = xyz});
  model->images.at(1).points2D.push_back({xy, id});
}

// Line 1 of VP 10, line 2 of VP 11, line 3 of none, and a segment without line.
Reconstruction ModelWithLines() {
  Reconstruction model = OneCamera();
  AddLine(1, {-3, 0, 5}, {-2, 0, 5}, {{20, 100}, {120, 100}}, &model);
  AddLine(2, {2, 0, 5}, {2, 0, 7}, {{20, 200}, {120, 200}}, &model);
  AddLine(3, {0, 1, 5}, {0, 1, 6}, {{20, 300}, {120, 300}}, &model);
  model.images.at(1).lines2D.push_back({{{20, 400}, {120, 400}}, kNoId});
  AddVp(10, Eigen::Vector3d::UnitX(), {1}, &model);
  AddVp(11, Eigen::Vector3d::UnitZ(), {2}, &model);
  return model;
}

TEST(Pictures, OfAnImageWithoutStructureAreThePalePhotograph) {
  const Reconstruction model = OneCamera();
  ColourImage photograph = Photograph(kWidth, kHeight, 120);
  photograph.pixels[3 * (10 * kWidth + 20)] = 0;
  for (const auto draw : {DrawSegments, DrawGroups, DrawWireframe}) {
    const ColourImage picture = draw(model, 1, photograph);
    ASSERT_EQ(picture.width, kWidth);
    ASSERT_EQ(picture.height, kHeight);
    ASSERT_EQ(picture.pixels.size(), photograph.pixels.size());
    EXPECT_EQ(Pixel(picture, 0, 0), (Rgb{165, 165, 165}));
    EXPECT_EQ(Pixel(picture, kWidth - 1, kHeight - 1), (Rgb{165, 165, 165}));
    EXPECT_FALSE(IsGrey(Pixel(picture, 20, 10)));
  }
}

TEST(Pictures, GiveNeighbouringGroupsDifferentColours) {
  Reconstruction model;
  std::set<Rgb> of_vps, of_others;
  for (group3D_t id = 1; id <= 24; ++id) AddVp(id, Eigen::Vector3d::UnitX(), {}, &model);
  for (group3D_t id = 101; id <= 124; ++id) {
    Group3D plane;
    plane.type = FindGroupType("PLANE");
    plane.params = {0, 0, 1, 0};
    model.groups3D.Add(id, plane);
  }
  for (group3D_t id = 1; id <= 24; ++id) {
    of_vps.insert(GroupColour(model, id));
    EXPECT_EQ(GroupColour(model, 100 + id), GroupColour(model, id));
  }
  EXPECT_EQ(of_vps.size(), 24u);
}

TEST(Pictures, ShowSegmentsInTheColourOfTheirVanishingPoint) {
  const Reconstruction model = ModelWithLines();
  const ColourImage picture = DrawSegments(model, 1, Photograph(kWidth, kHeight, 200));
  const Rgb pale = Pixel(picture, 500, 400);
  // The pixels whose centres are half a pixel above and below the segments.
  EXPECT_LT(Difference(Pixel(picture, 70, 99), GroupColour(model, 10)), 60);
  EXPECT_LT(Difference(Pixel(picture, 70, 200), GroupColour(model, 11)), 60);
  EXPECT_TRUE(IsGrey(Pixel(picture, 70, 300)));
  EXPECT_TRUE(IsGrey(Pixel(picture, 70, 400)));
  const int grey = Pixel(picture, 70, 300)[0], faint = Pixel(picture, 70, 400)[0];
  EXPECT_LT(grey, faint);
  EXPECT_LT(faint, pale[0]);
  for (const int y : {90, 110, 150, 390}) EXPECT_EQ(Pixel(picture, 70, y), pale);
  EXPECT_EQ(Pixel(picture, 130, 100), pale);
}

TEST(Pictures, FitPhotographsOfAnotherSizeThanTheCameras) {
  const Reconstruction model = ModelWithLines();
  const ColourImage picture = DrawSegments(model, 1, Photograph(2 * kWidth, kHeight / 2, 200));
  EXPECT_LT(Difference(Pixel(picture, 140, 50), GroupColour(model, 10)), 60);
  EXPECT_LT(Difference(Pixel(picture, 230, 100), GroupColour(model, 11)), 60);
  EXPECT_EQ(Pixel(picture, 250, 100), Pixel(picture, 0, 0));
}

TEST(Pictures, FillPlanesBetweenNeighbouringPointsOnly) {
  Reconstruction model = OneCamera();
  Group3D plane;
  plane.type = FindGroupType("PLANE");
  plane.params = {0, 0, 1, -5};
  // A grid of 5 x 5 points at 20 pixels, and one point far away.
  point3D_t id = 0;
  for (int i = 0; i < 25; ++i) {
    const Eigen::Vector2d xy(100.5 + 20 * (i % 5), 100.5 + 20 * (i / 5));
    AddPoint(++id, {xy.x(), xy.y(), 5}, xy, &model);
    plane.point3D_ids.push_back(id);
  }
  AddPoint(++id, {0, 0, 5}, {500.5, 300.5}, &model);
  plane.point3D_ids.push_back(id);
  // A member that this image does not see.
  model.points3D.Add(++id, {.xyz = {0, 0, 5}});
  plane.point3D_ids.push_back(id);
  model.groups3D.Add(1, plane);
  const ColourImage picture = DrawGroups(model, 1, Photograph(kWidth, kHeight, 200));
  const Rgb colour = GroupColour(model, 1), pale = Pixel(picture, 5, 5);
  EXPECT_LT(Difference(Pixel(picture, 100, 100), colour), 30);  // a dot
  EXPECT_LT(Difference(Pixel(picture, 500, 300), colour), 30);
  for (const auto& [x, y] : {std::pair{110, 110}, {170, 130}, {150, 172}}) {
    const Rgb inside = Pixel(picture, x, y);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(inside[k], 0.45 * colour[k] + 0.55 * pale[k], 2.0);
    }
  }
  EXPECT_EQ(Pixel(picture, 90, 110), pale);
  EXPECT_EQ(Pixel(picture, 300, 200), pale);  // between the grid and the far point
}

TEST(Pictures, OutlineASphereWhereItsHorizonIs) {
  Reconstruction model = OneCamera();
  Group3D sphere;
  sphere.type = FindGroupType("SPHERE");
  sphere.params = {0, 0, 5, 1};
  sphere.point3D_ids = {1, 2};
  AddPoint(1, {0, 0, 4}, {320, 240}, &model);
  AddPoint(2, {0, 1, 5}, {320, 340}, &model);
  model.groups3D.Add(1, sphere);
  const ColourImage picture = DrawGroups(model, 1, Photograph(kWidth, kHeight, 200));
  const Rgb colour = GroupColour(model, 1);
  const double horizon = 500.0 / std::sqrt(24.0);  // 102 px
  int num_on_horizon = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (Difference(Pixel(picture, x, y), colour) > 60) continue;
      const double radius = std::hypot(x + 0.5 - 320, y + 0.5 - 240);
      if (std::abs(radius - horizon) < 8.0) ++num_on_horizon;
      // But for the dots of the points nothing is inside or outside.
      else
        EXPECT_LT(std::min(radius, std::hypot(x - 320.0, y - 340.0)), 4.0) << x << " " << y;
    }
  }
  EXPECT_GT(num_on_horizon, 500);
}

TEST(Pictures, ShowJunctionsAndTheSegmentsTheyJoin) {
  Reconstruction model = ModelWithLines();
  AddPoint(1, {2, 0, 5}, {140.5, 200}, &model);
  AddPoint(2, {0, 0, 5}, {400, 50}, &model);
  model.wireframe.push_back({1, 2, 3});
  const ColourImage picture = DrawWireframe(model, 1, Photograph(kWidth, kHeight, 200));
  EXPECT_EQ(Pixel(picture, 140, 199), (Rgb{255, 255, 255}));
  EXPECT_LT(Difference(Pixel(picture, 70, 200), GroupColour(model, 11)), 60);
  // From the segment's end to the junction.
  EXPECT_LT(Difference(Pixel(picture, 130, 200), GroupColour(model, 11)), 140);
  // Other segments are faint, other points not shown.
  EXPECT_TRUE(IsGrey(Pixel(picture, 70, 100)));
  EXPECT_EQ(Pixel(picture, 400, 50), Pixel(picture, 5, 5));
}

TEST(TopView, IsNotMirrored) {
  const Reconstruction model = ModelWithLines();
  const ColourImage picture = DrawTopView(model, 1000);
  const auto [left, num_left] = Find(picture, GroupColour(model, 10));
  const auto [right, num_right] = Find(picture, GroupColour(model, 11));
  const auto [camera, num_camera] = Find(picture, {30, 30, 30});
  ASSERT_GT(num_left, 10);
  ASSERT_GT(num_right, 10);
  ASSERT_GT(num_camera, 10);
  const Eigen::Vector2d a = left - camera, b = right - camera;
  // With the camera looking up the paper, what is on its left is on the left.
  EXPECT_GT(a.x() * b.y() - a.y() * b.x(), 0.0);
  // Line 1 lies 2.5 to the left and 5 ahead, line 2 is 2 to the right and 6 ahead.
  EXPECT_NEAR(a.norm() / b.norm(), std::hypot(2.5, 5) / std::hypot(2, 6), 0.05);
}

TEST(TopView, OfAnEmptyModelIsWhite) {
  const ColourImage picture = DrawTopView({}, 100);
  EXPECT_EQ(picture.width, 100);
  EXPECT_EQ(picture.height, 100);
  EXPECT_THAT(picture.pixels, ::testing::Each(255));
  EXPECT_EQ(picture.pixels.size(), 30000u);
}

TEST(TopView, FindsDownAmongTheVanishingPointsNearTheCamerasDown) {
  Reconstruction model = OneCamera();
  EXPECT_EQ(EstimateDown({}), Eigen::Vector3d::UnitY());
  EXPECT_TRUE(EstimateDown(model).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  AddVp(1, Eigen::Vector3d(1, 0.2, 0).normalized(), {}, &model);
  EXPECT_TRUE(EstimateDown(model).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  AddVp(2, Eigen::Vector3d(0.1, -1, 0.3).normalized(), {}, &model);
  AddVp(3, Eigen::Vector3d(0.3, 1, 0.3).normalized(), {}, &model);
  EXPECT_TRUE(EstimateDown(model).isApprox(Eigen::Vector3d(-0.1, 1, -0.3).normalized(), 1e-12));
}

TEST(Pictures, OfAnyConsistentModelCanBeDrawn) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Reconstruction model = RandomModel(seed, {.with_rigs = seed % 2 == 0});
    const ColourImage photograph = Photograph(97, 61, 128);
    for (const auto& [image_id, image] : model.images) {
      for (const auto draw : {DrawSegments, DrawGroups, DrawWireframe}) {
        EXPECT_EQ(draw(model, image_id, photograph).pixels.size(), photograph.pixels.size());
      }
    }
    EXPECT_EQ(DrawTopView(model, 50).pixels.size(), 7500u);
  }
}

// Of a lens that distorts, what is straight in the world is drawn as the curve that the photograph
// shows, not as its chord.
TEST(DrawSegments, BendsWithTheLens) {
  Reconstruction model = OneCamera();
  const std::vector<double> params = {500, 320, 240, -0.3};
  model.cameras.at(1) = {FindCameraModel("SIMPLE_RADIAL"), kWidth, kHeight, params};
  const Eigen::Vector3d a(-1.9, -1.3, 4), b(1.9, -1.3, 4);
  const auto pixel = [&](const Eigen::Vector3d& X) {
    Eigen::Vector2d p;
    EXPECT_TRUE(model.cameras.at(1).model->project(params.data(), X, &p));
    return p;
  };
  AddLine(1, a, b, {pixel(a), pixel(b)}, &model);
  AddVp(1, {1, 0, 0}, {1}, &model);
  const ColourImage picture = DrawSegments(model, 1, Photograph(kWidth, kHeight, 128));
  const Eigen::Vector2d middle = pixel((a + b) / 2.0), chord = (pixel(a) + pixel(b)) / 2.0;
  ASSERT_GT((middle - chord).norm(), 10.0);
  const auto is_drawn = [&](const Eigen::Vector2d& p) {
    return !IsGrey(Pixel(picture, static_cast<int>(p.x()), static_cast<int>(p.y())));
  };
  for (const double t : {0.1, 0.3, 0.5, 0.7, 0.9}) EXPECT_TRUE(is_drawn(pixel(a + t * (b - a))));
  EXPECT_FALSE(is_drawn(chord));
}

}  // namespace
}  // namespace holba
