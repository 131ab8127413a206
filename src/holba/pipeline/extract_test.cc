// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/extract.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>

#include "holba/base/error.h"
#include "holba/frontend/onnx/onnx_testing.h"
#include "holba/frontend/photographs/exif_testing.h"
#include "holba/pipeline/pipeline_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Extract : public PipelineTest {
 protected:
  void SetUp() override {
    PipelineTest::SetUp();
    options_.num_threads = 2;
    options_.reader.camera_model = "PINHOLE";
    options_.reader.camera_params = "200,200,120,90";
    options_.reader.single_camera = true;
  }

  std::filesystem::path DatabasePath(const std::string& name) const {
    return folder_ / "databases" / name;
  }
  ExtractReport Run(const std::string& name) {
    Database database(DatabasePath(name));
    return ExtractFeaturesOf(options_, folder_, &database, {});
  }
  std::string MessageOfRun(const std::string& name) {
    try {
      options_.Check();
      Run(name);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  ExtractOptions options_;
};

// All that extraction writes.
void ExpectSameDatabases(const std::filesystem::path& path1, const std::filesystem::path& path2) {
  const Database a(path1), b(path2);
  const auto cameras = a.ReadCameras(), other_cameras = b.ReadCameras();
  ASSERT_EQ(cameras.size(), other_cameras.size());
  for (const auto& [camera_id, camera] : cameras) {
    EXPECT_EQ(ToString(camera.camera), ToString(other_cameras.at(camera_id).camera));
    EXPECT_EQ(camera.has_prior_focal_length, other_cameras.at(camera_id).has_prior_focal_length);
  }
  const auto images = a.ReadImages(), other_images = b.ReadImages();
  ASSERT_EQ(images.size(), other_images.size());
  for (const auto& [id, image] : images) {
    EXPECT_EQ(image.name, other_images.at(id).name);
    EXPECT_EQ(image.camera_id, other_images.at(id).camera_id);
    EXPECT_EQ(a.ReadKeypoints(id).value().data, b.ReadKeypoints(id).value().data);
    EXPECT_EQ(a.ReadDescriptors(id).value().data, b.ReadDescriptors(id).value().data);
    const std::string settings = a.ReadSegmentSettings(id).value();
    EXPECT_EQ(settings, b.ReadSegmentSettings(id).value());
    const auto segments = a.ReadSegments(id, settings).value(),
               other_segments = b.ReadSegments(id, settings).value();
    ASSERT_EQ(segments.size(), other_segments.size());
    for (size_t i = 0; i < segments.size(); ++i) {
      EXPECT_EQ(segments[i].start, other_segments[i].start);
      EXPECT_EQ(segments[i].end, other_segments[i].end);
    }
    EXPECT_EQ(a.ReadSegmentDescriptors(id, settings).value(),
              b.ReadSegmentDescriptors(id, settings).value());
    EXPECT_EQ(a.ReadCorners(id, settings)->positions, b.ReadCorners(id, settings)->positions);
  }
  const DatabaseSummary summary = a.Summarise(), other_summary = b.Summarise();
  EXPECT_EQ(summary.num_frames, other_summary.num_frames);
  EXPECT_EQ(summary.num_rigs, other_summary.num_rigs);
  for (size_t i = 0; i < summary.images.size(); ++i)
    EXPECT_EQ(summary.images[i].num_vanishing_points, other_summary.images[i].num_vanishing_points);
}

TEST_F(Extract, WritesPointsAndStructureOfEachPhotograph) {
  const ExtractReport report = Run("a.db");
  ASSERT_EQ(report.images.size(), 3u);
  const Database database(DatabasePath("a.db"));
  const DatabaseSummary summary = database.Summarise();
  ASSERT_EQ(summary.cameras.size(), 1u);
  EXPECT_THAT(summary.cameras.at(1).camera.params, ElementsAre(200, 200, 120, 90));
  EXPECT_TRUE(summary.cameras.at(1).has_prior_focal_length);
  EXPECT_EQ(summary.num_rigs, 1u);
  EXPECT_EQ(summary.num_frames, 3u);
  EXPECT_EQ(summary.num_pose_priors, 0u);
  ASSERT_EQ(summary.images.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const DatabaseSummary::OfImage& image = summary.images[i];
    EXPECT_EQ(image.image_id, i + 1);
    EXPECT_EQ(image.name, std::vector<std::string>({"3.png", "5.png", "8.png"})[i]);
    const SiftFeatures expected = DetectSift(options_.sift, ReadGreyImage(folder_ / image.name));
    EXPECT_GT(expected.keypoints.size(), 20u);
    EXPECT_EQ(database.ReadKeypoints(image.image_id)->data, expected.keypoints.data);
    EXPECT_EQ(database.ReadKeypoints(image.image_id)->num_cols, 6);
    EXPECT_EQ(database.ReadDescriptors(image.image_id)->data, expected.descriptors.data);
    EXPECT_EQ(report.images[i].num_keypoints, expected.keypoints.size());
    EXPECT_EQ(report.images[i].num_segments, image.num_segments);
    EXPECT_GE(image.num_segments.value(), 24u);  // six rectangles of four sides
  }
}

TEST_F(Extract, WhatItFindsIsWhatRefineWouldFind) {
  Run("a.db");
  Database database(DatabasePath("a.db"));
  DetectionReport report;
  std::map<image_t, ImportedSegments> imported;
  DetectFeatures({}, folder_, model_, database.MatchImages(model_), &database, &imported, &report);
  EXPECT_EQ(report.images_reused, 3u);
  // A distorting model without distortion is the same to lines.
  options_.reader.camera_model = "OPENCV";
  options_.reader.camera_params = "200,200,120,90,0,0,0,0";
  Run("b.db");
  Database other(DatabasePath("b.db"));
  report = {};
  DetectFeatures({}, folder_, model_, other.MatchImages(model_), &other, &imported, &report);
  EXPECT_EQ(report.images_reused, 3u);
}

TEST_F(Extract, TheDatabaseDoesNotDependOnThreads) {
  Run("a.db");
  options_.num_threads = 1;
  Run("b.db");
  ExpectSameDatabases(DatabasePath("a.db"), DatabasePath("b.db"));
}

TEST_F(Extract, AKilledRunLeavesAWholeDatabaseThatTheNextRunCompletes) {
  Run("undisturbed.db");
  for (size_t num_done = 1; num_done <= 3; ++num_done) {
    const std::string name = "killed" + std::to_string(num_done) + ".db";
    const pid_t child = fork();
    if (child == 0) {
      Database database(DatabasePath(name));
      ExtractFeaturesOf(options_, folder_, &database, [&](size_t done, size_t) {
        if (done == num_done) _exit(9);  // nothing is closed or flushed
      });
      _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_EQ(WEXITSTATUS(status), 9);
    {
      const Database database(DatabasePath(name));
      const DatabaseSummary summary = database.Summarise();
      EXPECT_EQ(summary.images.size(), num_done);
      EXPECT_EQ(summary.num_frames, num_done);
      for (const auto& image : summary.images) {
        EXPECT_TRUE(image.num_keypoints && image.num_descriptors && image.num_vanishing_points);
      }
    }
    const ExtractReport report = Run(name);
    size_t num_kept = 0;
    for (const auto& image : report.images) num_kept += image.points_kept && image.structure_kept;
    EXPECT_EQ(num_kept, num_done);
    ExpectSameDatabases(DatabasePath("undisturbed.db"), DatabasePath(name));
  }
}

TEST_F(Extract, ABadPictureIsNamedAndLeftOutOrStopsAStrictRun) {
  Write("4.png", "no picture");
  Write("6.webp", "not read");
  const ExtractReport report = Run("a.db");
  ASSERT_EQ(report.images.size(), 5u);
  EXPECT_THAT(report.images[1].fault.value(), HasSubstr("4.png"));
  EXPECT_THAT(report.images[3].fault.value(), HasSubstr("6.webp"));
  EXPECT_EQ(Database(DatabasePath("a.db")).ReadImages().size(), 3u);
  options_.strict = true;
  EXPECT_THAT(MessageOfRun("b.db"), HasSubstr("4.png"));
  // What came before it is there.
  EXPECT_EQ(Database(DatabasePath("b.db")).ReadImages().size(), 1u);
  // The first one in the order of names, however many are worked on at a time.
  for (const int num_threads : {1, 2, 5}) {
    options_.num_threads = num_threads;
    const std::string name = "strict" + std::to_string(num_threads) + ".db";
    EXPECT_THAT(MessageOfRun(name), testing::AllOf(HasSubstr("4.png"), HasSubstr("(1 of 5 ")));
    ExpectSameDatabases(DatabasePath("b.db"), DatabasePath(name));
  }
  options_.strict = false;
  // Pixels that cannot be decoded behind a header that can.
  std::filesystem::resize_file(folder_ / "3.png", 200);
  std::filesystem::resize_file(folder_ / "5.png", 200);
  std::filesystem::resize_file(folder_ / "8.png", 200);
  EXPECT_THAT(MessageOfRun("c.db"), HasSubstr("(5 of 5 photographs cannot be used)"));
  EXPECT_TRUE(Database(DatabasePath("c.db")).ReadCameras().empty());
}

TEST_F(Extract, PhotographsOfOneCameraHaveOneSize) {
  WriteImage(ColourImage{20, 10, std::vector<uint8_t>(600, 90)}, folder_ / "9.png");
  const ExtractReport report = Run("a.db");
  EXPECT_THAT(report.images[3].fault.value(),
              HasSubstr("expected 240 x 180 pixels, the size of its camera, found 20 x 10 pixels"));
  options_.reader.single_camera = false;
  const ExtractReport separate = Run("b.db");
  EXPECT_FALSE(separate.images[3].fault);
  EXPECT_EQ(separate.num_cameras, 4u);
}

TEST_F(Extract, MasksOfImagesAndOfTheCameraSayWhereFeaturesAre) {
  std::filesystem::create_directories(folder_ / "masks");
  ColourImage mask{kWidth, kHeight, std::vector<uint8_t>(3 * kWidth * kHeight, 255)};
  for (int y = 0; y < kHeight; ++y)
    std::fill_n(mask.pixels.begin() + 3 * kWidth * y, 3 * kWidth / 2, 0);
  WriteImage(mask, folder_ / "masks" / "3.png.png");
  WriteImage(mask, folder_ / "masks" / "5.png");  // with COLMAP's other name
  WriteImage(mask, folder_ / "masks" / "8.png.png");
  // Photographs are below the same folder here: only the three are meant.
  options_.image_list_path = Write("list.txt", "5.png\n3.png\n\n8.png\r\n").string();
  options_.reader.mask_path = (folder_ / "masks").string();
  const ExtractReport report = Run("a.db");
  ASSERT_EQ(report.images.size(), 3u);
  EXPECT_EQ(report.images[0].name, "3.png");
  const Database database(DatabasePath("a.db"));
  for (image_t id = 1; id <= 3; ++id) {
    const Keypoints keypoints = database.ReadKeypoints(id).value();
    EXPECT_GT(keypoints.size(), 5u);
    for (size_t i = 0; i < keypoints.size(); ++i) EXPECT_GE(keypoints.Position(i).x(), kWidth / 2);
    const std::string settings = database.ReadSegmentSettings(id).value();
    const auto segments = database.ReadSegments(id, settings).value();
    for (const LineSegment2d& segment : segments)
      EXPECT_GE(std::min(segment.start.x(), segment.end.x()), kWidth / 2 - 1e-9);
  }
  options_.reader.mask_path.clear();
  options_.reader.camera_mask_path = (folder_ / "masks" / "5.png").string();
  Run("b.db");
  const Database other(DatabasePath("b.db"));
  for (image_t id = 1; id <= 3; ++id)
    EXPECT_EQ(database.ReadKeypoints(id)->data, other.ReadKeypoints(id)->data);
}

TEST_F(Extract, KeepsThePointsOfOtherProgramsAndAddsStructureToThem) {
  Keypoints keypoints;
  keypoints.data = {10, 20, 30, 40};
  {
    Database database(DatabasePath("a.db"));
    const Camera camera{FindCameraModel("SIMPLE_RADIAL"), kWidth, kHeight, {210, 120, 90, 0.01}};
    database.AddCamera(7, {camera, false});
    database.AddImage(9, {"5.png", 7});
    database.WriteKeypoints(9, keypoints);
    database.WriteDescriptors(9, {0, 128, std::vector<uint8_t>(256, 3)});
  }
  const ExtractReport report = Run("a.db");
  EXPECT_TRUE(report.images[1].points_kept);
  EXPECT_FALSE(report.images[1].structure_kept);
  const Database database(DatabasePath("a.db"));
  EXPECT_EQ(database.ReadKeypoints(9)->data, keypoints.data);
  const DatabaseSummary summary = database.Summarise();
  ASSERT_EQ(summary.images.size(), 3u);
  for (const auto& image : summary.images) {
    // The camera of the one that was there is that of all.
    EXPECT_EQ(image.camera_id, 7u);
    EXPECT_GE(image.num_segments.value(), 20u);
  }
}

TEST_F(Extract, ExifSaysCamerasFocalLengthsAndWhereThePhotographerStood) {
  options_.reader = {};
  options_.structure = false;
  ExifWriter with(false);
  with.Text(ExifWriter::kMain, 0x010F, "Maker");
  with.Text(ExifWriter::kMain, 0x0110, "Model");
  with.Short(ExifWriter::kMain, 0x0112, 8);
  with.Short(ExifWriter::kCamera, 0xA405, 35);
  with.Rationals(ExifWriter::kGps, 2, {{47, 1}, {30, 1}, {0, 1}});
  with.Rationals(ExifWriter::kGps, 4, {{8, 1}, {15, 1}, {0, 1}});
  with.Rationals(ExifWriter::kGps, 6, {{408, 1}});
  AddExif(folder_ / "3.png", with.Bytes());
  AddExif(folder_ / "8.png", with.Bytes());
  const ExtractReport report = Run("a.db");
  EXPECT_EQ(report.num_cameras, 2u);
  EXPECT_EQ(report.num_cameras_with_prior_focal_length, 1u);
  const Database database(DatabasePath("a.db"));
  const auto images = database.ReadImages();
  EXPECT_EQ(images.at(1).camera_id, images.at(3).camera_id);
  EXPECT_NE(images.at(1).camera_id, images.at(2).camera_id);
  const DatabaseCamera known = database.ReadCameras().at(images.at(1).camera_id),
                       other = database.ReadCameras().at(images.at(2).camera_id);
  EXPECT_TRUE(known.has_prior_focal_length);
  EXPECT_NEAR(known.camera.params[0], 35.0 / 43.27 * std::hypot(240.0, 180.0), 1e-9);
  EXPECT_FALSE(other.has_prior_focal_length);
  EXPECT_THAT(other.camera.params, ElementsAre(1.2 * 240, 120, 90, 0));
  const std::map<image_t, PosePrior> priors = database.ReadPosePriors();
  const PosePrior& prior = priors.at(3);
  EXPECT_EQ(prior.position, Eigen::Vector3d(47.5, 8.25, 408.0));
  EXPECT_EQ(prior.system, PosePrior::System::kWgs84);
  EXPECT_EQ(prior.gravity_in_cam, Eigen::Vector3d(-1, 0, 0));
  EXPECT_FALSE(priors.contains(2));
}

// As numpy writes an array.
std::string Npy(const std::string& shape, const std::vector<float>& values) {
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': " + shape + ", }";
  header.resize(117, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size());
  bytes += '\0';
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
  return bytes;
}

TEST_F(Extract, TakesThePointsOfHlocInsteadOfSift) {
  Write("points/3.png/keypoints.npy", Npy("(2, 2)", {10, 20, 30.5, 40}));
  // Column by column: three values for each key point.
  Write("points/3.png/descriptors.npy", Npy("(3, 2)", {1, 4, 2, 5, 3, 6}));
  Write("points/5.png/keypoints.npy", Npy("(1, 2)", {0, 179}));
  options_.image_list_path = Write("list.txt", "3.png\n5.png\n8.png\n").string();
  options_.points_path = (folder_ / "points").string();
  const ExtractReport report = Run("a.db");
  const Database database(DatabasePath("a.db"));
  EXPECT_THAT(database.ReadKeypoints(1)->data, ElementsAre(10.5f, 20.5f, 31.0f, 40.5f));
  const Descriptors descriptors = database.ReadDescriptors(1).value();
  EXPECT_EQ(descriptors.type, -1);
  EXPECT_EQ(descriptors.num_bytes, 12);
  float values[6];
  ASSERT_EQ(descriptors.data.size(), sizeof(values));
  std::memcpy(values, descriptors.data.data(), sizeof(values));
  EXPECT_THAT(values, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_EQ(database.NumKeypoints(2), 1u);
  EXPECT_EQ(database.NumKeypoints(3), 0u);
  EXPECT_GE(report.images[2].num_segments, 24u);
  // Paired by the ends of their paths.
  Write("set/images/3.jpg/keypoints.npy", Npy("(2, 2)", {10, 20, 30.5, 40}));
  options_.points_path = (folder_ / "set").string();
  Run("paired.db");
  EXPECT_EQ(Database(DatabasePath("paired.db")).NumKeypoints(1), 2u);
  options_.points_path = (folder_ / "points").string();
  Write("points/5.png/keypoints.npy", Npy("(1, 2)", {0, 1179}));
  EXPECT_THAT(MessageOfRun("b.db"), HasSubstr("outside of the image of 240 x 180"));
  options_.points_path = (folder_ / "elsewhere").string();
  EXPECT_THAT(MessageOfRun("b.db"), HasSubstr("there is no such file or folder; check --Import"));
  Write("elsewhere/4.png/keypoints.npy", Npy("(1, 2)", {0, 0}));
  EXPECT_THAT(MessageOfRun("b.db"), HasSubstr("expected names like '3.png', found '4.png'"));
}

TEST_F(Extract, EveryCameraModelHasParametersToStartFrom) {
  for (const CameraModel* model : AllCameraModels()) {
    const Camera camera = DefaultCamera(*model, 250.0, 200, 100);
    Eigen::Vector2d pixel;
    ASSERT_TRUE(model->project(camera.params.data(), Eigen::Vector3d(0, 0, 1), &pixel))
        << model->name;
    EXPECT_NEAR(pixel.x(), 100.0, 1e-9) << model->name;
    EXPECT_NEAR(pixel.y(), 50.0, 1e-9) << model->name;
    if (model->name == "EQUIRECTANGULAR") continue;
    // A small angle is its focal length times as many pixels.
    ASSERT_TRUE(model->project(camera.params.data(), Eigen::Vector3d(1e-4, 0, 1), &pixel));
    EXPECT_NEAR(pixel.x(), 100.0 + 250.0 * 1e-4, 1e-4) << model->name;
  }
}

TEST_F(Extract, RefusesOptionsThatDoNotGoTogether) {
  options_.reader.single_camera_per_folder = true;
  EXPECT_THAT(MessageOfRun("a.db"),
              HasSubstr("expected at most one of --ImageReader.single_camera, "));
  options_.reader.single_camera_per_folder = false;
  options_.reader.camera_params = "200,200,120";
  EXPECT_THAT(MessageOfRun("a.db"),
              HasSubstr("expected the 4 parameters of PINHOLE (fx fy cx cy), found 3"));
  options_.reader.camera_params = "200,200,120,x";
  EXPECT_THAT(MessageOfRun("a.db"), HasSubstr("'x' is no number"));
  options_.reader.camera_model = "PINHOL";
  EXPECT_THAT(MessageOfRun("a.db"), HasSubstr("expected one of SIMPLE_PINHOLE, PINHOLE"));
  options_.reader = {};
  options_.reader.existing_camera_id = 4;
  EXPECT_THAT(MessageOfRun("a.db"), HasSubstr("there is no camera 4"));
  options_.reader = {};
  options_.image_list_path = (folder_ / "no.txt").string();
  EXPECT_THAT(MessageOfRun("a.db"), HasSubstr("no.txt: there is no such file"));
  options_.image_list_path = Write("none.txt", "\n").string();
  EXPECT_THAT(MessageOfRun("a.db"),
              HasSubstr("expected the names of photographs, one a line, found none"));
}

TEST_F(Extract, AModelOfTheUserFindsThePointsInPlaceOfSift) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  // Two points whatever the picture.
  TinyModel()
      .Input("x", TinyModel::kFloat, {1, 1, -1, -1})
      .Output("k", TinyModel::kFloat, {2, 2})
      .Output("d", TinyModel::kFloat, {2, 4})
      .Constant<float>("points", {2, 2}, {10, 20, 30, 40})
      .Constant<float>("looks", {2, 4}, {1, 0, 0, 0, 0, 1, 0, 0})
      .Node("Identity", {"points"}, {"k"})
      .Node("Identity", {"looks"}, {"d"})
      .Write(folder_ / "m.onnx");
  options_.onnx_points_path = Write("m.json", R"({"kind": "points", "model": "m.onnx",
      "inputs": {"image": "x"}, "outputs": {"keypoints": "k", "descriptors": "d"}})");
  options_.structure = false;
  Run("a.db");
  const Database database(DatabasePath("a.db"));
  for (const auto& [id, image] : database.ReadImages()) {
    EXPECT_EQ(database.ReadKeypoints(id)->data, (std::vector<float>{10.5f, 20.5f, 30.5f, 40.5f}));
    EXPECT_EQ(database.ReadDescriptors(id)->type, -1);
    EXPECT_EQ(database.ReadDescriptors(id)->num_bytes, 16);
  }
  // A fault of the model is that of the run.
  options_.onnx_points_path = Write("n.json", "{}");
  EXPECT_THAT(MessageOfRun("b.db"), testing::HasSubstr("n.json: 'kind': expected a text"));
  options_.points_path = "points.h5";
  EXPECT_THAT(MessageOfRun("c.db"), testing::HasSubstr("both bring key points; give one"));
}

}  // namespace
}  // namespace holba
