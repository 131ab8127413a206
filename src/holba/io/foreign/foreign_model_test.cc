// SPDX-License-Identifier: BSD-3-Clause
// Small files of each format, written here by what its documentation says, of one scene: a camera
// at a known place whose pixels of known points are worked out by hand.
#include "holba/io/foreign/foreign_model.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "holba/base/error.h"
#include "holba/io/foreign/nerfstudio.h"
#include "holba/io/foreign/ply_points.h"
#include "holba/io/foreign/xml_element.h"
#include "holba/io/model_io.h"
#include "holba/io/test_models.h"
#include "holba/scene/random_model.h"

namespace holba {
namespace {

using testing::HasSubstr;

// The camera stands at (3, 1, -2), turned to the right by 30 degrees (about y, which points down):
// its axes in the world are x (c, 0, -s), y (0, 1, 0), z (s, 0, c) with c = cos, s = sin of 30.
const double kC = std::sqrt(0.75), kS = 0.5;
const Eigen::Vector3d kCentre(3, 1, -2);
// It sees this point at the place (0.1, -0.2) of the plane at depth 1, at depth 4.
const Eigen::Vector3d kPoint =
    kCentre + 4.0 * (0.1 * Eigen::Vector3d(kC, 0, -kS) - 0.2 * Eigen::Vector3d::UnitY() +
                     Eigen::Vector3d(kS, 0, kC));
constexpr double kF = 500, kWidth = 640, kHeight = 480;

// The one posed image has the pose above, in whatever file it was.
void ExpectPose(const Reconstruction& model) {
  EXPECT_EQ(model.FindInconsistency().value_or(""), "");
  ASSERT_EQ(model.images.size(), 1u);
  const Image& image = model.images.begin()->second;
  EXPECT_LT((image.cam_from_world.OriginInA() - kCentre).norm(), 1e-12);
  EXPECT_LT((image.cam_from_world * kPoint - Eigen::Vector3d(0.4, -0.8, 4)).norm(), 1e-12);
}
// The one point is seen where the camera projects it to.
void ExpectReprojection(const Reconstruction& model, const Eigen::Vector2d& expected_px) {
  ASSERT_EQ(model.points3D.size(), 1u);
  const Point3D& point = model.points3D.begin()->second;
  EXPECT_LT((point.xyz - kPoint).norm(), 1e-12);
  ASSERT_EQ(point.track.size(), 1u);
  const Image& image = model.images.begin()->second;
  const Camera& camera = model.cameras.at(image.camera_id);
  Eigen::Vector2d pixel;
  ASSERT_TRUE(
      camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel));
  EXPECT_LT((pixel - expected_px).norm(), 1e-9);
  EXPECT_LT((image.points2D[0].xy - expected_px).norm(), 1e-9);
}

Reconstruction ReadText(const std::string& name, const std::string& text) {
  TestFolder folder;
  WriteBytes(folder / name, text);
  return ReadModel(folder.path());  // by the folder: the file is found in it
}
std::string MessageOf(const std::string& name, const std::string& text) {
  try {
    ReadText(name, text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string Point(const Eigen::Vector3d& v, const char* separator = ", ") {
  return fmt::format("{:.17g}{}{:.17g}{}{:.17g}", v.x(), separator, v.y(), separator, v.z());
}
// Rows of world to camera.
const Eigen::Vector3d kRowX(kC, 0, -kS), kRowY(0, 1, 0), kRowZ(kS, 0, kC);

std::string BundlerText() {
  // y and z of Bundler's camera point the other way.
  const Eigen::Vector3d t(-kRowX.dot(kCentre), kRowY.dot(kCentre), kRowZ.dot(kCentre));
  return fmt::format(
      "# Bundle file v0.3\n2 1\n{} 0.1 -0.02\n{}\n{}\n{}\n{}\n0 0 0\n0 0 0\n0 0 0\n"
      "0 0 0\n0 0 0\n{}\n10 20 30\n1 0 17 {:.17g} {:.17g}\n",
      kF, Point(kRowX, " "), Point(-kRowY, " "), Point(-kRowZ, " "), Point(t, " "),
      Point(kPoint, " "), kF * 0.1 * (1 + 0.1 * 0.05 - 0.02 * 0.0025),
      kF * 0.2 * (1 + 0.1 * 0.05 - 0.02 * 0.0025));
}

TEST(Bundler, IsReadWithItsAxesTurnedAndItsListOfNames) {
  const double scale = 1 + 0.1 * 0.05 - 0.02 * 0.0025;
  const Reconstruction model = ReadText("bundle.out", BundlerText());
  ExpectPose(model);
  ExpectReprojection(model, {kF * 0.1 * scale, -kF * 0.2 * scale});
  EXPECT_EQ(model.unregistered_images.size(), 1u);  // the camera without a focal length
  EXPECT_EQ(model.images.at(1).name, "camera_000000");
  TestFolder folder;
  WriteBytes(folder / "bundle/bundle.out", BundlerText());
  WriteBytes(folder / "list.txt", "./a.jpg 0 700.5\n./b.jpg\n");
  EXPECT_EQ(ReadModel(folder.path()).images.at(1).name, "a.jpg");
  EXPECT_THAT(MessageOf("bundle.out", BundlerText() + "7\n"),
              HasSubstr("bundle.out:16: expected no more"));
  EXPECT_THAT(MessageOf("bundle.out", "# Bundle file v0.3\n99999999 1\n"),
              HasSubstr("bundle.out:2: expected NUM_CAMERAS of at most"));
}

std::string OpenMvgText(const std::string& type, const std::string& distortion) {
  return fmt::format(
      R"({{"sfm_data_version": "0.3", "root_path": "/photos", "views": [)"
      R"({{"key": 7, "value": {{"polymorphic_id": 1073741824, "ptr_wrapper": {{"id": 1, "data": {{)"
      R"("local_path": "left", "filename": "a.jpg", "width": 640, "height": 480, "id_view": 7,)"
      R"("id_intrinsic": 3, "id_pose": 9}}}}}}}}], "intrinsics": [{{"key": 3, "value": {{)"
      R"("polymorphic_id": 2147483649, "polymorphic_name": "{}", "ptr_wrapper": {{"id": 2,)"
      R"("data": {{"width": 640, "height": 480, "focal_length": 500.0,)"
      R"("principal_point": [320.0, 240.0]{}}}}}}}}}], "extrinsics": [{{"key": 9, "value": {{)"
      R"("rotation": [[{}], [{}], [{}]], "center": [{}]}}}}], "structure": [{{"key": 5, "value": {{)"
      R"("X": [{}], "observations": [{{"key": 7, "value": {{"id_feat": 1, "x": [370.0, 140.0]}}}}]}}}}],)"
      R"("control_points": []}})",
      type, distortion, Point(kRowX), Point(kRowY), Point(kRowZ), Point(kCentre), Point(kPoint));
}

TEST(OpenMvg, CountsPixelsFromTheMiddleOfTheFirst) {
  const Reconstruction model = ReadText("sfm_data.json", OpenMvgText("pinhole", ""));
  ExpectPose(model);
  ExpectReprojection(model, {320 + 50 + 0.5, 240 - 100 + 0.5});
  EXPECT_EQ(model.images.at(1).name, "left/a.jpg");
  EXPECT_EQ(model.cameras.at(1).model->name, "SIMPLE_PINHOLE");
  const Reconstruction brown = ReadText(
      "sfm_data.json", OpenMvgText("pinhole_brown_t2", R"(, "disto_t2": [1, 2, 3, 4, 5])"));
  EXPECT_EQ(brown.cameras.at(1).params,
            (std::vector<double>{500, 500, 320.5, 240.5, 1, 2, 4, 5, 3, 0, 0, 0}));
  EXPECT_THAT(MessageOf("sfm_data.json", OpenMvgText("lightfield", "")),
              HasSubstr("intrinsic 3 is of the unknown type 'lightfield'"));
  EXPECT_THAT(MessageOf("sfm_data.json", OpenMvgText("pinhole_radial_k1", "")),
              HasSubstr("expected \"disto_k1\" in 'intrinsics/0/value/ptr_wrapper/data'"));
}

std::string MeshroomText(const std::string& version, const std::string& intrinsic) {
  // Column by column.
  std::string rotation;
  for (int col = 0; col < 3; ++col) {
    for (const Eigen::Vector3d& row : {kRowX, kRowY, kRowZ})
      rotation += fmt::format("{}\"{:.17g}\"", rotation.empty() ? "" : ", ", row[col]);
  }
  return fmt::format(
      R"({{"version": {}, "featuresFolders": "", "views": [{{"viewId": "1", "poseId": "1",)"
      R"("intrinsicId": "8", "path": "C:\\set\\left\\a.jpg"}}, {{"viewId": "2", "poseId": "2",)"
      R"("intrinsicId": "8", "path": "C:\\set\\right\\b.jpg"}}], "intrinsics": [{{"intrinsicId": "8",)"
      R"("width": "640", "height": "480", {}}}], "poses": [{{"poseId": "1", "pose": {{"transform": {{)"
      R"("rotation": [{}], "center": ["3", "1", "-2"]}}, "locked": "0"}}}}], "structure": [{{)"
      R"("landmarkId": "1", "color": ["1", "2", "3"], "X": [{}], "observations": [{{)"
      R"("observationId": "1", "featureId": "0", "x": ["370", "140"]}}]}}]}})",
      version, intrinsic, rotation, Point(kPoint));
}

TEST(Meshroom, IsReadWithWhatItsVersionsMean) {
  struct Case {
    const char* version;
    const char* intrinsic;
  };
  for (
      const Case& c :
      {Case{R"(["1", "0", "0"])",
            R"("type": "pinhole", "pxFocalLength": "500", "principalPoint": ["320", "240"])"},
       Case{
           R"(["1", "2", "0"])",
           R"("type": "pinhole", "pxFocalLength": ["500", "500"], "principalPoint": ["320", "240"])"},
       Case{R"(["1", "2", "6"])",
            R"("type": "pinhole", "sensorWidth": "32", "focalLength": "25", "pixelRatio": "1",)"
            R"("principalPoint": ["0", "0"], "distortionParams": "")"}}) {
    const Reconstruction model = ReadText("cameras.sfm", MeshroomText(c.version, c.intrinsic));
    ExpectPose(model);
    ExpectReprojection(model, {370.5, 140.5});
    EXPECT_EQ(model.images.at(1).name, "left/a.jpg");
    EXPECT_EQ(model.unregistered_images.at(2).name, "right/b.jpg");
  }
  const std::string focal =
      R"("sensorWidth": "32", "focalLength": "25", "pixelRatio": "2", "principalPoint": ["0", "0"],)";
  const auto fy = [&](const char* version) {
    return ReadText("cameras.sfm", MeshroomText(version, focal + R"("type": "pinhole")"))
        .cameras.at(1)
        .params.at(1);
  };
  EXPECT_EQ(fy(R"(["1", "2", "4"])"), 250);
  EXPECT_EQ(fy(R"(["1", "2", "5"])"), 1000);
  EXPECT_THAT(MessageOf("cameras.sfm",
                        MeshroomText(R"(["1", "2", "6"])", focal + R"("type": "3deanamorphic4")")),
              HasSubstr("has the distortion '3deanamorphic4', which no camera of COLMAP has"));
  EXPECT_THAT(MessageOf("cameras.sfm", MeshroomText(R"(["1", "2", "6"])", R"("type": "pinhole")")),
              HasSubstr("expected \"principalPoint\" in 'intrinsics/0'"));
}

std::string OpenSfmText(const std::string& camera) {
  const Eigen::Vector3d t(-kRowX.dot(kCentre), -kRowY.dot(kCentre), -kRowZ.dot(kCentre));
  // World to camera turns by -30 degrees about y.
  return fmt::format(R"([{{"cameras": {{"c 1": {{"width": 640, "height": 480, {}}}}},)"
                     R"("shots": {{"a.jpg": {{"camera": "c 1", "rotation": [0, {:.17g}, 0],)"
                     R"("translation": [{}]}}}}, "points": {{"12": {{"coordinates": [{}],)"
                     R"("color": [1.0, 2.0, 300.0]}}}}}}])",
                     camera, -M_PI / 6, Point(t), Point(kPoint));
}

TEST(OpenSfm, IsReadWithTheTracksBesideIt) {
  TestFolder folder;
  WriteBytes(
      folder / "reconstruction.json",
      OpenSfmText(R"("projection_type": "perspective", "focal": 0.78125, "k1": 0, "k2": 0)"));
  ExpectPose(ReadModel(folder.path()));
  // In units of 640 px, from the middle of the photograph.
  WriteBytes(
      folder / "tracks.csv",
      fmt::format(
          "OPENSFM_TRACKS_VERSION_v2\na.jpg\t12\t5\t{:.17g}\t{:.17g}\t0.004\t9\t9\t9\t-1\t-1\n"
          "b.jpg\t12\t5\t0\t0\t0.004\t9\t9\t9\t-1\t-1\n",
          50.0 / 640, -100.0 / 640));
  const Reconstruction model = ReadModel(folder / "reconstruction.json");
  ExpectPose(model);
  ExpectReprojection(model, {370, 140});
  EXPECT_EQ(model.points3D.at(1).rgb, (std::array<uint8_t, 3>{1, 2, 255}));
  WriteBytes(folder / "tracks.csv", "OPENSFM_TRACKS_VERSION_v2\na.jpg\t12\t5\tx\t0\n");
  try {
    ReadModel(folder.path());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("tracks.csv:2: expected X (a number between tabs), found 'x'"));
  }
}

TEST(OpenSfm, OfSeveralReconstructionsTheLargestIsRead) {
  const std::string camera = R"("cameras": {"c": {"width": 640, "height": 480, "focal": 1}})";
  const std::string shot = R"({"camera": "c", "rotation": [0, 0, 0], "translation": [0, 0, 1]})";
  const Reconstruction model = ReadText(
      "reconstruction.json", "[{" + camera + R"(, "shots": {"a": )" + shot + "}}, {" + camera +
                                 R"(, "shots": {"b": )" + shot + R"(, "c": )" + shot + "}}]");
  EXPECT_EQ(model.images.size(), 2u);
  ASSERT_EQ(model.unregistered_images.size(), 1u);
  EXPECT_EQ(model.unregistered_images.begin()->second.name, "a");
}

std::string MetashapeText(const std::string& calibration, const std::string& more = "") {
  return fmt::format(
      R"(<?xml version="1.0" encoding="UTF-8"?>
<document version="1.5.0"><!-- a comment --><chunk label="1" enabled="true">
<sensors next_id="1"><sensor id="0" label="A &amp; B" type="frame"><resolution width="640" height="480"/>
<calibration type="frame" class="adjusted"><f>500</f>{}</calibration></sensor></sensors>{}
<cameras><group id="0"><camera id="3" sensor_id="0" label="a.jpg"><transform>
{:.17g} 0 {:.17g} 3  0 1 0 1  {:.17g} 0 {:.17g} -2  0 0 0 1</transform></camera></group>
<camera id="4" sensor_id="0" label="b.jpg"/></cameras></chunk></document>
)",
      calibration, more, kC, kS, -kS, kC);
}

TEST(Metashape, IsReadWithItsTangentialDistortionTurnedRound) {
  const Reconstruction model = ReadText(
      "cameras.xml", MetashapeText("<cx>10</cx><cy>-5</cy><k1>0.1</k1><p1>0.01</p1><p2>0.02</p2>"));
  ExpectPose(model);
  EXPECT_EQ(model.unregistered_images.at(2).name, "b.jpg");
  const Camera& camera = model.cameras.at(1);
  Eigen::Vector2d pixel;
  const double x = 0.1, y = -0.2, r2 = x * x + y * y;
  ASSERT_TRUE(camera.model->project(camera.params.data(), Eigen::Vector3d(x, y, 1), &pixel));
  // As the manual has it.
  EXPECT_NEAR(pixel.x(),
              320 + 10 + 500 * (x * (1 + 0.1 * r2) + 0.01 * (r2 + 2 * x * x) + 2 * 0.02 * x * y),
              1e-9);
  EXPECT_NEAR(pixel.y(),
              240 - 5 + 500 * (y * (1 + 0.1 * r2) + 0.02 * (r2 + 2 * y * y) + 2 * 0.01 * x * y),
              1e-9);
}

TEST(Metashape, FaultsAreNamedWithTheirLine) {
  EXPECT_THAT(MessageOf("cameras.xml", MetashapeText("<k1>abc</k1>")),
              HasSubstr("cameras.xml:4: expected a finite number in <k1>, found 'abc'"));
  std::string text = MetashapeText("");
  EXPECT_THAT(MessageOf("cameras.xml", text.substr(0, text.size() - 20)),
              HasSubstr("is truncated here"));
  text.replace(text.find("sensor_id=\"0\""), 13, "sensor_id=\"7\"");
  EXPECT_THAT(MessageOf("cameras.xml", text),
              HasSubstr("expected sensor_id of a <sensor> of the chunk, found '7'"));
  EXPECT_THAT(MessageOf("cameras.xml", "<document><chunk/></document>"),
              HasSubstr("expected a <chunk> with <cameras>"));
}

TEST(Xml, TextEntitiesAndDepth) {
  const XmlElement root = ParseXml("<a x='1 &lt; 2'>t&amp;u<b/><![CDATA[<c>]]></a>", "x.xml");
  EXPECT_EQ(root.Attribute("x"), "1 < 2");
  EXPECT_EQ(root.text, "t&u<c>");
  EXPECT_NE(root.Find("b"), nullptr);
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  EXPECT_THROW(ParseXml(deep, "x.xml"), InputError);
  EXPECT_THROW(ParseXml("<!DOCTYPE a [<!ENTITY b \"c\">]><a/>", "x.xml"), InputError);
}

std::string NerfstudioText(const std::string& camera) {
  // OpenGL's axes: y and z of the camera turned round.
  return fmt::format(
      R"({{{}, "frames": [{{"file_path": "./images/a.jpg", "transform_matrix":)"
      R"([[{:.17g}, 0, {:.17g}, 3], [0, -1, 0, 1], [{:.17g}, 0, {:.17g}, -2], [0, 0, 0, 1]]}}]}})",
      camera, kC, -kS, -kS, -kC);
}

TEST(Nerfstudio, IsReadWithOpenGlsAxes) {
  const Reconstruction model =
      ReadText("transforms.json",
               NerfstudioText(R"("w": 640, "h": 480.0, "fl_x": 500, "fl_y": 501, "cx": 321)"));
  ExpectPose(model);
  EXPECT_EQ(model.images.at(1).name, "a.jpg");
  EXPECT_EQ(model.cameras.at(1).params, (std::vector<double>{500, 501, 321, 240}));
  const Reconstruction by_angle =
      ReadText("transforms.json",
               NerfstudioText(R"("w": 640, "h": 480, "camera_angle_x": 1.5707963267948966)"));
  EXPECT_NEAR(by_angle.cameras.at(1).params[0], 320, 1e-9);
  EXPECT_THAT(MessageOf("transforms.json", NerfstudioText(R"("fl_x": 500)")),
              HasSubstr("expected the size of the photograph, \"w\" and \"h\", for 'frames/0'"));
  EXPECT_THAT(MessageOf("transforms.json", NerfstudioText(R"("w": 640, "h": 480)")),
              HasSubstr("\"fl_x\""));
}

TEST(Nerfstudio, WhatIsWrittenIsReadBack) {
  Reconstruction model;
  const std::vector<std::pair<const char*, std::vector<double>>> cameras = {
      {"SIMPLE_PINHOLE", {500, 320, 240}},
      {"PINHOLE", {500, 510, 320, 240}},
      {"SIMPLE_RADIAL", {500, 320, 240, 0.1}},
      {"RADIAL", {500, 320, 240, 0.1, 0.2}},
      {"OPENCV", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4}},
      {"FULL_OPENCV", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0}},
      {"OPENCV_FISHEYE", {500, 510, 320, 240, 0.1, 0.2, 0.3, 0.4}}};
  Random random(3);
  for (const auto& [name, params] : cameras) {
    const auto id = static_cast<camera_t>(model.cameras.size() + 1);
    model.cameras.Add(
        id, {.model = FindCameraModel(name), .width = 640, .height = 480, .params = params});
    const Eigen::Quaterniond q(random.Normal(), random.Normal(), random.Normal(), random.Normal());
    Image image;
    image.name = fmt::format("left/{}.jpg", name);
    image.camera_id = id;
    image.cam_from_world = Rigid3d(q.normalized(), {random.Normal(), random.Normal(), 7});
    model.images.Add(id, image);
  }
  model.AddTrivialRigsAndFrames();
  model.AddPoint3D({1, 2, 3}, {}, PointOrigin::kDetected, {7, 8, 9});
  TestFolder folder;
  WriteNerfstudio(model, folder.path());
  EXPECT_THAT(ListFolder(folder.path()), testing::ElementsAre("sparse_pc.ply", "transforms.json"));
  const Reconstruction again = ReadModel(folder.path());
  ASSERT_EQ(again.images.size(), model.images.size());
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(again.images.at(id).name, image.name);
    EXPECT_EQ(again.cameras.at(id).params, model.cameras.at(id).params) << image.name;
    EXPECT_EQ(again.cameras.at(id).model, model.cameras.at(id).model) << image.name;
    const Rigid3d difference = again.images.at(id).cam_from_world * image.cam_from_world.Inverse();
    EXPECT_LT(difference.translation.norm() + LogRotation(difference.rotation).norm(), 1e-12);
  }
  ASSERT_EQ(again.points3D.size(), 1u);
  EXPECT_EQ(again.points3D.at(1).xyz, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(again.points3D.at(1).rgb, (std::array<uint8_t, 3>{7, 8, 9}));
  model.cameras.at(1) = {.model = FindCameraModel("FOV"),
                         .width = 640,
                         .height = 480,
                         .params = {500, 500, 320, 240, 0.5}};
  EXPECT_THROW(WriteNerfstudio(model, folder.path()), InputError);
}

