// SPDX-License-Identifier: BSD-3-Clause
// Models of other programs. A format is one file here (bundler.cc, ...) with a function
// `ForeignFormat NAMEFormat()`, and one line in foreign_formats.inc; wherever a model is read
// (io/model_io.h) it is then recognised. What the readers share is the ForeignModel below.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

struct ForeignFormat {
  std::string_view name;  // for messages: "OpenMVG's sfm_data.json"
  // Names that it is found by in a folder, in their order.
  std::vector<std::string_view> file_names;
  // Whether the bytes of a file look like it.
  bool (*recognises)(std::string_view bytes);
  // `path`: for messages, and for files that belong to it and lie beside it. Consistent but for
  // links that one end only knows. Throws InputError.
  Reconstruction (*parse)(std::string_view bytes, const std::filesystem::path& path);
};

const std::vector<ForeignFormat>& AllForeignFormats();

// "Bundler's bundle.out, OpenMVG's sfm_data.json, ...".
std::string NamesOfForeignFormats();

// The format of a file, by what is in it. Null: none of them.
const ForeignFormat* FindForeignFormat(const std::filesystem::path& file);
// The first file of a folder that is named as one of the formats is, and is one; else the only one
// by its contents. Empty: none, or several.
std::optional<std::filesystem::path> FindForeignFile(const std::filesystem::path& folder);
// Of a file that FindForeignFormat knows; says on the log what was read.
Reconstruction ReadForeignModel(const ForeignFormat& format, const std::filesystem::path& file);

// A model while it is read: images and points with ids from 1 in the order in which they come.
class ForeignModel {
 public:
  explicit ForeignModel(std::filesystem::path path) : path_(std::move(path)) {}

  // `what`: the camera in the words of the file, for messages; `params`: those of COLMAP's model of
  // this name. Throws InputError if they are no camera's (a focal length of 0, ...).
  camera_t AddCamera(const std::string& what, std::string_view model_name, uint64_t width,
                     uint64_t height, std::vector<double> params);
  // Without a pose the image is known and not registered.
  image_t AddImage(std::string name, camera_t camera_id,
                   const std::optional<Rigid3d>& cam_from_world);
  bool HasPose(image_t image_id) const { return model_.images.contains(image_id); }
  point3D_t AddPoint(const Eigen::Vector3d& xyz, const std::array<uint8_t, 3>& rgb);
  // Only in images with a pose.
  void AddObservation(point3D_t point3D_id, image_t image_id, const Eigen::Vector2d& xy);
  size_t num_images() const { return names_.size(); }
  const Camera& CameraOf(image_t image_id) const;

  // The whole model. Names lose the folder that all of them have in front, where `strip` says so.
  Reconstruction Finish(bool strip_common_folder);

 private:
  std::filesystem::path path_;
  Reconstruction model_;
  std::vector<std::string> names_;         // of image i + 1
  std::vector<camera_t> camera_of_image_;  // likewise
};

// The rotation of a 3x3 matrix: the nearest one. Empty: the matrix is none (a reflection, or off by
// more than 1 %).
std::optional<Eigen::Quaterniond> RotationFromMatrix(const Eigen::Matrix3d& matrix);

// World to camera of a camera whose axes are COLMAP's (x right, y down, z forward) or OpenGL's (x
// right, y up, z backwards), from the matrix [R c] of camera to world. Empty: R is no rotation.
std::optional<Rigid3d> PoseFromCamToWorld(const Eigen::Matrix<double, 3, 4>& world_from_cam,
                                          bool is_opengl);

// Parameters of COLMAP's cameras from a lens in the terms that the programs share: Brown's
// polynomial k1 k2 k3 and tangential p1 p2 in OpenCV's order.
struct PinholeLens {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0;
};
// The simplest of COLMAP's models that holds the lens: SIMPLE_PINHOLE or PINHOLE, SIMPLE_RADIAL or
// RADIAL, OPENCV, FULL_OPENCV.
camera_t AddPinhole(const std::string& what, const PinholeLens& lens, uint64_t width,
                    uint64_t height, ForeignModel* model);

}  // namespace holba
