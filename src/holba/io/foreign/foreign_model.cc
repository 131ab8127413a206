// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/foreign_model.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <fstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/record_faults.h"
#include "holba/scene/validity.h"

namespace holba {
namespace fs = std::filesystem;

#define HOLBA_FOREIGN_FORMAT(Name) ForeignFormat Name##Format();
#include "holba/io/foreign/foreign_formats.inc"
#undef HOLBA_FOREIGN_FORMAT

const std::vector<ForeignFormat>& AllForeignFormats() {
  static const std::vector<ForeignFormat> formats = {
#define HOLBA_FOREIGN_FORMAT(Name) Name##Format(),
#include "holba/io/foreign/foreign_formats.inc"
#undef HOLBA_FOREIGN_FORMAT
  };
  return formats;
}

std::string NamesOfForeignFormats() {
  std::string names;
  for (const ForeignFormat& format : AllForeignFormats())
    names += (names.empty() ? "" : ", ") + std::string(format.name);
  return names;
}

const ForeignFormat* FindForeignFormat(const fs::path& file) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return nullptr;
  {
    // All of them are text that begins with one of these; problems of gigabytes are not read here.
    std::ifstream stream(file, std::ios::binary);
    char head[64] = {};
    stream.read(head, sizeof(head));
    std::string_view text(head, static_cast<size_t>(stream.gcount()));
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    const size_t first = text.find_first_not_of(" \t\r\n");
    if (first == std::string_view::npos ||
        std::string_view("{[<#").find(text[first]) == std::string_view::npos)
      return nullptr;
  }
  const std::string bytes = ReadFileBytes(file);
  for (const ForeignFormat& format : AllForeignFormats()) {
    if (format.recognises(bytes)) return &format;
  }
  return nullptr;
}

std::optional<fs::path> FindForeignFile(const fs::path& folder) {
  for (const ForeignFormat& format : AllForeignFormats()) {
    for (const std::string_view name : format.file_names) {
      const fs::path file = folder / name;
      if (FindForeignFormat(file) == &format) return file;
    }
  }
  // Under another name, if it is the only one: "scan3_bundler.out".
  constexpr size_t kMaxNumLookedAt = 100;
  std::optional<fs::path> found;
  size_t num_looked_at = 0;
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const std::string extension = entry->path().extension().string();
    if (extension != ".out" && extension != ".json" && extension != ".sfm" && extension != ".xml")
      continue;
    if (++num_looked_at > kMaxNumLookedAt) return std::nullopt;
    if (FindForeignFormat(entry->path()) == nullptr) continue;
    if (found) return std::nullopt;
    found = entry->path();
  }
  return found;
}

Reconstruction ReadForeignModel(const ForeignFormat& format, const fs::path& file) {
  Reconstruction model = format.parse(ReadFileBytes(file), file);
  LogInfo("Read {}, {} of them with a pose, and {} from {}",
          Counted(model.images.size() + model.unregistered_images.size(), "image"),
          model.images.size(), Counted(model.points3D.size(), "point"), format.name);
  return model;
}

camera_t ForeignModel::AddCamera(const std::string& what, std::string_view model_name,
                                 uint64_t width, uint64_t height, std::vector<double> params) {
  Camera camera{.model = FindCameraModel(model_name),
                .width = width,
                .height = height,
                .params = std::move(params)};
  if (const Fault fault = FindFault(camera)) throw InputError(path_, FaultOf(what, *fault));
  const auto camera_id = static_cast<camera_t>(model_.cameras.size() + 1);
  model_.cameras.Add(camera_id, std::move(camera));
  return camera_id;
}

image_t ForeignModel::AddImage(std::string name, camera_t camera_id,
                               const std::optional<Rigid3d>& cam_from_world) {
  const auto image_id = static_cast<image_t>(names_.size() + 1);
  if (cam_from_world) {
    if (const Fault fault = FindFault(*cam_from_world))
      throw InputError(path_, FaultOf(fmt::format("image '{}'", name), *fault));
    Image image;
    image.camera_id = camera_id;
    image.cam_from_world = *cam_from_world;
    model_.images.Add(image_id, std::move(image));
  }
  names_.push_back(std::move(name));
  camera_of_image_.push_back(camera_id);
  return image_id;
}

