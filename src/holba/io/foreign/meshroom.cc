// SPDX-License-Identifier: BSD-3-Clause
// Meshroom's (AliceVision's) cameras.sfm and other files of its JSON form, versions 1.0 to 1.2:
// lists of views, intrinsics, poses (rotation of world to camera, column by column, and camera
// centre), rigs and, if it was exported with them, structure with observations. Numbers are text.
// What changed between versions: the principal point is counted from the middle of the image since
// 1.2.1; the focal length is in millimetres of the sensor since 1.2.2; pixelRatio was its inverse
// before 1.2.5. As in OpenMVG, from which it comes, pixels count from the middle of the first one,
// which is half a pixel from where COLMAP counts from.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/json_value.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr double kHalfPixel = 0.5;
using Version = std::array<uint64_t, 3>;

bool Recognises(std::string_view bytes) {
  return bytes.find("\"viewId\"") != std::string_view::npos &&
         bytes.find("\"intrinsicId\"") != std::string_view::npos;
}

std::vector<JsonValue> ListIfAny(const JsonValue& json, const std::string& key) {
  const std::optional<JsonValue> found = json.Find(key);
  // An empty list is written as empty text.
  if (!found || (!found->IsList() && !found->IsObject())) return {};
  return found->List();
}

camera_t AddIntrinsics(const JsonValue& json, const Version& version, ForeignModel* model) {
  const std::string what = fmt::format("intrinsic {}", json.At("intrinsicId").Whole());
  const uint64_t width = json.At("width").Whole(), height = json.At("height").Whole();
  const auto w = static_cast<double>(width), h = static_cast<double>(height);
  PinholeLens lens;
  const std::vector<double> centre = json.At("principalPoint").Reals(2);
  lens.cx = centre[0] + kHalfPixel, lens.cy = centre[1] + kHalfPixel;
  if (version >= Version{1, 2, 1}) lens.cx += 0.5 * w, lens.cy += 0.5 * h;
  if (version < Version{1, 2, 0}) {
    lens.fx = lens.fy = json.At("pxFocalLength").Real();
  } else if (version < Version{1, 2, 2}) {
    const std::vector<double> f = json.At("pxFocalLength").Reals(2);
    lens.fx = f[0], lens.fy = f[1];
  } else {
    const double sensor_width = json.At("sensorWidth").Real(), ratio = json.RealOr("pixelRatio", 1);
    if (!(sensor_width > 0.0)) json.At("sensorWidth").FailExpected("a number above 0");
    if (!(ratio > 0.0)) json.At("pixelRatio").FailExpected("a number above 0");
    lens.fx = json.At("focalLength").Real() / sensor_width * w;
    lens.fy = version < Version{1, 2, 5} ? lens.fx / ratio : lens.fx * ratio;
  }
  std::vector<double> k;
  for (const JsonValue& value : ListIfAny(json, "distortionParams")) k.push_back(value.Real());
  // In later files the distortion has a type of its own.
  std::string type = json.At("type").Text();
  if (type == "pinhole") type = json.TextOr("distortionType", type);
  const auto needs = [&](size_t count) {
    if (k.size() != count)
      json.At("distortionParams").FailExpected(fmt::format("{} numbers for '{}'", count, type));
  };
  if (type == "radial1" || type == "radialk1") {
    needs(1);
    lens.k1 = k[0];
  } else if (type == "radial3" || type == "radialk3") {
    needs(3);
    lens.k1 = k[0], lens.k2 = k[1], lens.k3 = k[2];
  } else if (type == "brown") {
    needs(5);
    lens.k1 = k[0], lens.k2 = k[1], lens.k3 = k[2], lens.p1 = k[3], lens.p2 = k[4];
  } else if (type == "fisheye4") {
    needs(4);
    return model->AddCamera(what, "OPENCV_FISHEYE", width, height,
                            {lens.fx, lens.fy, lens.cx, lens.cy, k[0], k[1], k[2], k[3]});
  } else if (type == "fisheye1") {
    needs(1);
    return model->AddCamera(what, "FOV", width, height, {lens.fx, lens.fy, lens.cx, lens.cy, k[0]});
  } else if (type != "pinhole" && type != "none") {
    json.Fail(
        fmt::format("{} has the distortion '{}', which no camera of COLMAP has; expected "
                    "pinhole, radial1, radial3, brown, fisheye4 or fisheye1: calibrate with "
                    "one of these, or undistort the photographs first",
                    what, type));
  }
  return AddPinhole(what, lens, width, height, model);
}

