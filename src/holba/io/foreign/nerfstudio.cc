// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/nerfstudio.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/io/binary_io.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/json_value.h"
#include "holba/io/foreign/ply_points.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

constexpr const char* kTransforms = "transforms.json";
constexpr const char* kPoints = "sparse_pc.ply";
constexpr const char* kImages = "images/";

bool Recognises(std::string_view bytes) {
  return bytes.find("\"frames\"") != std::string_view::npos &&
         bytes.find("\"transform_matrix\"") != std::string_view::npos;
}

// A value of the frame, else of the file.
class Lookup {
 public:
  Lookup(const JsonValue& file, const JsonValue& frame) : file_(file), frame_(frame) {}
  std::optional<JsonValue> Find(const std::string& key) const {
    const std::optional<JsonValue> own = frame_.Find(key);
    return own ? own : file_.Find(key);
  }
  double RealOr(const std::string& key, double value) const {
    const std::optional<JsonValue> found = Find(key);
    return found ? found->Real() : value;
  }

 private:
  const JsonValue& file_;
  const JsonValue& frame_;
};

// The parameters of a frame's camera, by which equal cameras are found.
struct FrameCamera {
  bool is_fisheye = false, is_spherical = false;
  uint64_t width = 0, height = 0;
  PinholeLens lens;
  double k4 = 0.0;

  auto Key() const {
    return std::tuple(is_fisheye, is_spherical, width, height, lens.fx, lens.fy, lens.cx, lens.cy,
                      lens.k1, lens.k2, lens.k3, lens.p1, lens.p2, k4);
  }
};

FrameCamera ReadCamera(const JsonValue& frame, const Lookup& lookup) {
  const std::optional<JsonValue> width = lookup.Find("w"), height = lookup.Find("h");
  if (!width || !height) {
    frame.Fail(
        fmt::format("expected the size of the photograph, \"w\" and \"h\", for '{}', found "
                    "none; add both to the file, in pixels",
                    frame.place()));
  }
  FrameCamera camera{.width = width->Whole(), .height = height->Whole()};
  const auto w = static_cast<double>(camera.width), h = static_cast<double>(camera.height);
  std::string type = "OPENCV";
  if (const std::optional<JsonValue> stated = lookup.Find("camera_model")) type = stated->Text();
  camera.is_fisheye = type == "OPENCV_FISHEYE" || lookup.RealOr("is_fisheye", 0.0) != 0.0;
  camera.is_spherical = type == "EQUIRECTANGULAR";
  const bool is_known = camera.is_fisheye || camera.is_spherical || type == "OPENCV" ||
                        type == "FULL_OPENCV" || type == "PINHOLE" || type == "SIMPLE_PINHOLE" ||
                        type == "RADIAL" || type == "SIMPLE_RADIAL" || type == "PERSPECTIVE";
  if (!is_known) {
    frame.Fail(
        fmt::format("the camera of '{}' is a {}; expected OPENCV, OPENCV_FISHEYE, PINHOLE "
                    "or EQUIRECTANGULAR",
                    frame.place(), type));
  }
  if (camera.is_spherical) return camera;
  PinholeLens& lens = camera.lens;
  const std::optional<JsonValue> fl_x = lookup.Find("fl_x"), fl_y = lookup.Find("fl_y");
  const std::optional<JsonValue> angle_x = lookup.Find("camera_angle_x");
  if (fl_x) {
    lens.fx = fl_x->Real();
  } else if (angle_x) {
    lens.fx = 0.5 * w / std::tan(0.5 * angle_x->Real());
  } else if (fl_y) {
    lens.fx = fl_y->Real();
  } else {
    frame.Fail(
        fmt::format("expected the focal length \"fl_x\" or \"camera_angle_x\" for '{}', "
                    "found none; add it to the file",
                    frame.place()));
  }
  lens.fy = fl_y ? fl_y->Real() : lens.fx;
  lens.cx = lookup.RealOr("cx", 0.5 * w);
  lens.cy = lookup.RealOr("cy", 0.5 * h);
  lens.k1 = lookup.RealOr("k1", 0.0);
  lens.k2 = lookup.RealOr("k2", 0.0);
  lens.k3 = lookup.RealOr("k3", 0.0);
  lens.p1 = lookup.RealOr("p1", 0.0);
  lens.p2 = lookup.RealOr("p2", 0.0);
  camera.k4 = lookup.RealOr("k4", 0.0);
  if (camera.k4 != 0.0 && !camera.is_fisheye) {
    frame.Fail(
        fmt::format("the lens of '{}' has k4, which of COLMAP's cameras only "
                    "fisheyes have; give undistorted photographs",
                    frame.place()));
  }
  return camera;
}

