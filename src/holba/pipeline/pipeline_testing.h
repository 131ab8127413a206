// SPDX-License-Identifier: BSD-3-Clause
// Photographs of a wall of rectangles with the model and the database that belong to them, for the
// tests of this room.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "holba/frontend/detectors/segment_testing.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/io/database.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Three cameras side by side before the wall z = 4: images 3, 5 and 8 see the points of a grid.
class PipelineTest : public testing::Test {
 protected:
  static constexpr int kWidth = 240, kHeight = 180;
  static constexpr double kFocal = 200.0, kDepth = 4.0;
  static constexpr image_t kIds[3] = {3, 5, 8};

  void SetUp() override {
    std::string name =
        (std::filesystem::path(testing::TempDir()) / "holba_pipeline_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    model_.cameras.Add(1, {FindCameraModel("PINHOLE"), kWidth, kHeight,
                           {kFocal, kFocal, kWidth / 2.0, kHeight / 2.0}});
    for (int k = 0; k < 3; ++k) {
      Image image;
      image.name = std::to_string(kIds[k]) + ".png";
      image.camera_id = 1;
      image.cam_from_world.translation.x() = -0.3 * (k - 1);
      model_.images.Add(kIds[k], image);
      WritePhotograph(kIds[k], 220.0);
    }
    model_.AddTrivialRigsAndFrames();
    for (int y = -2; y <= 2; ++y) {
      for (int x = -3; x <= 3; ++x) AddPoint({0.35 * x, 0.4 * y, kDepth}, {3, 5, 8});
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Seen by these images.
  void AddPoint(const Eigen::Vector3d& X, const std::vector<image_t>& image_ids) {
    const point3D_t id = model_.points3D.size() + 1;
    Point3D point;
    point.xyz = X;
    for (const image_t image_id : image_ids) {
      std::vector<Point2D>& points2D = model_.images.at(image_id).points2D;
      point.track.push_back({image_id, static_cast<point2D_t>(points2D.size())});
      points2D.push_back({ToPixel(image_id, X), id});
    }
    model_.points3D.Add(id, point);
  }

  Eigen::Vector2d ToPixel(image_t image_id, const Eigen::Vector3d& X) const {
    const Eigen::Vector3d x = model_.images.at(image_id).cam_from_world * X;
    return {kFocal * x.x() / x.z() + kWidth / 2.0, kFocal * x.y() / x.z() + kHeight / 2.0};
  }

  // Six bright rectangles of the wall, each turned a little.
  void WritePhotograph(image_t image_id, double brightness) const {
    std::vector<Rectangle> rectangles;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3d X(0.9 * (i % 3 - 1), 0.9 * (i / 3) - 0.45, kDepth);
      rectangles.push_back({ToPixel(image_id, X), {14.0 + i, 17.0}, 0.1 + 0.05 * i});
    }
    const GreyImage grey = Picture(kWidth, kHeight, 2.0, [&](const Eigen::Vector2d& pixel) {
      double value = 60.0;
      for (const Rectangle& r : rectangles) value += (brightness - 60.0) * r.At(pixel);
      return value;
    });
    ColourImage colour{kWidth, kHeight, {}};
    for (const uint8_t value : grey.pixels) {
      colour.pixels.insert(colour.pixels.end(), 3, value);
    }
    WriteImage(colour, folder_ / (std::to_string(image_id) + ".png"));
  }

  std::filesystem::path Write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  std::filesystem::path folder_;
  Reconstruction model_;
};

}  // namespace holba
