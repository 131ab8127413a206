// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/detectors/feature_extractor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/threads.h"
#include "holba/frontend/detectors/segment_testing.h"
#include "holba/frontend/photographs/undistort.h"

namespace holba {
namespace {

Camera MakeCamera(std::string_view model, int width, int height, std::vector<double> params) {
  return {FindCameraModel(model), static_cast<uint64_t>(width), static_cast<uint64_t>(height),
          std::move(params)};
}

// The photograph of a plane of ideal pixels; black where the camera has no ray.
GreyImage Photograph(const Camera& camera,
                     const std::function<double(const Eigen::Vector2d&)>& brightness) {
  return Picture(static_cast<int>(camera.width), static_cast<int>(camera.height), 1.0,
                 [&](const Eigen::Vector2d& pixel) {
                   const auto ideal = IdealPixel(*camera.model, camera.params.data(), pixel);
                   return ideal ? brightness(*ideal) : 0.0;
                 });
}

const std::vector<Camera>& DistortingCameras() {
  static const std::vector<Camera> cameras = {
      MakeCamera("SIMPLE_RADIAL", 400, 300, {300, 203, 148, -0.2}),
      MakeCamera("SIMPLE_RADIAL", 400, 300, {300, 203, 148, 0.2}),
      MakeCamera("OPENCV", 400, 300, {310, 300, 197, 152, -0.3, 0.09, 0.004, -0.003}),
      MakeCamera("OPENCV_FISHEYE", 400, 300, {230, 230, 200, 150, 0.01, 0.0, 0.0, 0.0}),
  };
  return cameras;
}

TEST(IdealCanvas, LeadsThereAndBackAndKeepsStraightLinesStraight) {
  for (const Camera& camera : DistortingCameras()) {
    SCOPED_TRACE(camera.model->name);
    const IdealCanvas canvas(camera);
    EXPECT_FALSE(canvas.is_photograph());
    EXPECT_LE(canvas.width(), 801);
    EXPECT_LE(canvas.height(), 601);
    int num_shown = 0;
    for (int y = 10; y < 300; y += 20) {
      for (int x = 10; x < 400; x += 20) {
        const Eigen::Vector2d pixel(x, y);
        const auto there = canvas.FromPixel(pixel);
        if (!there || there->x() < 0 || there->x() > canvas.width() || there->y() < 0 ||
            there->y() > canvas.height())
          continue;
        const auto back = canvas.ToPixel(*there);
        ASSERT_TRUE(back);
        EXPECT_LT((*back - pixel).norm(), 1e-6);
        ++num_shown;
      }
    }
    EXPECT_GT(num_shown, 200);
    // Brightness that is linear in ideal pixels is linear on the canvas.
    const GreyImage on_canvas = canvas.Resample(
        Photograph(camera, [](const Eigen::Vector2d& p) { return 100.0 + 0.2 * (p.x() - 200); }));
    const auto offset = IdealPixel(*camera.model, camera.params.data(), {200.0, 150.0});
    const Eigen::Vector2d middle = *canvas.FromPixel({200.0, 150.0});
    for (int dx = -100; dx <= 100; dx += 25) {
      const int x = static_cast<int>(middle.x()) + dx, y = static_cast<int>(middle.y());
      const double ideal_x = offset->x() + (x + 0.5 - middle.x());
      EXPECT_NEAR(on_canvas.pixels[static_cast<size_t>(y) * on_canvas.width + x],
                  100.0 + 0.2 * (ideal_x - 200), 4.0);
    }
  }
}

TEST(ExtractFeatures, AStraightEdgeOfTheWorldIsOneSegmentWhateverTheLens) {
  for (const Camera& camera : DistortingCameras()) {
    SCOPED_TRACE(camera.model->name);
    // Far from the middle of the image, where the lens bends it most.
    const Eigen::Vector2d a(60.0, 45.0), b(330.0, 60.0);
    const LineSegment2d truth{a, b};
    const Eigen::Vector3d line = truth.Line();
    const auto distance = [&](const Eigen::Vector2d& pixel) {
      return line.dot(IdealPixel(*camera.model, camera.params.data(), pixel).value().homogeneous());
    };
    // Blurred evenly in the photograph, as a lens does, not in ideal pixels.
    const GreyImage image = Picture(400, 300, 1.0, [&](const Eigen::Vector2d& pixel) {
      const double d = distance(pixel);
      if (std::abs(d) > 30.0) return d > 0.0 ? 180.0 : 60.0;
      const Eigen::Vector2d slope(distance(pixel + Eigen::Vector2d(0.5, 0)) - d,
                                  distance(pixel + Eigen::Vector2d(0, 0.5)) - d);
      return 60.0 + 120.0 * BlurredStep(0.5 * d / slope.norm());
    });
    const ImageFeatures features = ExtractFeatures({}, image, camera);
    int num_along = 0;
    double longest = 0;
    for (const LineSegment2d& segment : features.segments) {
      const auto start = IdealPixel(*camera.model, camera.params.data(), segment.start);
      const auto end = IdealPixel(*camera.model, camera.params.data(), segment.end);
      ASSERT_TRUE(start && end);
      // On the edge as the photograph shows it: none is made up by the photograph's border.
      for (const auto& [ideal, pixel] :
           {std::pair(*start, segment.start), std::pair(*end, segment.end)}) {
        const Eigen::Vector2d foot = ideal - line.dot(ideal.homogeneous()) * line.head<2>();
        const auto foot_pixel =
            IdealCanvas(camera).ToPixel(*IdealCanvas(camera).FromPixel(pixel) + (foot - ideal));
        ASSERT_TRUE(foot_pixel);
        EXPECT_LT((*foot_pixel - pixel).norm(), 0.2);
      }
      EXPECT_GT((*end - *start).dot(b - a), 0.0) << "brighter side";
      ++num_along;
      longest = std::max(longest, (*end - *start).norm());
    }
    EXPECT_EQ(num_along, 1);
    EXPECT_GT(longest, 250.0);
  }
}

TEST(ExtractFeatures, DescriptorsAreUnitAndTheLongestSegmentsComeFirst) {
  const Camera camera = MakeCamera("PINHOLE", 300, 200, {300, 300, 150, 100});
  const Rectangle first{{110.0, 90.0}, {70.0, 50.0}, 0.2},
      second{{215.0, 100.0}, {30.0, 25.0}, 0.7};
  const GreyImage image = Picture(300, 200, 2.0, [&](const Eigen::Vector2d& p) {
    return 60.0 + 80.0 * first.At(p) + 50.0 * second.At(p);
  });
  const ImageFeatures features = ExtractFeatures({}, image, camera);
  ASSERT_GE(features.segments.size(), 7u);
  ASSERT_EQ(features.segment_descriptors.size(), features.segments.size() * kSegmentDescriptorSize);
  for (size_t i = 0; i < features.segments.size(); ++i) {
    const Eigen::Map<const Eigen::VectorXf> descriptor(
        &features.segment_descriptors[i * kSegmentDescriptorSize], kSegmentDescriptorSize);
    EXPECT_NEAR(descriptor.norm(), 1.0, 1e-5);
    if (i > 0) {
      EXPECT_LE(features.segments[i].Length(), features.segments[i - 1].Length() + 1e-9);
    }
  }
  EXPECT_EQ(features.corner_descriptors.size(), features.corners.size() * kCornerDescriptorSize);
  EXPECT_GE(features.corners.size(), 8u);

  ExtractionOptions few;
  few.segments.max_num_segments = 3;
  few.corners.max_num_corners = 5;
  const ImageFeatures fewer = ExtractFeatures(few, image, camera);
  ASSERT_EQ(fewer.segments.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(fewer.segments[i].start, features.segments[i].start);
  EXPECT_LE(fewer.corners.size(), 5u);
}

TEST(ExtractFeatures, IsTheSameInAnyThread) {
  const Camera& camera = DistortingCameras()[2];
  const Rectangle rectangle{{200.0, 150.0}, {90.0, 60.0}, 0.2};
  const GreyImage image =
      Photograph(camera, [&](const Eigen::Vector2d& p) { return 60.0 + 100.0 * rectangle.At(p); });
  const ImageFeatures alone = ExtractFeatures({}, image, camera);
  std::vector<ImageFeatures> together(4);
  ParallelTasks(4, together.size(),
                [&](size_t i) { together[i] = ExtractFeatures({}, image, camera); });
  for (const ImageFeatures& features : together) {
    EXPECT_EQ(features.segment_descriptors, alone.segment_descriptors);
    EXPECT_EQ(features.corner_descriptors, alone.corner_descriptors);
    EXPECT_EQ(features.corners, alone.corners);
    ASSERT_EQ(features.segments.size(), alone.segments.size());
    for (size_t i = 0; i < alone.segments.size(); ++i) {
      EXPECT_EQ(features.segments[i].start, alone.segments[i].start);
      EXPECT_EQ(features.segments[i].end, alone.segments[i].end);
    }
  }
}

TEST(ExtractFeatures, SettingsNameAllThatFeaturesDependOn) {
  ExtractionOptions options;
  OptionTable table;
  table.Bind(&options);
  const Camera pinhole = MakeCamera("PINHOLE", 400, 300, {300, 300, 200, 150});
  const std::string settings = SettingsOf(options, pinhole);
  for (const Option& option : table.options()) {
    if (option.type == OptionType::kText) continue;
    const std::string before = option.Text();
    option.SetText(option.type == OptionType::kBool   ? (before == "1" ? "0" : "1")
                   : option.name == "Corners.quality" ? "0.5"
                                                      : (before == "3" ? "2" : "3"));
    EXPECT_NE(SettingsOf(options, pinhole), settings) << option.name;
    option.SetText(before);
  }
  EXPECT_EQ(SettingsOf(options, pinhole), settings);
  // The focal length of a pinhole changes no feature; that of a lens does.
  EXPECT_EQ(SettingsOf(options, MakeCamera("PINHOLE", 400, 300, {310, 300, 200, 150})), settings);
  EXPECT_NE(SettingsOf(options, MakeCamera("PINHOLE", 401, 300, {300, 300, 200, 150})), settings);
  const Camera& lens = DistortingCameras()[0];
  Camera other = lens;
  other.params[3] += 1e-9;
  EXPECT_NE(SettingsOf(options, lens), SettingsOf(options, other));
}

}  // namespace
}  // namespace holba