camera_t AddCamera(const std::string& what, const FrameCamera& camera, ForeignModel* model) {
  const auto& [fx, fy, cx, cy, k1, k2, k3, p1, p2] = camera.lens;
  if (camera.is_spherical) {
    return model->AddCamera(
        what, "EQUIRECTANGULAR", camera.width, camera.height,
        {static_cast<double>(camera.width), static_cast<double>(camera.height)});
  }
  if (camera.is_fisheye) {
    return model->AddCamera(what, "OPENCV_FISHEYE", camera.width, camera.height,
                            {fx, fy, cx, cy, k1, k2, k3, camera.k4});
  }
  return AddPinhole(what, camera.lens, camera.width, camera.height, model);
}

std::string WithoutFolderOfImages(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.starts_with("./")) name = name.substr(2);
  return name.starts_with(kImages) ? name.substr(std::string_view(kImages).size()) : name;
}

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  const JsonValue json = JsonValue::Parse(bytes, path);
  ForeignModel model(path);
  std::map<decltype(FrameCamera().Key()), camera_t> camera_of;
  for (const JsonValue& frame : json.At("frames").List()) {
    const FrameCamera camera = ReadCamera(frame, Lookup(json, frame));
    const auto [known, is_new] = camera_of.emplace(camera.Key(), kInvalidId32);
    if (is_new)
      known->second = AddCamera(fmt::format("the camera of '{}'", frame.place()), camera, &model);
    const JsonValue matrix = frame.At("transform_matrix");
    const std::optional<Rigid3d> pose = PoseFromCamToWorld(matrix.Matrix(3, 4), /*is_opengl=*/true);
    if (!pose) matrix.FailExpected("a matrix of rotation and place");
    model.AddImage(WithoutFolderOfImages(frame.At("file_path").Text()), known->second, pose);
  }
  if (const std::optional<JsonValue> points = json.Find("ply_file_path")) {
    const fs::path file = path.parent_path() / points->Text();
    std::error_code ignored;
    if (fs::is_regular_file(file, ignored)) {
      for (const PlyPoint& point : ParsePlyPoints(ReadFileBytes(file), file))
        model.AddPoint(point.xyz, point.rgb);
    }
  }
  return model.Finish(/*strip_common_folder=*/false);
}

// ---- Writing.

// Name and parameters as nerfstudio has them.
nlohmann::ordered_json CameraJson(camera_t camera_id, const Camera& camera) {
  const std::string_view name = camera.model->name;
  const std::vector<double>& p = camera.params;
  nlohmann::ordered_json json;
  const auto pinhole = [&](double fx, double fy, double cx, double cy) {
    json = {{"camera_model", "OPENCV"},
            {"w", camera.width},
            {"h", camera.height},
            {"fl_x", fx},
            {"fl_y", fy},
            {"cx", cx},
            {"cy", cy}};
  };
  const auto distortion = [&](std::initializer_list<std::pair<const char*, double>> values) {
    for (const auto& [key, value] : values) json[key] = value;
  };
  if (name == "SIMPLE_PINHOLE") {
    pinhole(p[0], p[0], p[1], p[2]);
  } else if (name == "PINHOLE") {
    pinhole(p[0], p[1], p[2], p[3]);
  } else if (name == "SIMPLE_RADIAL") {
    pinhole(p[0], p[0], p[1], p[2]);
    distortion({{"k1", p[3]}, {"k2", 0.0}, {"p1", 0.0}, {"p2", 0.0}});
  } else if (name == "RADIAL") {
    pinhole(p[0], p[0], p[1], p[2]);
    distortion({{"k1", p[3]}, {"k2", p[4]}, {"p1", 0.0}, {"p2", 0.0}});
  } else if (name == "OPENCV") {
    pinhole(p[0], p[1], p[2], p[3]);
    distortion({{"k1", p[4]}, {"k2", p[5]}, {"p1", p[6]}, {"p2", p[7]}});
  } else if (name == "FULL_OPENCV" && p[9] == 0.0 && p[10] == 0.0 && p[11] == 0.0) {
    pinhole(p[0], p[1], p[2], p[3]);
    distortion({{"k1", p[4]}, {"k2", p[5]}, {"k3", p[8]}, {"p1", p[6]}, {"p2", p[7]}});
  } else if (name == "OPENCV_FISHEYE") {
    pinhole(p[0], p[1], p[2], p[3]);
    distortion({{"k1", p[4]}, {"k2", p[5]}, {"k3", p[6]}, {"k4", p[7]}});
    json["camera_model"] = "OPENCV_FISHEYE";
  } else if (name == "SIMPLE_RADIAL_FISHEYE" || name == "RADIAL_FISHEYE") {
    pinhole(p[0], p[0], p[1], p[2]);
    distortion({{"k1", p[3]}, {"k2", p.size() > 4 ? p[4] : 0.0}, {"k3", 0.0}, {"k4", 0.0}});
    json["camera_model"] = "OPENCV_FISHEYE";
  } else {
    throw InputError(
        fmt::format("camera {} is {}, which nerfstudio does not "
                    "have; write another format, or undistort photographs and model first",
                    camera_id, name));
  }
  return json;
}

