// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/photograph_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/threads.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/validity.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

std::vector<double> ParseNumbers(const std::string& text, const char* option) {
  std::vector<double> numbers;
  std::istringstream stream(text);
  std::string part;
  while (std::getline(stream, part, ',')) {
    try {
      size_t end = 0;
      numbers.push_back(std::stod(part, &end));
      if (part.find_first_not_of(" \t", end) != std::string::npos) throw std::invalid_argument("");
    } catch (const std::logic_error&) {
      throw InputError(fmt::format("{}: '{}' is no number; give numbers with commas between them",
                                   option, part));
    }
  }
  return numbers;
}

const CameraModel& ModelOf(const ImageReaderOptions& options) {
  const CameraModel* model = FindCameraModel(options.camera_model);
  if (model == nullptr) {
    std::string known;
    for (const CameraModel* each : AllCameraModels())
      known += (known.empty() ? "" : ", ") + std::string(each->name);
    throw InputError(fmt::format("--ImageReader.camera_model: expected one of {}, found '{}'",
                                 known, options.camera_model));
  }
  return *model;
}

// Which photographs share a camera: those with the same text.
std::string GroupOf(const ImageReaderOptions& options, const PlannedImage& image) {
  if (options.existing_camera_id >= 0 || options.single_camera) return "all";
  if (options.single_camera_per_folder)
    return "folder " + fs::path(image.name).parent_path().generic_string();
  const auto text = options.single_camera_per_image
                        ? std::nullopt
                        : CameraText(image.header.exif, image.header.width, image.header.height);
  return text ? "camera " + *text : "image " + image.name;
}

DatabaseCamera NewCamera(const ImageReaderOptions& options, const PhotographHeader& header) {
  const CameraModel& model = ModelOf(options);
  DatabaseCamera camera;
  if (!options.camera_params.empty()) {
    camera.camera = {&model, header.width, header.height,
                     ParseNumbers(options.camera_params, "--ImageReader.camera_params")};
    camera.has_prior_focal_length = true;
    return camera;
  }
  const auto focal_px = FocalLengthPx(header.exif, header.width, header.height);
  const double longer = static_cast<double>(std::max(header.width, header.height));
  camera.camera =
      DefaultCamera(model, focal_px.value_or(options.default_focal_length_factor * longer),
                    header.width, header.height);
  camera.has_prior_focal_length = focal_px.has_value();
  return camera;
}

PosePrior PriorOf(const Exif& exif) {
  PosePrior prior;
  if (exif.latitude_deg && exif.longitude_deg && exif.altitude_m) {
    prior.position = Eigen::Vector3d(*exif.latitude_deg, *exif.longitude_deg, *exif.altitude_m);
    prior.system = PosePrior::System::kWgs84;
  }
  switch (exif.orientation.value_or(0)) {
    case 1:
      prior.gravity_in_cam = Eigen::Vector3d(0, 1, 0);
      break;
    case 3:
      prior.gravity_in_cam = Eigen::Vector3d(0, -1, 0);
      break;
    case 6:
      prior.gravity_in_cam = Eigen::Vector3d(1, 0, 0);
      break;
    case 8:
      prior.gravity_in_cam = Eigen::Vector3d(-1, 0, 0);
      break;
    default:  // mirrored or unknown: COLMAP takes these for no information
      break;
  }
  return prior;
}

}  // namespace

Camera DefaultCamera(const CameraModel& model, double focal_px, uint64_t width, uint64_t height) {
  Camera camera{&model, width, height, std::vector<double>(model.num_params, 0.0)};
  for (const int idx : model.focal_idxs) camera.params[idx] = focal_px;
  for (size_t i = 0; i < model.principal_point_idxs.size(); ++i)
    camera.params[model.principal_point_idxs[i]] =
        0.5 * static_cast<double>(i == 0 ? width : height);
  // Models whose formulas have no value at 0, or another one for no distortion.
  if (model.name == "FOV") camera.params[4] = 1e-2;
  if (model.name == "EUCM") camera.params[5] = 1.0;
  if (model.name == "EQUIRECTANGULAR")
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
  return camera;
}

std::vector<std::string> PhotographNames(const fs::path& image_path,
                                         const std::string& image_list_path) {
  std::vector<std::string> names;
  if (!image_list_path.empty()) {
    std::istringstream file(ReadFileBytes(image_list_path));
    std::string line;
    while (std::getline(file, line)) {
      const size_t end = line.find_last_not_of(" \t\r");
      if (end != std::string::npos) names.push_back(line.substr(0, end + 1));
    }
  } else {
    names = FindPhotographs(image_path);
  }
  // As paths: folder by folder.
  std::sort(names.begin(), names.end(),
            [](const std::string& a, const std::string& b) { return fs::path(a) < fs::path(b); });
  names.erase(std::unique(names.begin(), names.end()), names.end());
  if (names.empty()) {
    throw InputError(image_list_path.empty() ? image_path : fs::path(image_list_path),
                     image_list_path.empty()
                         ? "expected photographs (JPEG, PNG, TIFF, BMP, PNM files), found none"
                         : "expected the names of photographs, one a line, found none");
  }
  return names;
}

