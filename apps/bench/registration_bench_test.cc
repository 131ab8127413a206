// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/registration_bench.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/estimation/pose/sighting_errors.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

std::filesystem::path Write(const std::string& text) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "views.txt";
  std::ofstream(path) << text;
  return path;
}

AbsolutePoseOptions Options() {
  AbsolutePoseOptions options;
  options.abs_pose_min_num_inliers = 3;
  options.abs_pose_refine_focal_length = options.abs_pose_refine_extra_params = false;
  return options;
}

TEST(RegistrationBench, ViewsAreReadAndTheirPosesFound) {
  std::string text;
  std::vector<RoomView> truth;
  for (uint64_t seed = 0; seed < 3; ++seed) {
    truth.push_back(MakeRoomView({.num_points = 40, .share_wrong = 0.25, .seed = seed}));
    text += "view 800 600 700 700 400 300 40\n";
    for (const PointSighting& point : truth.back().matches.points) {
      for (double x : {point.X.x(), point.X.y(), point.X.z(), point.pixel.x(), point.pixel.y()})
        text += std::to_string(x) + " ";
      text += "\n";
    }
  }
  const auto views = ReadRegistrationViews(Write(text));
  ASSERT_EQ(views.size(), 3u);
  const auto results = EstimatePoses(Options(), views, 0);
  for (size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(results[i].pose);
    EXPECT_LT(
        (results[i].pose->cam_from_world.OriginInA() - truth[i].cam_from_world.OriginInA()).norm(),
        0.05);
    EXPECT_GE(results[i].pose->num_inliers.points, 28u);
  }
  EXPECT_EQ(RegistrationsToJson(results)[1]["qvec"].size(), 4u);
}

TEST(RegistrationBench, DamagedFilesAreNamedWithTheirLine) {
  EXPECT_THROW(ReadRegistrationViews("no/such/file"), InputError);
  EXPECT_THROW(ReadRegistrationViews(Write("view 800 600\n")), InputError);
  EXPECT_THROW(ReadRegistrationViews(Write("view 800 600 1 1 1 1 2\n1 2 3 4 5\n")), InputError);
  EXPECT_THROW(ReadRegistrationViews(Write("view 800 600 1 1 1 1 1\n1 2 3 x 5\n")), InputError);
}

TEST(RegistrationBench, RightSightingsOfARoomAgreeWithItsPoseAndWrongOnesDoNot) {
  const RoomView view = MakeRoomView(
      {.num_points = 100, .num_lines = 40, .num_directions = 3, .share_wrong = 0.5, .seed = 4});
  const PosedCamera camera(view.camera.model, view.camera.params.data(), view.cam_from_world);
  const auto count = [&](const auto& sightings) {
    size_t num_near = 0;
    for (const auto& sighting : sightings) {
      Eigen::Vector2d error;
      num_near += ErrorOf(camera, sighting, &error, nullptr) && error.norm() < 5.0;
    }
    return num_near;
  };
  EXPECT_NEAR(static_cast<double>(count(view.matches.points)), 50.0, 2.0);
  EXPECT_NEAR(static_cast<double>(count(view.matches.lines)), 20.0, 4.0);
  EXPECT_EQ(view.matches.directions.size(), 9u);  // each with each
}

// A query of 7Scenes stairs (LIMAP's test data): the steps repeat, and most segments have a wrong
// line.
class Stairs : public testing::Test {
 protected:
  void SetUp() override {
    HOLBA_SKIP_WITHOUT_DATA();
    nlohmann::json json;
    std::ifstream(DataFolder() / "limap_localization_stairs" / "stairs_1.json") >> json;
    camera_.model = FindCameraModel("SIMPLE_PINHOLE");
    camera_.width = json["camera"]["width"];
    camera_.height = json["camera"]["height"];
    camera_.params = json["camera"]["params"].get<std::vector<double>>();
    truth_ = PoseOf(json["pose_gt_cam_from_world"]);
    for (size_t i = 0; i < json["points2d"].size(); ++i) {
      const auto x = json["points2d"][i].get<std::vector<double>>();
      const auto X = json["points3d"][i].get<std::vector<double>>();
      matches_.points.push_back({{x[0], x[1]}, {X[0], X[1], X[2]}});
    }
    for (size_t i = 0; i < json["lines2d"].size(); ++i) {
      const auto ends = json["lines2d"][i].get<std::vector<std::vector<double>>>();
      const auto line = json["lines3d"][json["lines2d_candidate_lines3d"][i].get<size_t>()]
                            .get<std::vector<std::vector<double>>>();
      matches_.lines.push_back({{{ends[0][0], ends[0][1]}, {ends[1][0], ends[1][1]}},
                                PlueckerLine::FromPoints({line[0][0], line[0][1], line[0][2]},
                                                         {line[1][0], line[1][1], line[1][2]})});
    }
  }

  static Rigid3d PoseOf(const nlohmann::json& json) {
    const auto q = json["qvec"].get<std::vector<double>>();
    const auto t = json["tvec"].get<std::vector<double>>();
    return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {t[0], t[1], t[2]}};
  }
  double CentreErrorOf(const AbsolutePose& pose) const {
    return (pose.cam_from_world.OriginInA() - truth_.OriginInA()).norm();
  }
  double RotationErrorDegOf(const AbsolutePose& pose) const {
    return RadToDeg(LogRotation(pose.cam_from_world.rotation * truth_.rotation.conjugate()).norm());
  }

  Camera camera_;
  Rigid3d truth_;
  AbsolutePoseMatches matches_;
};

// LIMAP's pose from points alone, which comes with the data, is 0.33 m and 1.5 degrees off.
TEST_F(Stairs, ThePoseIsNearTheTruthAndLinesTakeItNoFartherAway) {
  AbsolutePoseMatches points = matches_;
  points.lines.clear();
  const auto without = EstimateAbsolutePose(Options(), camera_, true, points, 1);
  const auto with = EstimateAbsolutePose(Options(), camera_, true, matches_, 1);
  ASSERT_TRUE(without && with);
  EXPECT_LT(CentreErrorOf(*without), 0.08);
  EXPECT_LT(CentreErrorOf(*with), CentreErrorOf(*without) + 0.001);
  EXPECT_LT(RotationErrorDegOf(*with), RotationErrorDegOf(*without) + 0.01);
  EXPECT_GE(with->num_inliers.lines, 12u);
}

}  // namespace
}  // namespace holba