point3D_t ForeignModel::AddPoint(const Eigen::Vector3d& xyz, const std::array<uint8_t, 3>& rgb) {
  const point3D_t point3D_id = model_.points3D.size() + 1;
  Point3D point;
  point.xyz = xyz;
  point.rgb = rgb;
  model_.points3D.Add(point3D_id, std::move(point));
  return point3D_id;
}

void ForeignModel::AddObservation(point3D_t point3D_id, image_t image_id,
                                  const Eigen::Vector2d& xy) {
  Image& image = model_.images.at(image_id);
  model_.points3D.at(point3D_id)
      .track.push_back({image_id, static_cast<point2D_t>(image.points2D.size())});
  image.points2D.push_back({.xy = xy, .point3D_id = point3D_id});
}

const Camera& ForeignModel::CameraOf(image_t image_id) const {
  return model_.cameras.at(camera_of_image_.at(image_id - 1));
}

namespace {

// How many characters of all names are the same folder.
size_t CommonFolderSize(const std::vector<std::string>& names) {
  if (names.empty()) return 0;
  size_t size = names.front().rfind('/');
  size = size == std::string::npos ? 0 : size + 1;
  for (const std::string& name : names) {
    while (size > 0 && name.compare(0, size, names.front(), 0, size) != 0) {
      const size_t slash = size < 2 ? std::string::npos : names.front().rfind('/', size - 2);
      size = slash == std::string::npos ? 0 : slash + 1;
    }
  }
  return size;
}

}  // namespace

Reconstruction ForeignModel::Finish(bool strip_common_folder) {
  const size_t num_stripped = strip_common_folder ? CommonFolderSize(names_) : 0;
  for (size_t i = 0; i < names_.size(); ++i) {
    const auto image_id = static_cast<image_t>(i + 1);
    std::string name = names_[i].substr(num_stripped);
    if (Image* const image = model_.images.Find(image_id)) {
      image->name = std::move(name);
    } else {
      Image waiting;
      waiting.name = std::move(name);
      waiting.camera_id = camera_of_image_[i];
      model_.unregistered_images.Add(image_id, std::move(waiting));
    }
  }
  model_.AddTrivialRigsAndFrames();
  return std::move(model_);
}

std::optional<Eigen::Quaterniond> RotationFromMatrix(const Eigen::Matrix3d& matrix) {
  constexpr double kMaxDifference = 0.01;
  if (!matrix.allFinite()) return std::nullopt;
  const Eigen::Matrix3d excess = matrix * matrix.transpose() - Eigen::Matrix3d::Identity();
  if (excess.cwiseAbs().maxCoeff() > 2 * kMaxDifference || matrix.determinant() < 0.0)
    return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  return Eigen::Quaterniond(nearest).normalized();
}

std::optional<Rigid3d> PoseFromCamToWorld(const Eigen::Matrix<double, 3, 4>& world_from_cam,
                                          bool is_opengl) {
  Eigen::Matrix3d axes = world_from_cam.leftCols<3>();
  if (is_opengl) axes.rightCols<2>() *= -1.0;
  const std::optional<Eigen::Quaterniond> rotation = RotationFromMatrix(axes);
  if (!rotation) return std::nullopt;
  const Eigen::Quaterniond inverse = rotation->conjugate();
  return Rigid3d(inverse, -(inverse * Eigen::Vector3d(world_from_cam.col(3))));
}

camera_t AddPinhole(const std::string& what, const PinholeLens& lens, uint64_t width,
                    uint64_t height, ForeignModel* model) {
  const auto& [fx, fy, cx, cy, k1, k2, k3, p1, p2] = lens;
  if (k3 != 0.0) {
    return model->AddCamera(what, "FULL_OPENCV", width, height,
                            {fx, fy, cx, cy, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0});
  }
  if (p1 != 0.0 || p2 != 0.0 || (fx != fy && (k1 != 0.0 || k2 != 0.0)))
    return model->AddCamera(what, "OPENCV", width, height, {fx, fy, cx, cy, k1, k2, p1, p2});
  if (k2 != 0.0) return model->AddCamera(what, "RADIAL", width, height, {fx, cx, cy, k1, k2});
  if (k1 != 0.0) return model->AddCamera(what, "SIMPLE_RADIAL", width, height, {fx, cx, cy, k1});
  if (fx != fy) return model->AddCamera(what, "PINHOLE", width, height, {fx, fy, cx, cy});
  return model->AddCamera(what, "SIMPLE_PINHOLE", width, height, {fx, cx, cy});
}

}  // namespace holba
