// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "holba/scene/main_directions.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

constexpr int kSidePx = 1600;

void AddGroupOf(group3D_t id, const char* type, std::vector<double> params,
                const std::vector<point3D_t>& points, const std::vector<line3D_t>& lines,
                Reconstruction* model) {
  Group3D group;
  group.type = FindGroupType(type);
  group.params = std::move(params);
  group.point3D_ids = points;
  group.line3D_ids = lines;
  model->groups3D.Add(id, group);
}

void AddLineOf(line3D_t id, const Eigen::Vector3d& start, const Eigen::Vector3d& end,
               Reconstruction* model) {
  Line3D line;
  line.line = PlueckerLine::FromPoints(start, end);
  line.start = start;
  line.end = end;
  model->lines3D.Add(id, line);
}

// A box of 6 x 3 x 4, y down, before a camera at the origin that looks along +z: its corners as
// points, its edges as lines of three vanishing points, its back as a plane; and a slanting
// direction that many lines have.
Reconstruction Box() {
  Reconstruction model;
  model.cameras.Add(1, {FindCameraModel("SIMPLE_RADIAL"), 640, 480, {500, 320, 240, -0.2}});
  model.images.Add(1, {.name = "1.jpg", .camera_id = 1});
  std::vector<line3D_t> of_axis[3];
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d X(corner & 1 ? 3 : -3, corner & 2 ? 1.5 : -1.5, corner & 4 ? 9 : 5);
    model.points3D.Add(static_cast<point3D_t>(corner + 1), {.xyz = X, .rgb = {20, 20, 200}});
    for (int axis = 0; axis < 3; ++axis) {
      if (corner & 1 << axis) continue;
      Eigen::Vector3d Y = X;
      Y[axis] += axis == 0 ? 6.0 : axis == 1 ? 3.0 : 4.0;
      const auto id = static_cast<line3D_t>(10 * axis + corner + 1);
      AddLineOf(id, X, Y, &model);
      of_axis[axis].push_back(id);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> direction(3, 0.0);
    direction[static_cast<size_t>(axis)] = 1.0;
    AddGroupOf(static_cast<group3D_t>(axis + 1), "VP", direction, {}, of_axis[axis], &model);
  }
  AddLineOf(101, {-2, 0, 7}, {-1, 0, 8}, &model);
  AddGroupOf(4, "VP", {std::sqrt(0.5), 0, std::sqrt(0.5)}, {}, {101}, &model);
  AddGroupOf(5, "PLANE", {0, 0, 1, -9}, {5, 6, 7, 8}, {}, &model);
  return model;
}

const SceneView& ViewOf(const std::vector<SceneView>& views, const std::string& name) {
  return *std::find_if(views.begin(), views.end(),
                       [&](const SceneView& view) { return view.name == name; });
}

TEST(SceneViews, LookFromAsideFromAboveAndAlongTheDirections) {
  const std::vector<SceneView> views = MakeSceneViews(Box(), kSidePx);
  std::vector<std::string> names;
  for (const SceneView& view : views) names.push_back(view.name);
  EXPECT_THAT(names, testing::ElementsAre("overview", "plan", "front", "side", "along_4"));
  const auto ahead = [&](const std::string& name) {
    return Eigen::Vector3d(ViewOf(views, name).view_from_world.rotation.conjugate() *
                           Eigen::Vector3d::UnitZ());
  };
  EXPECT_LT((ahead("plan") - Eigen::Vector3d::UnitY()).norm(), 1e-9);
  EXPECT_LT((ahead("front") - Eigen::Vector3d::UnitZ()).norm(), 1e-9);  // as the camera looks
  EXPECT_NEAR(std::abs(ahead("side").x()), 1.0, 1e-9);
  EXPECT_NEAR(ahead("along_4").dot(Eigen::Vector3d(1, 0, 1).normalized()), 1.0, 1e-9);
  // From behind the camera and from above.
  const Eigen::Vector3d eye = ViewOf(views, "overview").view_from_world.OriginInA();
  EXPECT_LT(eye.z(), 5.0);
  EXPECT_LT(eye.y(), -1.5);
}

TEST(SceneViews, HoldAllOfASceneWithoutOutliers) {
  const Reconstruction model = Box();
  for (const SceneView& view : MakeSceneViews(model, kSidePx)) {
    EXPECT_EQ(std::max(view.width, view.height), kSidePx);
    for (const auto& [id, point] : model.points3D) {
      ASSERT_TRUE(view.Holds(point.xyz));
      const Eigen::Vector3d in_view = view.view_from_world * point.xyz;
      const Eigen::Vector2d pixel = view.ToPixel(in_view);
      EXPECT_TRUE((pixel.array() > 0.0).all() && pixel.x() < view.width && pixel.y() < view.height)
          << view.name << " " << id;
      EXPECT_TRUE(view.is_orthographic || in_view.z() > view.near);
    }
  }
}

