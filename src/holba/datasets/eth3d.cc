// SPDX-License-Identifier: BSD-3-Clause
// ETH3D, multi-view: COLMAP's text files in dslr_calibration_undistorted, dslr_calibration_jpg,
// rig_calibration_undistorted or rig_calibration, images in images/, laser scans with their MeshLab
// project in dslr_scan_eval or rig_scan_eval. Source: https://www.eth3d.net/documentation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"
#include "holba/io/model_io.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// A rig does not bend: its cameras stand to each other in all instants as in the first, to what the
// authors' adjustment and the digits of the files leave.
constexpr double kMaxBendRad = 1e-3, kMaxBendM = 1e-3;

fs::path CalibrationOf(const fs::path& folder, const std::string& part) {
  const std::string kind = part.empty() && FoldersIn(folder, "dslr_calibration").empty() ? "rig"
                           : part.empty()                                                ? "dslr"
                                                                                         : part;
  if (kind == "dslr") {
    return FirstFolder(folder, {"dslr_calibration_undistorted", "dslr_calibration_jpg"},
                       "the cameras of the DSLR");
  }
  if (kind == "rig") {
    return FirstFolder(folder, {"rig_calibration_undistorted", "rig_calibration"},
                       "the cameras of the rig");
  }
  throw InputError("--part: expected dslr or rig for ETH3D, found '" + part + "'");
}

std::string FolderOfImage(const std::string& name) {
  const size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

// The images of one instant have one file name in the folders of the cameras. Makes one rig and
// its frames; false, and nothing changed, where the cameras do not stand to each other alike.
bool JoinRig(Reconstruction* model) {
  std::map<std::string, camera_t> camera_of_folder;
  std::map<std::string, std::map<std::string, image_t>> instants;  // file name, folder
  for (const auto& [id, image] : model->images) {
    const std::string folder = FolderOfImage(image.name);
    const auto [at, is_new] = camera_of_folder.emplace(folder, image.camera_id);
    if (!is_new && at->second != image.camera_id) return false;
    instants[fs::path(image.name).filename().string()].emplace(folder, id);
  }
  if (camera_of_folder.size() < 2) return false;
  const auto whole = std::find_if(instants.begin(), instants.end(), [&](const auto& instant) {
    return instant.second.size() == camera_of_folder.size();
  });
  if (whole == instants.end()) return false;

  const std::string& reference = camera_of_folder.begin()->first;
  std::map<std::string, Rigid3d> sensor_from_rig;
  for (const auto& [folder, id] : whole->second) {
    sensor_from_rig[folder] =
        model->images.at(id).cam_from_world *
        model->images.at(whole->second.at(reference)).cam_from_world.Inverse();
  }
  Rig rig;
  rig.ref_sensor = SensorId{SensorType::kCamera, camera_of_folder.begin()->second};
  for (const auto& [folder, camera_id] : camera_of_folder) {
    if (folder == reference) continue;
    rig.sensors.push_back({{SensorType::kCamera, camera_id}, sensor_from_rig.at(folder)});
  }
  std::vector<std::pair<Frame, std::vector<image_t>>> frames;
  for (const auto& [name, images] : instants) {
    Frame frame;
    frame.rig_id = 1;
    std::vector<image_t> ids;
    const auto& [first_folder, first_id] = *images.begin();
    frame.rig_from_world =
        sensor_from_rig.at(first_folder).Inverse() * model->images.at(first_id).cam_from_world;
    for (const auto& [folder, id] : images) {
      const Image& image = model->images.at(id);
      const Rigid3d off =
          image.cam_from_world * (sensor_from_rig.at(folder) * frame.rig_from_world).Inverse();
      if (LogRotation(off.rotation).norm() > kMaxBendRad || off.translation.norm() > kMaxBendM)
        return false;
      frame.data.push_back({{SensorType::kCamera, image.camera_id}, id});
      ids.push_back(id);
    }
    frames.emplace_back(std::move(frame), std::move(ids));
  }
  model->rigs.Add(1, std::move(rig));
  frame_t frame_id = 0;
  for (auto& [frame, ids] : frames) {
    ++frame_id;
    for (const image_t id : ids) model->images.at(id).frame_id = frame_id;
    const Rigid3d pose = frame.rig_from_world;
    model->frames.Add(frame_id, std::move(frame));
    model->SetFramePose(frame_id, pose);
  }
  model->has_rig_files = true;
  return true;
}

void AddScans(const fs::path& folder, const std::string& kind, Dataset* dataset) {
  for (const std::string& name : {kind + "_scan_eval", kind + "_scan_clean"}) {
    const fs::path project = folder / name / "scan_alignment.mlp";
    if (!fs::is_regular_file(project)) continue;
    dataset->surfaces.push_back({"scans/scan_alignment.mlp", project});
    for (const auto& entry : fs::directory_iterator(folder / name)) {
      if (entry.path().extension() == ".ply") {
        dataset->surfaces.push_back({"scans/" + entry.path().filename().string(), entry.path()});
      }
    }
    std::sort(dataset->surfaces.begin(), dataset->surfaces.end(),
              [](const DatasetFile& a, const DatasetFile& b) { return a.name < b.name; });
    dataset->point_cloud_name = "scans/scan_alignment.mlp";
    return;
  }
  dataset->notes.push_back("There are no laser scans (" + kind +
                           "_scan_eval) in the folder: nothing to evaluate geometry against.");
}

}  // namespace

Dataset ReadEth3d(const fs::path& folder, const DatasetOptions& options) {
  const fs::path calibration = CalibrationOf(folder, options.part);
  const std::string kind = calibration.filename().string().starts_with("rig") ? "rig" : "dslr";
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.part = kind;
  dataset.pose_source = "laser scans, to which the authors aligned the images";
  dataset.truth = CamerasOf(ReadPoses(calibration), options.stride);
  if (dataset.truth.images.empty())
    throw InputError(calibration, "expected the poses of images in images.txt, found none");
  for (const auto& [id, image] : dataset.truth.images) {
    dataset.images.push_back({image.name, NeededFile(folder / "images" / image.name,
                                                     "a photograph that images.txt has")});
  }
  if (kind == "rig" && !JoinRig(&dataset.truth)) {
    dataset.notes.push_back(
        "The cameras of the rig do not stand to each other alike in all instants: each image has "
        "a pose of its own, and there are no rigs in the model.");
  }
  if (!dataset.truth.has_rig_files) dataset.truth.AddTrivialRigsAndFrames();
  AddScans(folder, kind, &dataset);
  return dataset;
}

}  // namespace holba
