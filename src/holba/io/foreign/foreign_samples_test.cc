// SPDX-License-Identifier: BSD-3-Clause
// Files that the programs wrote: poses and axes are right by what the files themselves say of the
// scene, and no damage to them does more than a refusal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/random.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/model_io.h"

namespace holba {
namespace {

namespace fs = std::filesystem;

fs::path Sample(const std::string& name) {
  return DataFolder() / "models_other" / "foreign" / name;
}

// Reprojection errors of all observations, px; infinite behind a camera.
std::vector<double> ReprojectionErrors(const Reconstruction& model) {
  std::vector<double> errors;
  for (const auto& [point3D_id, point] : model.points3D) {
    for (const PointObservation& observation : point.track) {
      const Image& image = model.images.at(observation.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      Eigen::Vector2d pixel;
      const bool is_seen =
          camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel);
      errors.push_back(is_seen ? (pixel - image.points2D[observation.point2D_idx].xy).norm()
                               : INFINITY);
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

TEST(ForeignSamples, BundlersPointsReprojectToWhereTheyWereSeen) {
  HOLBA_SKIP_WITHOUT_DATA();
  struct Case {
    const char* name;
    size_t num_images, num_posed, num_points;
  };
  for (const Case& c :
       {Case{"kermit_bundler.out", 11, 9, 634}, Case{"balbianello_bundler.out", 5, 5, 544},
        Case{"platypus_bundler.out", 6, 6, 3217}}) {
    const Reconstruction model = ReadModel(Sample(c.name));
    EXPECT_EQ(model.images.size(), c.num_posed) << c.name;
    EXPECT_EQ(model.images.size() + model.unregistered_images.size(), c.num_images) << c.name;
    EXPECT_EQ(model.points3D.size(), c.num_points) << c.name;
    const std::vector<double> errors = ReprojectionErrors(model);
    ASSERT_FALSE(errors.empty());
    // Bundler's own adjustment ends at half a pixel.
    EXPECT_LT(errors[errors.size() / 2], 1.0) << c.name;
    EXPECT_LT(errors[errors.size() * 99 / 100], 10.0) << c.name;
  }
}

TEST(ForeignSamples, OpenSfmsPointsAreInFrontOfItsShotsAndInThem) {
  HOLBA_SKIP_WITHOUT_DATA();
  const Reconstruction model = ReadModel(Sample("opensfm_reconstruction.json"));
  ASSERT_EQ(model.images.size(), 3u);
  EXPECT_EQ(model.points3D.size(), 1554u);
  const Camera& camera = model.cameras.begin()->second;
  EXPECT_EQ(camera.model->name, "RADIAL");
  EXPECT_NEAR(camera.params[0], 0.9627677384303784 * 3264, 1e-9);
  size_t num_seen = 0;
  for (const auto& [id, point] : model.points3D) {
    int num_in = 0;
    for (const auto& [image_id, image] : model.images) {
      Eigen::Vector2d pixel;
      num_in +=
          camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel) &&
          pixel.x() > 0 && pixel.y() > 0 && pixel.x() < 3264 && pixel.y() < 2448;
    }
    num_seen += num_in >= 2;
  }
  EXPECT_GT(num_seen, 1554u * 99 / 100);
}

TEST(ForeignSamples, MeshroomsCamerasAreUpright) {
  HOLBA_SKIP_WITHOUT_DATA();
  const Reconstruction model = ReadModel(Sample("meshroom_cameras.sfm"));
  EXPECT_EQ(model.images.size(), 34u);
  EXPECT_EQ(model.unregistered_images.size(), 17u);
  EXPECT_TRUE(model.FindImage(1)->name == "20250614_204908.jpg") << model.FindImage(1)->name;
  const Camera& camera = model.cameras.begin()->second;
  EXPECT_EQ(camera.model->name, "FULL_OPENCV");
  EXPECT_NEAR(camera.params[0], 5.678361290663454 / 8.1265990486979671 * 4000, 1e-9);
  EXPECT_NEAR(camera.params[2], 2000 - 32.291769408137576 + 0.5, 1e-9);
  // A person walked around with it: all photographs agree where up is.
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images)
    up += image.cam_from_world.RotationMatrix().transpose() * -Eigen::Vector3d::UnitY();
  EXPECT_GT(up.norm() / 34, 0.9);
}

TEST(ForeignSamples, MetashapesCamerasLookAtTheirObject) {
  HOLBA_SKIP_WITHOUT_DATA();
  const Reconstruction model = ReadModel(Sample("metashape_cameras.xml"));
  EXPECT_EQ(model.cameras.size(), 94u);
  const size_t num_images = model.images.size();
  EXPECT_EQ(num_images + model.unregistered_images.size(), 94u);
  EXPECT_GT(num_images, 80u);
  const Camera& camera = model.cameras.at(1);
  EXPECT_EQ(camera.model->name, "OPENCV");
  const std::vector<double> expected = {8397.0800252741 + 0.256163863908223,
                                        8397.0800252741,
                                        2592,
                                        1728,
                                        -0.0603472625149708,
                                        0.184858521842878,
                                        0.00126022593561743,
                                        -0.00119014441157678};
  EXPECT_EQ(camera.params, expected);
  // The middle of the <region> is the object: every optical axis passes it, in front.
  const Eigen::Vector3d object(1.1309228543156133, 0.12865296212527538, -4.5539410292989251);
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d in_cam = image.cam_from_world * object;
    EXPECT_GT(in_cam.z(), 0.0) << image.name;
    EXPECT_LT(in_cam.head<2>().norm() / in_cam.z(), 0.5) << image.name;
  }
}

TEST(ForeignSamples, OpenMvgsViewsWaitForTheirPoses) {
  HOLBA_SKIP_WITHOUT_DATA();
  const Reconstruction model = ReadModel(Sample("openmvg_sfm_data.json"));
  EXPECT_EQ(model.images.size(), 0u);
  EXPECT_EQ(model.unregistered_images.size(), 10u);
  const Camera& camera = model.cameras.begin()->second;
  EXPECT_EQ(camera.width, 2832u);
  EXPECT_EQ(camera.params[0], 2884.2618124909254);
}

// Never a crash: each sample cut off anywhere, and with some of its bytes changed.
TEST(ForeignSamples, DamageIsAtMostRefused) {
  HOLBA_SKIP_WITHOUT_DATA();
  SetLogLevel(LogLevel::kError);
  for (const char* name :
       {"balbianello_bundler.out", "openmvg_sfm_data.json", "opensfm_reconstruction.json",
        "meshroom_cameras.sfm", "metashape_cameras.xml"}) {
    const ForeignFormat* const format = FindForeignFormat(Sample(name));
    ASSERT_NE(format, nullptr) << name;
    const std::string good = ReadFileBytes(Sample(name));
    const auto parse = [&](const std::string& bytes) {
      try {
        format->parse(bytes, "damaged").FindInconsistency();
        return false;
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), testing::StartsWith("damaged")) << name;
        return true;
      }
    };
    const size_t step = good.size() / 60 + 1;
    for (size_t size = 0; size + 3 < good.size(); size += step)
      EXPECT_TRUE(parse(good.substr(0, size))) << name << " cut after " << size;
    Random random(7);
    for (int i = 0; i < 60; ++i) {
      std::string bytes = good;
      for (int k = 0; k < 1 + i / 4; ++k) {
        constexpr std::string_view kBytes("\0\xff-9\"{}[],<>/e.", 16);
        bytes[random.Index(bytes.size())] = kBytes[random.Index(kBytes.size())];
      }
      parse(bytes);
    }
  }
}

}  // namespace
}  // namespace holba
