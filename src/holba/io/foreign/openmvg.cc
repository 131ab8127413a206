// SPDX-License-Identifier: BSD-3-Clause
// OpenMVG's sfm_data.json (Moulon et al., version 0.3): lists of {key, value} of views, intrinsics,
// extrinsics (rotation of world to camera, camera centre) and structure with its observations.
// OpenMVG counts pixels from the middle of the first one (it undistorts pixel (i, j) at the whole
// numbers (i, j)), COLMAP from its corner: principal points and observations move by half a pixel.
// A view without a pose is known and not registered.
#include <fmt/format.h>

#include <map>

#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/json_value.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr double kHalfPixel = 0.5;

bool Recognises(std::string_view bytes) {
  return bytes.find("\"sfm_data_version\"") != std::string_view::npos;
}

// What a pointer of the serialisation points to, and a value of it or of the class it derives from.
JsonValue Pointee(const JsonValue& value) { return value.At("value").At("ptr_wrapper").At("data"); }
JsonValue Member(const JsonValue& data, const std::string& name) {
  const std::optional<JsonValue> base = data.Find("value0");
  return !data.Has(name) && base ? Member(*base, name) : data.At(name);
}

camera_t AddIntrinsics(const JsonValue& entry, const std::string& type, ForeignModel* model) {
  const std::string what = fmt::format("intrinsic {}", entry.At("key").Whole());
  const JsonValue data = Pointee(entry);
  const uint64_t width = Member(data, "width").Whole(), height = Member(data, "height").Whole();
  if (type == "spherical") {
    return model->AddCamera(what, "EQUIRECTANGULAR", width, height,
                            {static_cast<double>(width), static_cast<double>(height)});
  }
  const std::vector<double> centre = Member(data, "principal_point").Reals(2);
  PinholeLens lens{.cx = centre[0] + kHalfPixel, .cy = centre[1] + kHalfPixel};
  lens.fx = lens.fy = Member(data, "focal_length").Real();
  if (type == "pinhole_radial_k1") {
    lens.k1 = Member(data, "disto_k1").Reals(1)[0];
  } else if (type == "pinhole_radial_k3") {
    const std::vector<double> k = Member(data, "disto_k3").Reals(3);
    lens.k1 = k[0], lens.k2 = k[1], lens.k3 = k[2];
  } else if (type == "pinhole_brown_t2") {
    const std::vector<double> k = Member(data, "disto_t2").Reals(5);
    lens.k1 = k[0], lens.k2 = k[1], lens.k3 = k[2], lens.p1 = k[3], lens.p2 = k[4];
  } else if (type == "fisheye") {
    const std::vector<double> k = Member(data, "fisheye").Reals(4);
    return model->AddCamera(what, "OPENCV_FISHEYE", width, height,
                            {lens.fx, lens.fy, lens.cx, lens.cy, k[0], k[1], k[2], k[3]});
  } else if (type != "pinhole") {
    entry.Fail(
        fmt::format("{} is of the unknown type '{}', expected pinhole, pinhole_radial_k1, "
                    "pinhole_radial_k3, pinhole_brown_t2, fisheye or spherical",
                    what, type));
  }
  return AddPinhole(what, lens, width, height, model);
}

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  const JsonValue json = JsonValue::Parse(bytes, path);
  ForeignModel model(path);
  std::map<uint64_t, camera_t> camera_of;
  // The name of a class stands where the class comes first; later its number is enough.
  std::map<uint64_t, std::string> type_of;
  constexpr uint64_t kIsNamed = uint64_t{1} << 31;
  for (const JsonValue& entry : json.At("intrinsics").List()) {
    const JsonValue value = entry.At("value");
    const uint64_t number = value.At("polymorphic_id").Whole();
    if (value.Has("polymorphic_name"))
      type_of[number & ~kIsNamed] = value.At("polymorphic_name").Text();
    camera_of[entry.At("key").Whole()] = AddIntrinsics(entry, type_of[number & ~kIsNamed], &model);
  }
  std::map<uint64_t, Rigid3d> pose_of;
  for (const JsonValue& entry : json.At("extrinsics").List()) {
    const JsonValue value = entry.At("value"), matrix = value.At("rotation");
    const std::optional<Eigen::Quaterniond> rotation = RotationFromMatrix(matrix.Matrix(3, 3));
    if (!rotation) matrix.FailExpected("a rotation matrix");
    const Eigen::Vector3d centre = value.At("center").Vector3();
    pose_of[entry.At("key").Whole()] = Rigid3d(*rotation, -(*rotation * centre));
  }
  std::map<uint64_t, image_t> image_of;
  for (const JsonValue& entry : json.At("views").List()) {
    const JsonValue data = Pointee(entry);
    const JsonValue of_camera = Member(data, "id_intrinsic");
    const auto camera = camera_of.find(of_camera.Whole());
    if (camera == camera_of.end()) {
      // Views whose intrinsics are not known yet have none: nothing can be done with them.
      continue;
    }
    const std::string folder = Member(data, "local_path").Text();
    const std::string name = Member(data, "filename").Text();
    const auto pose = pose_of.find(Member(data, "id_pose").Whole());
    image_of[Member(data, "id_view").Whole()] = model.AddImage(
        folder.empty() || folder.ends_with('/') ? folder + name : folder + "/" + name,
        camera->second, pose == pose_of.end() ? std::nullopt : std::optional(pose->second));
  }
  for (const JsonValue& entry : json.At("structure").List()) {
    const JsonValue value = entry.At("value");
    const point3D_t point3D_id = model.AddPoint(value.At("X").Vector3(), {0, 0, 0});
    for (const JsonValue& seen : value.At("observations").List()) {
      const auto image = image_of.find(seen.At("key").Whole());
      if (image == image_of.end()) seen.At("key").FailExpected("the number of a view");
      const std::vector<double> xy = seen.At("value").At("x").Reals(2);
      if (!model.HasPose(image->second)) continue;
      model.AddObservation(point3D_id, image->second, {xy[0] + kHalfPixel, xy[1] + kHalfPixel});
    }
  }
  return model.Finish(/*strip_common_folder=*/false);
}

}  // namespace

ForeignFormat OpenMvgFormat() {
  return {.name = "OpenMVG's sfm_data.json",
          .file_names = {"sfm_data.json"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
