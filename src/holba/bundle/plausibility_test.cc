// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/plausibility.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/random.h"
#include "holba/bundle/bundle_testing.h"

namespace holba {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Six cameras that see forty points, exactly.
ModelMaker Scene(double baseline = 1.0) {
  ModelMaker maker;
  for (int i = 0; i < 6; ++i) {
    maker.AddImage({baseline * 3.0 * std::cos(1.0 * i), baseline * std::sin(1.0 * i), -8.0},
                   {0.1 * i, 0, 0});
  }
  maker.Finish();
  Random random(1);
  for (int k = 0; k < 40; ++k) {
    maker.AddPoint({random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(-2, 2)},
                   {1, 2, 3, 4, 5, 6});
  }
  return maker;
}

template <typename PoseOf>
Reconstruction Changed(Reconstruction model, const PoseOf& pose_of) {
  for (const auto& [id, image] : model.images)
    model.SetFramePose(image.frame_id, pose_of(image.cam_from_world));
  return model;
}

std::vector<std::string> Doubts(const Reconstruction& model) {
  return DoubtsOf(CheckReprojections(model), model);
}

TEST(Plausibility, HasNothingToSayOfAModelThatFits) {
  EXPECT_THAT(Doubts(Scene().model), IsEmpty());
}

TEST(Plausibility, NamesTheConventionThatFits) {
  const Reconstruction model = Scene().model;
  const Rigid3d turn(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  EXPECT_THAT(Doubts(Changed(model, [](const Rigid3d& p) { return p.Inverse(); })),
              ElementsAre(HasSubstr("read as camera-to-world poses they would be")));
  const Reconstruction opengl = Changed(model, [&](const Rigid3d& p) { return turn * p; });
  EXPECT_THAT(Doubts(opengl), ElementsAre(HasSubstr("look along -z with y up (OpenGL, Blender)")));
  EXPECT_THAT(WhyNothingIsLeft(opengl),
              HasSubstr("240 of 240 observations are of points behind their camera, so that "
                        "nothing can be adjusted; read as poses of cameras that look along -z"));
  EXPECT_THAT(Doubts(Changed(model, [&](const Rigid3d& p) { return (turn * p).Inverse(); })),
              ElementsAre(HasSubstr("camera-to-world poses of cameras that look along -z")));
  EXPECT_THAT(Doubts(Changed(model,
                             [](const Rigid3d& p) {
                               const Eigen::Quaterniond& q = p.rotation;
                               return Rigid3d({q.x(), q.y(), q.z(), q.w()}, p.translation);
                             })),
              ElementsAre(HasSubstr("quaternions whose real part stands last")));
  EXPECT_THAT(
      Doubts(Changed(model, [](const Rigid3d& p) { return Rigid3d(p.rotation, p.OriginInA()); })),
      ElementsAre(HasSubstr("rotations with camera centres in place of translations")));
}

TEST(Plausibility, DoubtsResidualsOfHundredsOfPixels) {
  Reconstruction model = Scene().model;
  for (auto& [id, image] : model.images) {
    for (Point2D& point : image.points2D) point.xy *= 2.0;  // of a photograph of twice the size
  }
  EXPECT_THAT(Doubts(model),
              ElementsAre(testing::AllOf(HasSubstr("half of the observations are"),
                                         HasSubstr("or the cameras those of other images"))));
}

TEST(Plausibility, DoubtsCamerasInOnePlace) {
  EXPECT_THAT(Doubts(Scene(1e-4).model), ElementsAre(HasSubstr("the cameras turn in one place")));
  EXPECT_THAT(Doubts(Scene(1e-2).model), IsEmpty());
}

TEST(Plausibility, AFisheyeSeesWhatIsBesideIt) {
  ModelMaker maker("OPENCV_FISHEYE", {300, 300, 500, 480, 0.01, 0, 0, 0});
  for (int i = 0; i < 4; ++i) maker.AddImage({0.5 * i, 0, 0}, {0.5 * i, 0.2, 5});
  maker.Finish();
  // To 100 degrees from the axes.
  for (int k = 0; k < 8; ++k) maker.AddPoint({20.0, 0.7 * k - 3.0, -3.5}, {1, 2, 3, 4});
  EXPECT_EQ(CheckReprojections(maker.model).num_absent, 0u);
  EXPECT_THAT(Doubts(maker.model), IsEmpty());
}

TEST(Plausibility, ExplainsWhatIsBeyondTheParametersOfAFisheye) {
  // Beyond 88 degrees from the axis rays come nearer to the centre again.
  ModelMaker maker("OPENCV_FISHEYE", {300, 300, 500, 480, -0.14, 0, 0, 0});
  for (int i = 0; i < 4; ++i) maker.AddImage({0.5 * i, 0, 0}, {0.5 * i, 0.2, 5});
  maker.Finish();
  Random random(2);
  for (int k = 0; k < 40; ++k) {
    maker.AddPoint({random.Uniform(-4, 4), random.Uniform(-4, 4), random.Uniform(2, 4)},
                   {1, 2, 3, 4});
  }
  // A fifth of the points to 100 degrees from the axes.
  for (int k = 0; k < 8; ++k)
    maker.model.points3D.at(100 + k).xyz = Eigen::Vector3d(20.0, random.Uniform(-3, 3), -3.5);
  EXPECT_THAT(Doubts(maker.model),
              ElementsAre(testing::AllOf(HasSubstr("32 of 160 observations count nothing"),
                                         HasSubstr("90 deg or more from the axis"))));
}

TEST(Plausibility, SaysThatThereAreNoPoints) {
  const Reconstruction empty;
  EXPECT_THAT(Doubts(empty), ElementsAre(HasSubstr("the model has no points")));
  EXPECT_THAT(WhyNothingIsLeft(empty), HasSubstr("no points and no lines"));
}

}  // namespace
}  // namespace holba