TEST(PlyPoints, TextAndBinaryAreReadAndDamageIsRefused) {
  const std::string header =
      "ply\nformat ascii 1.0\ncomment x\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 0\nproperty list uchar int vertex_indices\nend_header\n";
  const std::vector<PlyPoint> points =
      ParsePlyPoints(header + "1 2 3 4 5 6\n-1 0.5 1e3 0 0 255\n", "x.ply");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].xyz, Eigen::Vector3d(-1, 0.5, 1000));
  EXPECT_EQ(points[1].rgb[2], 255);
  EXPECT_THROW(ParsePlyPoints(header + "1 2 3 4 5 6\n-1 0.5", "x.ply"), InputError);
  EXPECT_THROW(
      ParsePlyPoints("ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\n"
                     "property float y\nproperty float z\nend_header\n1 2 3\n",
                     "x.ply"),
      InputError);
  EXPECT_THROW(ParsePlyPoints("ply\nend_header\n", "x.ply"), InputError);
}

TEST(ForeignModels, AFileOfNoFormatIsTakenForABalProblem) {
  EXPECT_THAT(MessageOf("x.txt", "hello"), HasSubstr("expected a COLMAP model in this folder"));
  TestFolder folder;
  WriteBytes(folder / "x.json", "{\"a\": 1}");
  EXPECT_TRUE(IsReadAsBal(folder / "x.json"));
  EXPECT_THROW(ReadModel(folder / "x.json"), InputError);
}

TEST(RotationFromMatrix, RefusesReflectionsAndStretches) {
  EXPECT_FALSE(RotationFromMatrix(Eigen::Vector3d(1, 1, -1).asDiagonal()));
  EXPECT_FALSE(RotationFromMatrix(2.0 * Eigen::Matrix3d::Identity()));
  EXPECT_TRUE(RotationFromMatrix((1.0 + 1e-4) * Eigen::Matrix3d::Identity()));
}

}  // namespace
}  // namespace holba