CameraPlan PlanCameras(const ImageReaderOptions& options, const fs::path& image_path,
                       const std::vector<std::string>& names, const Database& database,
                       int num_threads) {
  CameraPlan plan;
  plan.images.resize(names.size());
  ParallelTasks(num_threads, names.size(), [&](size_t i) {
    PlannedImage& image = plan.images[i];
    image.name = names[i];
    image.path = image_path / names[i];
    try {
      image.header = ReadPhotographHeader(image.path);
    } catch (const InputError& error) {
      image.fault = error.what();
      return;
    }
    image.prior = PriorOf(image.header.exif);
  });

  const std::map<camera_t, DatabaseCamera> cameras = database.ReadCameras();
  std::map<std::string, DatabaseImage> images_by_name;
  std::map<std::string, image_t> ids_by_name;
  for (const auto& [image_id, image] : database.ReadImages()) {
    images_by_name.emplace(image.name, image);
    ids_by_name.emplace(image.name, image_id);
  }
  std::map<camera_t, size_t> idx_of_camera_id;
  const auto idx_of = [&](camera_t camera_id) {
    const auto [it, is_new] = idx_of_camera_id.emplace(camera_id, plan.cameras.size());
    if (is_new) plan.cameras.push_back({cameras.at(camera_id), camera_id});
    return it->second;
  };
  std::map<std::string, size_t> idx_of_group;
  if (options.existing_camera_id >= 0) {
    const auto existing = static_cast<camera_t>(options.existing_camera_id);
    if (!cameras.contains(existing)) {
      throw InputError(
          database.path(),
          fmt::format("there is no camera {}; give --ImageReader.existing_camera_id one that is",
                      existing));
    }
    idx_of_group["all"] = idx_of(existing);
  }
  // Images of an earlier run say which camera a group has.
  for (PlannedImage& image : plan.images) {
    const auto known = images_by_name.find(image.name);
    if (known == images_by_name.end()) continue;
    if (!cameras.contains(known->second.camera_id)) {
      throw InputError(database.path(),
                       fmt::format("image '{}' has camera {}, which is not in the database; make "
                                   "the database anew",
                                   image.name, known->second.camera_id));
    }
    image.image_id = ids_by_name.at(image.name);
    image.camera_idx = idx_of(known->second.camera_id);
    if (!image.fault) idx_of_group.emplace(GroupOf(options, image), image.camera_idx);
  }
  for (PlannedImage& image : plan.images) {
    if (image.fault) continue;
    if (!image.image_id) {
      const auto [group, is_new] =
          idx_of_group.emplace(GroupOf(options, image), plan.cameras.size());
      if (is_new) plan.cameras.push_back({NewCamera(options, image.header), std::nullopt});
      image.camera_idx = group->second;
    }
    const Camera& camera = plan.cameras[image.camera_idx].camera.camera;
    if (camera.width != image.header.width || camera.height != image.header.height) {
      image.fault = InputError(image.path,
                               fmt::format("expected {} x {} pixels, the size of its camera, found "
                                           "{} x {} pixels; give it a camera of its own",
                                           camera.width, camera.height, image.header.width,
                                           image.header.height))
                        .what();
    }
  }
  return plan;
}

void ImageReaderOptions::Describe(OptionTable* table) const {
  table->Section("ImageReader");
  table->Field("mask_path", &mask_path,
               "Folder of masks: no features where the image NAME.png is 0.");
  table->Field("camera_mask_path", &camera_mask_path,
               "One mask for all photographs (a file): no features where it is 0.");
  table->Field("camera_model", &camera_model, "Camera model of new cameras, by COLMAP's name.")
      .Basic();
  table->Field("single_camera", &single_camera, "Whether all photographs have one camera.").Basic();
  table->Field("single_camera_per_folder", &single_camera_per_folder,
               "Whether the photographs of each folder have one camera.");
  table->Field("single_camera_per_image", &single_camera_per_image,
               "Whether each photograph has a camera of its own, whatever its EXIF says.");
  table->Field("existing_camera_id", &existing_camera_id, AtLeast(-1),
               "Camera of the database that new photographs have; -1: none.");
  table
      ->Field("camera_params", &camera_params,
              "Parameters of the cameras, with commas; empty: the focal length from EXIF, or by "
              "the factor.")
      .Basic();
  table->Field("default_focal_length_factor", &default_focal_length_factor, GreaterThan(0),
               "Focal length where EXIF has none, times the longer side.");
}

void ImageReaderOptions::Check() const {
  const CameraModel& model = ModelOf(*this);
  if (!camera_params.empty()) {
    const std::vector<double> params = ParseNumbers(camera_params, "--ImageReader.camera_params");
    if (params.size() != static_cast<size_t>(model.num_params)) {
      throw InputError(fmt::format(
          "--ImageReader.camera_params: expected the {} parameters of {} ({}), found {}",
          model.num_params, model.name, model.param_names, params.size()));
    }
    if (const Fault fault = FindFault(Camera{&model, 1, 1, params}))
      throw InputError(
          fmt::format("--ImageReader.camera_params: the camera {}; give other parameters", *fault));
  }
  const int num_ways = single_camera + single_camera_per_folder + single_camera_per_image +
                       (existing_camera_id >= 0);
  if (num_ways > 1) {
    throw InputError(
        fmt::format("expected at most one of --ImageReader.single_camera, "
                    "single_camera_per_folder, single_camera_per_image and existing_camera_id, "
                    "found {} of them",
                    num_ways));
  }
  if (!mask_path.empty() && !fs::is_directory(mask_path))
    throw NoSuchFolder(mask_path, "--ImageReader.mask_path");
  if (!camera_mask_path.empty() && !fs::exists(camera_mask_path))
    throw NoSuchFile(camera_mask_path);
  if (!camera_mask_path.empty() && !fs::is_regular_file(camera_mask_path))
    throw FileIsWanted(camera_mask_path);
}

}  // namespace holba
