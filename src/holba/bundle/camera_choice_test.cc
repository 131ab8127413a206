// SPDX-License-Identifier: BSD-3-Clause
// What lens cameras have, and which of them are one, as points say that were left out.
#include <gmock/gmock.h>

#include <random>

#include "holba/bundle/bundle_testing.h"
#include "holba/bundle/camera_model_choice.h"
#include "holba/bundle/camera_sharing.h"
#include "holba/bundle/intrinsics_choice.h"
#include "holba/camera/convert_camera.h"

namespace holba {
namespace {

using testing::AnyOf;
using testing::Each;
using testing::Field;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr double kNoisePx = 0.3;

// A cloud of points that all of sixteen images see, which stand around it. `zoom`: every second
// image is of a camera whose focal lengths are so many times as long. The cameras are four units
// from the middle of the cloud; the larger it is, the more of the lens it shows. They look past its
// middle at `aside`.
Reconstruction Photographs(const char* lens, const std::vector<double>& params, bool own_cameras,
                           double zoom = 1.0, double half_size = 1.6, double aside = 0.0) {
  ModelMaker maker(lens, params);
  std::vector<image_t> images;
  for (int i = 0; i < 16; ++i) {
    const double angle = 0.35 * i;
    images.push_back(maker.AddImage(
        {4.0 * std::cos(angle), 4.0 * std::sin(angle), 0.5 * (i % 3)},
        aside * Eigen::Vector3d(std::cos(2.0 * i), std::sin(2.0 * i), std::cos(3.0 * i)),
        own_cameras));
  }
  maker.Finish();
  for (const image_t id : images) {
    if (id % 2 == 1 || zoom == 1.0) continue;
    Camera& camera = maker.model.cameras.at(id);
    for (const int idx : camera.model->focal_idxs) camera.params[idx] *= zoom;
  }
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-half_size, half_size);
  std::normal_distribution<double> noise(0.0, kNoisePx);
  for (int i = 0; i < 400; ++i)
    maker.AddPoint({uniform(random), uniform(random), uniform(random)}, images);
  for (auto& [id, image] : maker.model.images)
    for (Point2D& point : image.points2D) point.xy += Eigen::Vector2d(noise(random), noise(random));
  return std::move(maker.model);
}

// As a program that knows that lens model only would have it.
Reconstruction SaidToBe(const char* lens, Reconstruction model) {
  const CameraModel& to = *FindCameraModel(lens);
  for (auto& [id, camera] : model.cameras) {
    camera.params =
        ConvertCamera(*camera.model, camera.params, camera.width, camera.height, to).value();
    camera.model = &to;
  }
  return model;
}

BundleOptions Options() {
  BundleOptions options;
  options.share_cameras = true;
  options.camera_model = CameraModelSource::kAuto;
  return options;
}
SolverOptions Solver() {
  SolverOptions options;
  options.num_threads = 1;
  return options;
}
std::vector<CameraModelTrial> ChooseModels(Reconstruction* model) {
  return ChooseCameraModels(Options(), Solver(), {}, {}, model);
}
std::vector<CameraSharingTrial> Share(Reconstruction* model) {
  return ShareCameras(Options(), Solver(), {}, {}, model);
}

TEST(ChooseCameraModels, LensThatIsAsSaidStaysAndNothingMoves) {
  Reconstruction model = Photographs("SIMPLE_RADIAL", {700, 500, 480, -0.15}, false);
  const Reconstruction given = model;
  const auto trials = ChooseModels(&model);
  EXPECT_THAT(trials, SizeIs(1));  // OPENCV
  EXPECT_THAT(trials, Each(Field(&CameraModelTrial::taken, false)));
  EXPECT_EQ(trials[0].carried.standard_error, 0.0);  // nothing to carry
  EXPECT_EQ(model.cameras.at(1).params, given.cameras.at(1).params);
  for (const auto& [id, point] : given.points3D) EXPECT_EQ(model.points3D.at(id).xyz, point.xyz);
}

TEST(ChooseCameraModels, LensWithTangentialDistortionIsFound) {
  const std::vector<double> lens = {700, 704, 500, 480, -0.25, 0.08, 0.003, -0.002};
  Reconstruction model = SaidToBe("SIMPLE_RADIAL", Photographs("OPENCV", lens, false));
  const auto trials = ChooseModels(&model);
  // Half of the images show the lens of the other half.
  EXPECT_GT(trials[0].carried.standard_error, 0.0);
  EXPECT_LT(trials[0].carried.mean, -kMinGainErrors * trials[0].carried.standard_error);
  const Camera& camera = model.cameras.at(1);
  EXPECT_EQ(camera.model->name, "OPENCV");
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  for (const int idx : {4, 5}) EXPECT_NEAR(camera.params[idx], lens[idx], 0.01) << idx;
  for (const int idx : {6, 7}) EXPECT_NEAR(camera.params[idx], lens[idx], 5e-4) << idx;
}

TEST(ChooseCameraModels, RadialDistortionNeedsNoMoreThanThat) {
  Reconstruction model =
      SaidToBe("SIMPLE_RADIAL", Photographs("RADIAL", {700, 500, 480, -0.25, 0.08}, false));
  ChooseModels(&model);
  EXPECT_EQ(model.cameras.at(1).model->name, "RADIAL");
}

TEST(ChooseCameraModels, FisheyeIsFound) {
  const std::vector<double> lens = {420, 420, 500, 480, 0.02, -0.01, 0.004, -0.001};
  Reconstruction model =
      SaidToBe("SIMPLE_RADIAL", Photographs("OPENCV_FISHEYE", lens, false, 1.0, 2.2));
  ChooseModels(&model);
  EXPECT_EQ(model.cameras.at(1).model->name, "OPENCV_FISHEYE");
}

TEST(ChooseCameraModels, WhatIsNotUsableIsNotTaken) {
  const std::vector<double> lens = {420, 420, 500, 480, 0.02, -0.01, 0.004, -0.001};
  Reconstruction model =
      SaidToBe("SIMPLE_RADIAL", Photographs("OPENCV_FISHEYE", lens, false, 1.0, 2.2));
  const CameraCondition is_usable = [](const Camera& camera) {
    return camera.model->name != "OPENCV_FISHEYE" && camera.model->name != "FULL_OPENCV";
  };
  const auto trials = ChooseCameraModels(Options(), Solver(), {}, {}, &model, is_usable);
  for (const CameraModelTrial& trial : trials) EXPECT_THAT(trial.to, AnyOf("OPENCV", "RADIAL"));
  EXPECT_THAT(model.cameras.at(1).model->name, AnyOf("OPENCV", "RADIAL"));
}

TEST(ChooseCameraModels, HeldIntrinsicsStay) {
  Reconstruction model = Photographs("RADIAL", {700, 500, 480, -0.25, 0.08}, false);
  BundleOptions options = Options();
  options.refine_extra_params = false;
  EXPECT_THAT(ChooseCameraModels(options, Solver(), {}, {}, &model), IsEmpty());
}

TEST(ShareCameras, PhotographsOfOneCameraAreFoundToBe) {
  Reconstruction model = Photographs("SIMPLE_RADIAL", {700, 500, 480, -0.15}, true);
  ASSERT_EQ(model.cameras.size(), 16u);
  const auto trials = Share(&model);
  ASSERT_THAT(trials, SizeIs(1));
  EXPECT_TRUE(trials[0].is_shared);
  EXPECT_EQ(trials[0].num_cameras, 16u);
  EXPECT_EQ(model.cameras.size(), 1u);
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_NEAR(model.cameras.at(1).params[0], 700.0, 2.0);
}

TEST(ShareCameras, PhotographsOfAZoomLensAreNot) {
  Reconstruction model = Photographs("SIMPLE_RADIAL", {700, 500, 480, -0.15}, true, 1.1);
  const auto trials = Share(&model);
  ASSERT_THAT(trials, SizeIs(1));
  EXPECT_FALSE(trials[0].is_shared);
  EXPECT_EQ(model.cameras.size(), 16u);
}

// Each photograph shows a part of the lens: sixteen cameras of a poor lens model do better than
// one; one of the right model does better yet.
TEST(ShareCameras, LensModelThatLacksSomethingDoesNotHideThatThereIsOne) {
  const std::vector<double> lens = {700, 704, 500, 480, -0.3, 0.12, 0.002, -0.001};
  Reconstruction model =
      SaidToBe("SIMPLE_RADIAL", Photographs("OPENCV", lens, true, 1.0, 0.8, 1.6));
  const auto trials = Share(&model);
  ASSERT_THAT(trials, SizeIs(1));
  EXPECT_TRUE(trials[0].is_shared);
  EXPECT_EQ(trials[0].model_of_one, "OPENCV");
  EXPECT_EQ(model.cameras.size(), 1u);
}

TEST(AdjustBundle, ChoosesCamerasWhereAsked) {
  const std::vector<double> lens = {700, 704, 500, 480, -0.25, 0.08, 0.003, -0.002};
  Reconstruction model = SaidToBe("SIMPLE_RADIAL", Photographs("OPENCV", lens, true));
  Reconstruction plain = model;
  const BundleSummary summary = AdjustBundle(Options(), Solver(), &model);
  EXPECT_THAT(summary.shared_cameras, SizeIs(1));
  EXPECT_THAT(summary.camera_models, Not(IsEmpty()));
  EXPECT_EQ(model.cameras.size(), 1u);
  EXPECT_EQ(model.cameras.at(1).model->name, "OPENCV");
  EXPECT_NEAR(summary.auto_sigmas.at("point"), kNoisePx, 0.1 * kNoisePx);

  AdjustBundle(BundleOptions(), Solver(), &plain);
  EXPECT_EQ(plain.cameras.size(), 16u);
  EXPECT_EQ(plain.cameras.at(1).model->name, "SIMPLE_RADIAL");
}

}  // namespace
}  // namespace holba