void FormatPoints(const Reconstruction& model, std::ostream* stream) {
  *stream << "ply\nformat binary_little_endian 1.0\nelement vertex " << model.points3D.size()
          << "\nproperty double x\nproperty double y\nproperty double z\n"
             "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  BinaryOut out(stream);
  for (const auto& [point3D_id, point] : model.points3D) {
    for (int i = 0; i < 3; ++i) out.Real(point.xyz[i]);
    for (const uint8_t channel : point.rgb) out.Byte(channel);
    out.EndRecord();
  }
}

bool IsNerfstudioFile(std::string_view name) { return name == kTransforms || name == kPoints; }

}  // namespace

void FormatTransforms(const Reconstruction& model, std::ostream* stream) {
  nlohmann::ordered_json json;
  std::map<camera_t, nlohmann::ordered_json> camera_of;
  for (const auto& [image_id, image] : model.images) {
    if (!camera_of.contains(image.camera_id)) {
      camera_of[image.camera_id] = CameraJson(image.camera_id, model.cameras.at(image.camera_id));
    }
  }
  // One camera stands at the top, as in nerfstudio's own files; several in their frames.
  const bool is_shared = camera_of.size() == 1;
  if (is_shared) json = camera_of.begin()->second;
  json["frames"] = nlohmann::ordered_json::array();
  for (const auto& [image_id, image] : model.images) {
    nlohmann::ordered_json frame;
    if (!is_shared) frame = camera_of.at(image.camera_id);
    frame["file_path"] = kImages + image.name;
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    const Rigid3d world_from_cam = image.cam_from_world.Inverse();
    matrix.topLeftCorner<3, 3>() = world_from_cam.RotationMatrix();
    matrix.block<3, 2>(0, 1) *= -1.0;
    matrix.topRightCorner<3, 1>() = world_from_cam.translation;
    for (int row = 0; row < 4; ++row) {
      frame["transform_matrix"].push_back(
          {matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    frame["colmap_im_id"] = image_id;
    json["frames"].push_back(std::move(frame));
  }
  if (!model.points3D.empty()) json["ply_file_path"] = kPoints;
  *stream << json.dump(2, ' ', true, nlohmann::json::error_handler_t::replace) << "\n";
}

void WriteNerfstudio(const Reconstruction& model, const fs::path& folder) {
  StagedFolder stage(folder);
  stage.Write(kTransforms, [&](std::ostream* stream) { FormatTransforms(model, stream); });
  if (!model.points3D.empty())
    stage.Write(kPoints, [&](std::ostream* stream) { FormatPoints(model, stream); });
  stage.Commit(IsNerfstudioFile);
}

void ProbeNerfstudio(const fs::path& folder) { ProbeFolder(folder, IsNerfstudioFile); }

ForeignFormat NerfstudioFormat() {
  return {.name = "nerfstudio's transforms.json",
          .file_names = {"transforms.json", "transforms_train.json"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
