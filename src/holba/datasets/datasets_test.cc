// SPDX-License-Identifier: BSD-3-Clause
// Each adapter on a small folder of its set's shape: a pose and a pixel that can be worked out by
// hand, and what is missing or damaged named with its file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/frontend/importers/import_testing.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/io/ply_reader.h"

namespace holba {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Datasets : public ::testing::Test {
 protected:
  void Text(const std::string& name, const std::string& text) const { folder_.Write(name, text); }
  void Photograph(const std::string& name, int width = 64, int height = 48) const {
    const fs::path path = Path(name);
    fs::create_directories(path.parent_path());
    const ColourImage image{width, height,
                            std::vector<uint8_t>(static_cast<size_t>(3 * width * height), 90)};
    WriteImage(image, path);
  }
  void Array(const std::string& name, const std::vector<hsize_t>& shape,
             const std::vector<double>& values) const {
    fs::create_directories(Path(name).parent_path());
    const hid_t file = H5Fcreate(Path(name).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
    const hid_t set =
        H5Dcreate2(file, "dataset", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Dclose(set);
    H5Sclose(space);
    H5Fclose(file);
  }
  fs::path Path(const std::string& name) const { return folder_.path() / name; }

  Dataset Read(const std::string& dataset, const std::string& part = "", int stride = 1,
               const std::string& folder = "") const {
    DatasetOptions options;
    options.part = part;
    options.stride = stride;
    const Dataset read = FindDatasetFormat(dataset)->read(Path(folder), options);
    EXPECT_EQ(read.truth.FindInconsistency(), std::nullopt);
    for (const DatasetFile& image : read.images) {
      EXPECT_TRUE(fs::is_regular_file(image.source)) << image.source;
    }
    return read;
  }
  std::string Refusal(const std::string& dataset, const std::string& part = "") const {
    try {
      DatasetOptions options;
      options.part = part;
      FindDatasetFormat(dataset)->read(folder_.path(), options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  // Pixel of a point in the world; (-1, -1): it has none.
  static Eigen::Vector2d Pixel(const Dataset& dataset, const std::string& name,
                               const Eigen::Vector3d& point) {
    for (const auto& [id, image] : dataset.truth.images) {
      if (image.name != name) continue;
      const Camera& camera = dataset.truth.cameras.at(image.camera_id);
      Eigen::Vector2d pixel;
      const Eigen::Vector3d in_cam = image.cam_from_world * point;
      if (camera.model->project(camera.params.data(), in_cam, &pixel)) return pixel;
    }
    return {-1.0, -1.0};
  }
  static std::vector<std::string> NamesOf(const std::vector<DatasetFile>& files) {
    std::vector<std::string> names;
    for (const DatasetFile& file : files) names.push_back(file.name);
    return names;
  }
  static void ExpectNear(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double tolerance) {
    EXPECT_LT((a - b).norm(), tolerance) << a.transpose() << " instead of " << b.transpose();
  }

  TestFolder folder_;
};

constexpr const char* kOnePoint =
    "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
    "property float z\nend_header\n1 0 0\n";
constexpr const char* kProject =
    "<MeshGroup><MLMesh filename=\"scan1.ply\"><MLMatrix44>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 "
    "1</MLMatrix44></MLMesh></MeshGroup>";

TEST_F(Datasets, AreFoundByNameInAnySpelling) {
  for (const DatasetFormat& format : AllDatasetFormats()) {
    EXPECT_EQ(FindDatasetFormat(format.name)->key, format.key);
    EXPECT_EQ(FindDatasetFormat(format.key)->key, format.key);
  }
  EXPECT_EQ(FindDatasetFormat("scannet++")->key, "scannetpp");
  EXPECT_EQ(FindDatasetFormat("tum rgb-d")->key, "tum_rgbd");
  EXPECT_FALSE(FindDatasetFormat("ScanNet"));
}

// --- ETH3D
class Eth3d : public Datasets {
 protected:
  void WriteDslr() const {
    Text("dslr_calibration_undistorted/cameras.txt", "0 PINHOLE 64 48 50 50 32 24\n");
    Text("dslr_calibration_undistorted/images.txt",
         "1 1 0 0 0 0 0 2 0 dslr_images_undistorted/B.JPG\n10 10 7\n"
         "2 1 0 0 0 1 0 2 0 dslr_images_undistorted/A.JPG\n11 10 7\n");
    Text("dslr_calibration_undistorted/points3D.txt", "7 0 0 0 1 2 3 0.5 1 0 2 0\n");
    Photograph("images/dslr_images_undistorted/A.JPG");
    Photograph("images/dslr_images_undistorted/B.JPG");
  }
  // Two cameras 0.1 m apart, at two instants; `bend_m` moves one of them.
  void WriteRig(double bend_m) const {
    Text("rig_calibration_undistorted/cameras.txt",
         "0 PINHOLE 64 48 50 50 32 24\n1 PINHOLE 64 48 50 50 32 24\n");
    Text("rig_calibration_undistorted/images.txt",
         "1 1 0 0 0 0 0 0 0 images_rig_cam4_undistorted/10.png\n\n"
         "2 1 0 0 0 -0.1 0 0 1 images_rig_cam5_undistorted/10.png\n\n"
         "3 1 0 0 0 1 0 0 0 images_rig_cam4_undistorted/20.png\n\n"
         "4 1 0 0 0 " +
             std::to_string(0.9 + bend_m) + " 0 0 1 images_rig_cam5_undistorted/20.png\n\n");
    Text("rig_calibration_undistorted/points3D.txt", "");
    for (const char* cam : {"4", "5"}) {
      for (const char* time : {"10", "20"}) {
        Photograph(std::string("images/images_rig_cam") + cam + "_undistorted/" + time + ".png");
      }
    }
  }
};

TEST_F(Eth3d, DslrHasItsCamerasWithoutFeaturesAndItsScans) {
  WriteDslr();
  Text("dslr_scan_eval/scan_alignment.mlp", kProject);
  Text("dslr_scan_eval/scan1.ply", kOnePoint);
  const Dataset set = Read("ETH3D");
  EXPECT_EQ(set.part, "dslr");
  EXPECT_EQ(set.truth.images.size(), 2u);
  EXPECT_TRUE(set.truth.points3D.empty());
  EXPECT_TRUE(set.truth.images.at(1).points2D.empty());
  ExpectNear(Pixel(set, "dslr_images_undistorted/A.JPG", {0, 0, 0}), {57, 24}, 1e-9);
  EXPECT_THAT(NamesOf(set.surfaces), ElementsAre("scans/scan1.ply", "scans/scan_alignment.mlp"));
  EXPECT_EQ(set.point_cloud_name, "scans/scan_alignment.mlp");
  EXPECT_EQ(Read("ETH3D", "", 2).truth.images.size(), 1u);
}

TEST_F(Eth3d, ARigBecomesARig) {
  WriteRig(0.0);
  const Dataset set = Read("ETH3D");
  EXPECT_EQ(set.part, "rig");
  ASSERT_EQ(set.truth.rigs.size(), 1u);
  EXPECT_TRUE(set.truth.has_rig_files);
  EXPECT_EQ(set.truth.frames.size(), 2u);
  EXPECT_NEAR(set.truth.rigs.at(1).sensors.at(0).sensor_from_rig->translation.x(), -0.1, 1e-12);
  EXPECT_NEAR(set.truth.images.at(4).cam_from_world.translation.x(), 0.9, 1e-12);
}

TEST_F(Eth3d, ARigThatBendsIsNone) {
  WriteRig(0.01);
  const Dataset set = Read("ETH3D");
  EXPECT_EQ(set.truth.rigs.size(), 2u);
  EXPECT_EQ(set.truth.frames.size(), 4u);
  EXPECT_NEAR(set.truth.images.at(4).cam_from_world.translation.x(), 0.91, 1e-12);
  EXPECT_THAT(set.notes, ::testing::Contains(HasSubstr("no rigs in the model")));
}

TEST_F(Eth3d, WhatIsMissingIsNamed) {
  EXPECT_THAT(Refusal("ETH3D"), HasSubstr("rig_calibration_undistorted"));
  WriteDslr();
  EXPECT_THAT(Refusal("ETH3D", "lidar"), HasSubstr("--part: expected dslr or rig"));
  fs::remove(Path("images/dslr_images_undistorted/B.JPG"));
  EXPECT_THAT(Refusal("ETH3D"), HasSubstr("dslr_images_undistorted/B.JPG: expected a photograph"));
  Text("dslr_calibration_undistorted/images.txt", "1 1 0 0 0 0 0\n");
  EXPECT_THAT(Refusal("ETH3D"), HasSubstr("images.txt:1: "));
}

// --- ScanNet++
TEST_F(Datasets, ScanNetPpHasEitherPhotographsAndTheScan) {
  Text("dslr/colmap/cameras.txt", "1 OPENCV_FISHEYE 64 48 30 30 32 24 0.01 0 0 0\n");
  Text("dslr/colmap/images.txt",
       "1 1 0 0 0 0 0 1 1 DSC00001.JPG\n\n2 1 0 0 0 0 0 2 1 DSC00002.JPG\n\n");
  Text("dslr/colmap/points3D.txt", "");
  for (const char* name : {"DSC00001.JPG", "DSC00002.JPG"}) {
    Photograph(std::string("dslr/resized_images/") + name);
    Photograph(std::string("dslr/resized_undistorted_images/") + name);
  }
  Text("dslr/nerfstudio/transforms_undistorted.json",
       R"({"w": 64, "h": 48, "fl_x": 25.0, "fl_y": 26.0, "cx": 32.5, "cy": 24.5, "frames": []})");
  Text("scans/mesh_aligned_0.05.ply", kOnePoint);
  const Dataset set = Read("ScanNet++");
  EXPECT_EQ(set.truth.cameras.at(1).model->name, "OPENCV_FISHEYE");
  EXPECT_EQ(set.mesh_name, "mesh.ply");
  EXPECT_EQ(set.point_cloud_name, "");
  const Dataset pinhole = Read("ScanNet++", "dslr_undistorted");
  EXPECT_EQ(pinhole.truth.cameras.at(1).params, (std::vector<double>{25, 26, 32.5, 24.5}));
  EXPECT_THAT(pinhole.images[0].source.string(), HasSubstr("resized_undistorted_images"));
  EXPECT_THAT(Refusal("ScanNet++", "iphone"), HasSubstr("iphone/colmap: expected a folder"));
  Text("dslr/nerfstudio/transforms_undistorted.json", R"({"w": 64})");
  EXPECT_THAT(Refusal("ScanNet++", "dslr_undistorted"), HasSubstr("fl_x, fl_y, cx and cy"));
}

// --- 7Scenes
TEST_F(Datasets, SevenScenesHasPosesFromCameraToWorldAndSplits) {
  for (const char* sequence : {"seq-01", "seq-12"}) {
    for (int i = 0; i < 2; ++i) {
      const std::string stem = std::string(sequence) + "/frame-00000" + std::to_string(i);
      Photograph(stem + ".color.png", 640, 480);
      Photograph(stem + ".depth.png", 640, 480);
      // One metre along the world's y, turned so that it looks along the world's x.
      Text(stem + ".pose.txt", "0 0 1 0\n-1 0 0 1\n0 -1 0 0\n0 0 0 1\n");
    }
  }
  Text("TrainSplit.txt", "sequence12\n");
  const Dataset set = Read("7Scenes");
  EXPECT_EQ(set.images.size(), 4u);
  EXPECT_EQ(set.truth.cameras.at(1).params, (std::vector<double>{525, 320, 240}));
  ExpectNear(Pixel(set, "seq-01/frame-000000.color.png", {2, 1, 0}), {320, 240}, 1e-9);
  // What is to the left (world y) is at smaller u, what is higher (world z) at smaller v.
  ExpectNear(Pixel(set, "seq-01/frame-000000.color.png", {2, 1.2, 0.1}), {267.5, 213.75}, 1e-9);
  EXPECT_EQ(Read("7Scenes", "train").images[0].name, "seq-12/frame-000000.color.png");
  EXPECT_EQ(Read("7Scenes", "seq-01").images.size(), 2u);
  EXPECT_EQ(Read("7Scenes", "", 1, "seq-01").images[0].name, "frame-000000.color.png");
  EXPECT_THAT(Refusal("7Scenes", "test"), HasSubstr("TestSplit.txt: expected the sequences"));
  Text("TrainSplit.txt", "seq-12\n");
  EXPECT_THAT(Refusal("7Scenes", "train"), HasSubstr("TrainSplit.txt:1: "));
  Text("seq-01/frame-000001.pose.txt", "1 0 0 0\n0 2 0 0\n0 0 1 0\n0 0 0 1\n");
  EXPECT_THAT(Refusal("7Scenes"), HasSubstr("frame-000001.pose.txt: expected 16 numbers"));
  Text("seq-01/frame-000001.pose.txt", "1 0 0 nan\n");
  EXPECT_THAT(Refusal("7Scenes"), HasSubstr("frame-000001.pose.txt:1: expected an element"));
}

// --- ICL-NUIM
TEST_F(Datasets, IclNuimIsMirroredIntoARightHandedFrame) {
  for (const char* name : {"rgb/0.png", "rgb/1.png", "rgb/2.png"}) Photograph(name, 640, 480);
  Text("associations.txt",
       "0 depth/0.png 0 rgb/0.png\n1 depth/1.png 1 rgb/1.png\n"
       "2 depth/2.png 2 rgb/2.png\n");
  // Turned by 30 degrees about the files' y axis, at (0.1, 0.2, 0.3).
  const double s = std::sin(std::numbers::pi / 12), c = std::cos(std::numbers::pi / 12);
  Text("livingRoom0.gt.freiburg",
       "1 0.1 0.2 0.3 0 " + std::to_string(s) + " 0 " + std::to_string(c) + "\n2 0 0 0 0 0 0 1\n");
  Text("living-room.obj", "v 0 1 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
  const Dataset set = Read("ICL-NUIM");
  EXPECT_EQ(set.images.size(), 3u);
  EXPECT_EQ(set.truth.images.size(), 2u);  // the first has no pose
  EXPECT_EQ(set.truth.unregistered_images.size(), 1u);
  // In the files' frame: camera from world by R^T (X - t), v = 239.5 - 480 y / z.
  const Eigen::Vector3d X(0.4, 0.9, 2.3);
  const Eigen::Vector3d d = X - Eigen::Vector3d(0.1, 0.2, 0.3);
  const double angle = std::numbers::pi / 6;
  const Eigen::Vector3d in_cam(std::cos(angle) * d.x() - std::sin(angle) * d.z(), d.y(),
                               std::sin(angle) * d.x() + std::cos(angle) * d.z());
  const Eigen::Vector2d expected(320.0 + 481.2 * in_cam.x() / in_cam.z(),
                                 240.0 - 480.0 * in_cam.y() / in_cam.z());
  ExpectNear(Pixel(set, "1.png", {X.x(), -X.y(), X.z()}), expected, 1e-3);
  ASSERT_TRUE(set.mesh);
  EXPECT_EQ(set.mesh->vertices[0], Eigen::Vector3d(0, -1, 0));
  fs::remove(Path("livingRoom0.gt.freiburg"));
  EXPECT_THAT(Refusal("ICL-NUIM"), HasSubstr("expected the trajectory NAME.gt.freiburg"));
}

// --- TUM RGB-D
TEST_F(Datasets, TumRgbdHasPosesBetweenThoseOfTheMotionCapture) {
  const std::string folder = "rgbd_dataset_freiburg1_xyz";
  for (const char* name : {"/rgb/1.00.png", "/rgb/1.05.png", "/rgb/9.00.png"})
    Photograph(folder + name, 640, 480);
  Text(folder + "/rgb.txt",
       "# color images\n1.00 rgb/1.00.png\n1.05 rgb/1.05.png\n9.00 rgb/9.00.png\n");
  Text(folder + "/groundtruth.txt",
       "# timestamp tx ty tz qx qy qz qw\n1.00 0 0 0 0 0 0 1\n1.08 0.8 0 0 0 0 0 1\n"
       "9.50 0 0 0 0 0 0 1\n");
  const Dataset set = Read("TUM RGB-D", "", 1, folder);
  EXPECT_EQ(set.part, "freiburg1");
  EXPECT_EQ(set.truth.images.size(), 2u);
  ASSERT_EQ(set.truth.unregistered_images.size(), 1u);  // the capture lost it for 8 s
  EXPECT_NEAR(set.truth.images.at(2).cam_from_world.translation.x(), -0.5, 1e-9);
  const Camera& camera = set.truth.cameras.at(1);
  EXPECT_EQ(camera.model->name, "FULL_OPENCV");
  EXPECT_NEAR(camera.params[2], 319.1, 1e-12);  // 318.6 from the centre of the first pixel
  EXPECT_NEAR(camera.params[8], 1.1633, 1e-12);
  EXPECT_EQ(Read("TUM RGB-D", "freiburg3", 2, folder).truth.cameras.at(1).model->name, "PINHOLE");
  Text(folder + "/groundtruth.txt", "1.00 0 0 0 0 0 0 2\n");
  Text("groundtruth.txt", "1.00 0 0 0 0 0 0 2\n");
  Text("rgb.txt", "1.00 rgb/1.00.png\n");
  EXPECT_THAT(Refusal("TUM RGB-D"), HasSubstr("groundtruth.txt:1: expected a quaternion"));
  Text("groundtruth.txt", "1.00 0 0 0 0 0 0 1\n");
  EXPECT_THAT(Refusal("TUM RGB-D"), HasSubstr("rgb/1.00.png: expected an image"));
  Text("groundtruth.txt", "1.00 0 0\n");
  EXPECT_THAT(Refusal("TUM RGB-D"), HasSubstr("groundtruth.txt:1: expected a position"));
  EXPECT_THAT(Refusal("TUM RGB-D", "kinect"), HasSubstr("--part: expected freiburg1"));
}

// --- EuRoC
class EuRoC : public Datasets {
 protected:
  static std::string Yaml(const std::string& matrix) {
    return "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [" + matrix +
           "]\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
           "intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv\n"
           "distortion_model: radial-tangential\n"
           "distortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]\n";
  }
  void Write() const {
    // The body's x is the cameras' z; cam1 is 0.1 m to the right of cam0.
    Text("mav0/cam0/sensor.yaml",
         Yaml("0, 0, 1, 0.05,\n -1, 0, 0, 0,\n 0, -1, 0, 0,\n 0, 0, 0, 1"));
    Text("mav0/cam1/sensor.yaml", Yaml("0, 0, 1, 0.05, -1, 0, 0, -0.1, 0, -1, 0, 0, 0, 0, 0, 1"));
    for (const char* cam : {"cam0", "cam1"}) {
      Text(std::string("mav0/") + cam + "/data.csv",
           "#timestamp [ns],filename\r\n1000000000,1000000000.png\r\n2000000000,2000000000.png\r\n"
           "9000000000,9000000000.png\r\n");
      for (const char* time : {"1", "2", "9"}) {
        Photograph(std::string("mav0/") + cam + "/data/" + time + "000000000.png", 752, 480);
      }
    }
    Text("mav0/state_groundtruth_estimate0/data.csv",
         "#timestamp, p_RS_R_x [m]\n990000000,0,0,0,1,0,0,0,0,0,0\n1010000000,0,0,1,1,0,0,0,0,0,0\n"
         "2000000000,5,0,0,1,0,0,0,0,0,0\n");
  }
};

TEST_F(EuRoC, IsARigWithThePosesOfTheBody) {
  Write();
  Text("mav0/pointcloud0/data.ply", kOnePoint);
  const Dataset set = Read("EuRoC");
  EXPECT_EQ(set.images.size(), 4u);  // one instant is outside of the trajectory
  EXPECT_EQ(set.truth.frames.size(), 2u);
  EXPECT_EQ(set.truth.rigs.size(), 1u);
  EXPECT_EQ(set.point_cloud_name, "cloud.ply");
  EXPECT_NEAR(set.truth.cameras.at(1).params[2], 367.715, 1e-12);
  // Half-way between the poses: the body is at (0, 0, 0.5), the camera 5 cm before it.
  EXPECT_LT((set.truth.CameraCentre(1) - Eigen::Vector3d(0.05, 0, 0.5)).norm(), 1e-9);
  EXPECT_LT((set.truth.CameraCentre(2) - Eigen::Vector3d(0.05, -0.1, 0.5)).norm(), 1e-9);
  ExpectNear(Pixel(set, "cam0/1000000000.png", {3.05, 0, 0.5}), {367.715, 248.875}, 1e-6);
  EXPECT_GT(Pixel(set, "cam1/1000000000.png", {3.05, -0.5, 0.5}).x(), 380.0);
  EXPECT_EQ(Read("EuRoC", "cam0").images.size(), 2u);
  EXPECT_EQ(Read("EuRoC", "", 1, "mav0").images.size(), 4u);
}

TEST_F(EuRoC, WhatIsMissingOrDamagedIsNamed) {
  Write();
  Text("mav0/cam1/sensor.yaml", Yaml("1, 0, 0"));
  EXPECT_THAT(Refusal("EuRoC"), HasSubstr("cam1/sensor.yaml: expected 'data: [..]' with 16"));
  Text("mav0/cam1/sensor.yaml", Yaml("2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"));
  EXPECT_THAT(Refusal("EuRoC"), HasSubstr("the matrix T_BS must be a rotation"));
  fs::remove(Path("mav0/cam1/sensor.yaml"));
  EXPECT_THAT(Refusal("EuRoC"), HasSubstr("cam1/sensor.yaml: expected the calibration"));
  EXPECT_THAT(Refusal("EuRoC", "cam7"), HasSubstr("cam7: expected a folder"));
  Text("mav0/cam0/data.csv", "now,1.png\n");
  EXPECT_THAT(Refusal("EuRoC", "cam0"), HasSubstr("cam0/data.csv:1: expected a time"));
}

// --- 1DSfM
TEST_F(Datasets, OneDSfMHasBundlersCamerasAndPhotographsWithoutPose) {
  Text("list.txt", "images/a.jpg 0 70.0\nimages/b.jpg 0 80.5\nimages/c.jpg\n");
  for (const char* name : {"images/a.jpg", "images/b.jpg", "images/c.jpg"}) Photograph(name);
  Text("gt_bundle.out",
       "# Bundle file v0.3\n3 1\n60 -0.1 0.02\n1 0 0\n0 1 0\n0 0 1\n0.5 0 -2\n"
       "0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n"
       "1 2 3\n10 20 30\n1 0 5 1.5 2.5\n");
  const Dataset set = Read("1DSfM");
  EXPECT_EQ(set.unit, "unknown");
  EXPECT_EQ(set.truth.images.size(), 1u);
  EXPECT_EQ(set.truth.unregistered_images.size(), 2u);
  // Bundler: P = R X + t = (1.1, 0.3, -2.5), p = -P / P.z = (0.44, 0.12), y up.
  const double r2 = 0.44 * 0.44 + 0.12 * 0.12, f = 60.0 * (1.0 - 0.1 * r2 + 0.02 * r2 * r2);
  ExpectNear(Pixel(set, "a.jpg", {0.6, 0.3, -0.5}), {32.0 + f * 0.44, 24.0 - f * 0.12}, 1e-9);
  EXPECT_NEAR(set.truth.cameras.at(2).params[0], 80.5, 1e-12);
  EXPECT_NEAR(set.truth.cameras.at(3).params[0], 1.2 * 64, 1e-12);
  Text("list.txt", "images/a.jpg\nimages/b.jpg\n");
  EXPECT_THAT(Refusal("1DSfM"), HasSubstr("gt_bundle.out: expected the 2 cameras of list.txt"));
  Text("gt_bundle.out", "# Bundle file v0.3\n2 0\n60 0 0\n1 0 0\n");
  EXPECT_THAT(Refusal("1DSfM"), HasSubstr("gt_bundle.out: expected an element of a rotation"));
  Text("gt_bundle.out", "# Bundle file v0.3\n2 0\n60 0 zero\n");
  EXPECT_THAT(Refusal("1DSfM"), HasSubstr("gt_bundle.out:3: expected k2"));
}

// Points that Bundler found are where its views of them say, in the cameras that are made of its
// file.
TEST_F(Datasets, OneDSfMProjectsARealModelOfBundlersWhereItsViewsAre) {
  HOLBA_SKIP_WITHOUT_DATA();
  const fs::path bundle = DataFolder() / "models_other" / "foreign" / "kermit_bundler.out";
  std::ifstream in(bundle);
  std::string header;
  std::getline(in, header);
  size_t num_cameras = 0, num_points = 0;
  ASSERT_TRUE(in >> num_cameras >> num_points) << bundle;
  double number = 0.0;
  for (size_t i = 0; i < 15 * num_cameras; ++i) in >> number;
  std::string list;
  for (size_t i = 0; i < num_cameras; ++i) {
    list += std::to_string(i) + ".jpg\n";
    Photograph(std::to_string(i) + ".jpg", 640, 480);
  }
  Text("list.txt", list);
  fs::copy_file(bundle, Path("gt_bundle.out"));
  const Dataset set = Read("1DSfM");
  // Two of the eleven were not found a pose.
  ASSERT_EQ(set.truth.images.size(), 9u);
  ASSERT_EQ(set.truth.unregistered_images.size(), 2u);
  std::vector<double> errors;
  for (size_t i = 0; i < num_points; ++i) {
    Eigen::Vector3d X;
    size_t num_views = 0;
    in >> X.x() >> X.y() >> X.z() >> number >> number >> number >> num_views;
    for (size_t k = 0; k < num_views; ++k) {
      size_t camera, key;
      double x, y;
      ASSERT_TRUE(in >> camera >> key >> x >> y);
      const Eigen::Vector2d pixel = Pixel(set, std::to_string(camera) + ".jpg", X);
      errors.push_back((pixel - Eigen::Vector2d(320.0 + x, 240.0 - y)).norm());
    }
  }
  ASSERT_GT(errors.size(), 1500u);
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.5);
}

// --- Hypersim
class Hypersim : public Datasets {
 protected:
  void Write() const {
    Text("ai_001_001/_detail/metadata_scene.csv",
         "parameter_name,parameter_value\nmeters_per_asset_unit,0.0254\n");
    // The second looks along the world's y, x to the right.
    Array("ai_001_001/_detail/cam_00/camera_keyframe_orientations.hdf5", {2, 3, 3},
          {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, -1, 0, 1, 0});
    Array("ai_001_001/_detail/cam_00/camera_keyframe_positions.hdf5", {2, 3}, {0, 0, 0, 100, 0, 0});
    for (const char* frame : {"0000", "0001", "0007"}) {
      const std::string stem =
          std::string("ai_001_001/images/scene_cam_00_final_preview/frame.") + frame;
      Photograph(stem + ".color.jpg", 1024, 768);
      Photograph(stem + ".tonemap.jpg", 1024, 768);
    }
  }
};

TEST_F(Hypersim, HasCamerasInMetresAndTheMeshWhereItIs) {
  Write();
  const Dataset set = Read("Hypersim", "", 1, "ai_001_001");
  EXPECT_THAT(NamesOf(set.images), ElementsAre("frame.0000.tonemap.jpg", "frame.0001.tonemap.jpg",
                                               "frame.0007.tonemap.jpg"));
  EXPECT_EQ(set.truth.images.size(), 2u);  // no key frame 7
  const double f = 512.0 / std::tan(std::numbers::pi / 6);
  EXPECT_NEAR(set.truth.cameras.at(1).params[0], f, 1e-9);
  ExpectNear(Pixel(set, "frame.0000.tonemap.jpg", {0.1, 0.2, -2}), {512 + f * 0.05, 384 - f * 0.1},
             1e-6);
  ExpectNear(Pixel(set, "frame.0001.tonemap.jpg", {2.54 + 0.1, 2, 0.2}),
             {512 + f * 0.05, 384 - f * 0.1}, 1e-6);
  EXPECT_FALSE(set.mesh);

  Array("ai_001_001/_detail/mesh/mesh_vertices.hdf5", {3, 3}, {0, 0, 0, 100, 0, 0, 0, 100, 0});
  Array("ai_001_001/_detail/mesh/mesh_faces_vi.hdf5", {1, 3}, {0, 1, 2});
  Array("ai_001_001/_detail/cam_00/camera_keyframe_frame_indices.hdf5", {2}, {0, 7});
  const Dataset whole = Read("Hypersim", "cam_00", 1, "ai_001_001");
  EXPECT_LT((whole.mesh->vertices[1] - Eigen::Vector3d(2.54, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(whole.truth.unregistered_images.begin()->second.name, "frame.0001.tonemap.jpg");
}

TEST_F(Hypersim, TheTableOfProjectionsMovesThePrincipalPoint) {
  Write();
  const std::string header =
      "scene_name,M_proj_00,M_proj_01,M_proj_02,M_proj_10,M_proj_11,M_proj_12,M_proj_30,M_proj_"
      "31\n";
  Text("metadata_camera_parameters.csv", header + "ai_001_001,1.5,0,0.1,0,2.0,-0.2,0,0\n");
  const Dataset set = Read("Hypersim", "", 1, "ai_001_001");
  EXPECT_THAT(set.truth.cameras.at(1).params,
              ElementsAre(768, 768, ::testing::DoubleNear(460.8, 1e-9),
                          ::testing::DoubleNear(307.2, 1e-9)));
  Text("metadata_camera_parameters.csv", header + "ai_001_001,1.5,0,0.1,0,2.0,-0.2,0,0.3\n");
  DatasetOptions options;
  const auto refusal = [&] {
    try {
      FindDatasetFormat("Hypersim")->read(Path("ai_001_001"), options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal(), HasSubstr("is tilted, which no camera model has"));
  fs::remove(Path("metadata_camera_parameters.csv"));
  Text("ai_001_001/_detail/cam_00/camera_keyframe_positions.hdf5", "no HDF5");
  EXPECT_THAT(refusal(), HasSubstr("camera_keyframe_positions.hdf5: "));
  Text("ai_001_001/_detail/metadata_scene.csv", "parameter_name,parameter_value\n");
  EXPECT_THAT(refusal(), HasSubstr("meters_per_asset_unit"));
}

}  // namespace
}  // namespace holba