TEST(SceneViews, OfAModelWithoutAnythingAreNone) {
  EXPECT_TRUE(MakeSceneViews(Reconstruction(), kSidePx).empty());
}

TEST(SceneViews, AreNotDrawnFarByAPointFarOut) {
  Reconstruction model = Box();
  const double before = ViewOf(MakeSceneViews(model, kSidePx), "plan").scale;
  for (point3D_t id = 100; id < 400; ++id) model.points3D.Add(id, {.xyz = {0.1, 0.2, 7.0}});
  model.points3D.Add(999, {.xyz = {1e5, 1e5, 1e5}});
  EXPECT_GE(ViewOf(MakeSceneViews(model, kSidePx), "plan").scale, 0.7 * before);
}

Rgb ColourAt(const ColourImage& image, const Eigen::Vector2d& pixel) {
  const uint8_t* p = &image.pixels[3 * (static_cast<size_t>(pixel.y()) * image.width +
                                        static_cast<size_t>(pixel.x()))];
  return {p[0], p[1], p[2]};
}

TEST(DrawScene, ShowsLinesInTheColourOfTheirVanishingPointWhereTheyProject) {
  const Reconstruction model = Box();
  const auto views = MakeSceneViews(model, kSidePx);
  for (const char* name : {"overview", "front"}) {
    const SceneView& view = ViewOf(views, name);
    const ColourImage picture = DrawScene(model, view, {});
    EXPECT_EQ(picture.width, view.width);
    EXPECT_GT(picture.height, view.height);  // the legend is below
    // A level edge of the front of the box.
    const Line3D& line = model.lines3D.at(1);
    const Eigen::Vector3d middle = 0.7 * line.start + 0.3 * line.end;
    EXPECT_EQ(ColourAt(picture, view.ToPixel(view.view_from_world * middle)), GroupColour(model, 1))
        << name;
  }
}

TEST(DrawScene, PlanesAreTranslucent) {
  const Reconstruction model = Box();
  const auto views = MakeSceneViews(model, kSidePx);
  const SceneView& view = ViewOf(views, "front");
  const ColourImage picture = DrawScene(model, view, {});
  const Rgb seen = ColourAt(picture, view.ToPixel(view.view_from_world * Eigen::Vector3d(1, 1, 9)));
  const Rgb colour = GroupColour(model, 5);
  for (size_t k = 0; k < 3; ++k) {
    EXPECT_GT(seen[k], colour[k]);
    EXPECT_LT(seen[k], 255);
  }
}

TEST(DrawScene, TheSameForAnyNumberOfThreads) {
  const Reconstruction model = Box();
  for (const SceneView& view : MakeSceneViews(model, 300)) {
    EXPECT_EQ(DrawScene(model, view, {.num_threads = 1}).pixels,
              DrawScene(model, view, {.num_threads = 3}).pixels);
  }
}

TEST(DrawSceneInImage, LinesBendWithTheLens) {
  Reconstruction model = Box();
  Image& image = model.images.at(1);
  const Camera& camera = model.cameras.at(1);
  const Line3D& line = model.lines3D.at(1);
  const auto project = [&](const Eigen::Vector3d& X) {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(camera.model->project(camera.params.data(), X, &pixel));
    return pixel;
  };
  const Eigen::Vector2d a = project(line.start), b = project(line.end);
  image.lines2D.push_back({{a, b}, 1});
  const Eigen::Vector2d middle = project(0.5 * (line.start + line.end));
  ASSERT_GT((middle - 0.5 * (a + b)).norm(), 10.0);
  // A photograph of another size than the camera.
  constexpr double kScale = 2.5;
  const ColourImage grey{1600, 1200, std::vector<uint8_t>(size_t{3} * 1600 * 1200, 100)};
  const ColourImage picture = DrawSceneInImage(model, 1, grey, 1);
  EXPECT_EQ(ColourAt(picture, kScale * middle), GroupColour(model, 1));
  EXPECT_EQ(ColourAt(picture, 0.5 * kScale * (a + b)), ColourAt(picture, {800, 600}));
}

TEST(DrawScene, OfAnyConsistentModelCanBeDrawn) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Reconstruction model = RandomModel(seed);
    for (const SceneView& view : MakeSceneViews(model, 200)) DrawScene(model, view, {});
    for (const auto& [id, image] : model.images) {
      const ColourImage grey{64, 48, std::vector<uint8_t>(size_t{3} * 64 * 48, 100)};
      DrawSceneInImage(model, id, grey, 1);
    }
  }
}

}  // namespace
}  // namespace holba