// `json` has the rotation, column by column, and the centre.
Rigid3d ReadPose(const JsonValue& json) {
  const JsonValue matrix = json.At("rotation");
  const std::vector<double> values = matrix.Reals(9);
  const std::optional<Eigen::Quaterniond> rotation =
      RotationFromMatrix(Eigen::Map<const Eigen::Matrix3d>(values.data()));
  if (!rotation) matrix.FailExpected("a rotation matrix");
  return {*rotation, -(*rotation * json.At("center").Vector3())};
}

std::map<uint64_t, Rigid3d> ReadPoses(const JsonValue& json) {
  std::map<uint64_t, Rigid3d> pose_of;
  for (const JsonValue& entry : ListIfAny(json, "poses")) {
    const JsonValue pose = entry.At("pose");
    const std::optional<JsonValue> transform = pose.Find("transform");
    pose_of[entry.At("poseId").Whole()] = ReadPose(transform ? *transform : pose);
  }
  return pose_of;
}

// Poses of sensors in their rigs, by rig and number; empty where they are not known.
std::map<uint64_t, std::vector<std::optional<Rigid3d>>> ReadRigs(const JsonValue& json) {
  std::map<uint64_t, std::vector<std::optional<Rigid3d>>> rigs;
  for (const JsonValue& entry : ListIfAny(json, "rigs")) {
    std::vector<std::optional<Rigid3d>>& poses = rigs[entry.At("rigId").Whole()];
    for (const JsonValue& sub_pose : ListIfAny(entry, "subPoses")) {
      const bool is_known = sub_pose.At("status").Text() != "uninitialized";
      poses.push_back(is_known ? std::optional(ReadPose(sub_pose.At("pose"))) : std::nullopt);
    }
  }
  return rigs;
}

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  const JsonValue json = JsonValue::Parse(bytes, path);
  Version version;
  for (size_t i = 0; i < 3; ++i) version[i] = json.At("version").At(i).Whole();
  ForeignModel model(path);
  std::map<uint64_t, camera_t> camera_of;
  for (const JsonValue& entry : ListIfAny(json, "intrinsics"))
    camera_of[entry.At("intrinsicId").Whole()] = AddIntrinsics(entry, version, &model);
  const auto pose_of = ReadPoses(json);
  const auto rigs = ReadRigs(json);
  std::map<uint64_t, image_t> image_of;
  for (const JsonValue& view : json.At("views").List()) {
    // A view without intrinsics is a photograph that nothing is known of.
    const std::optional<JsonValue> of_camera = view.Find("intrinsicId");
    if (!of_camera) continue;
    const auto camera = camera_of.find(of_camera->Whole());
    if (camera == camera_of.end()) of_camera->FailExpected("the number of an intrinsic");
    std::optional<Rigid3d> pose;
    if (const std::optional<JsonValue> of_pose = view.Find("poseId")) {
      const auto found = pose_of.find(of_pose->Whole());
      if (found != pose_of.end()) pose = found->second;
    }
    if (pose && view.Has("rigId") && view.TextOr("isPoseIndependant", "true") == "false") {
      const auto rig = rigs.find(view.At("rigId").Whole());
      const uint64_t number = view.At("subPoseId").Whole();
      const bool is_known =
          rig != rigs.end() && number < rig->second.size() && rig->second[number].has_value();
      pose = is_known ? std::optional(*rig->second[number] * *pose) : std::nullopt;
    }
    std::string name = view.At("path").Text();
    std::replace(name.begin(), name.end(), '\\', '/');
    image_of[view.At("viewId").Whole()] = model.AddImage(name, camera->second, pose);
  }
  for (const JsonValue& entry : ListIfAny(json, "structure")) {
    std::array<uint8_t, 3> rgb{0, 0, 0};
    if (const std::optional<JsonValue> colour = entry.Find("color")) {
      const std::vector<double> values = colour->Reals(3);
      for (size_t i = 0; i < 3; ++i)
        rgb[i] = static_cast<uint8_t>(std::clamp(values[i], 0.0, 255.0));
    }
    const point3D_t point3D_id = model.AddPoint(entry.At("X").Vector3(), rgb);
    for (const JsonValue& seen : ListIfAny(entry, "observations")) {
      const auto image = image_of.find(seen.At("observationId").Whole());
      if (image == image_of.end()) seen.At("observationId").FailExpected("the number of a view");
      // Exported without features: the views alone.
      if (!seen.Has("x") || !model.HasPose(image->second)) continue;
      const std::vector<double> xy = seen.At("x").Reals(2);
      model.AddObservation(point3D_id, image->second, {xy[0] + kHalfPixel, xy[1] + kHalfPixel});
    }
  }
  return model.Finish(/*strip_common_folder=*/true);
}

}  // namespace

ForeignFormat MeshroomFormat() {
  return {.name = "Meshroom's cameras.sfm",
          .file_names = {"cameras.sfm", "sfm.sfm", "sfm.json", "sfmData.sfm", "sfmData.json"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
