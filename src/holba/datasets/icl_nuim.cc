// SPDX-License-Identifier: BSD-3-Clause
// ICL-NUIM in the form of TUM's benchmark: rgb/N.png, associations.txt ("N depth/N.png N
// rgb/N.png"), and the trajectory NAME.gt.freiburg ("N x y z qx qy qz qw", camera to world,
// metres). Source: https://www.doc.ic.ac.uk/~ahanda/VaFRIC/iclnuim.html.
//
// Its camera has the focal length -480 px along y: y points up in camera and world, both
// left-handed. Here y is mirrored in both: R' = F R F, t' = F t with F = diag(1, -1, 1), and the
// focal length is positive.
#include <algorithm>
#include <cmath>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// https://www.doc.ic.ac.uk/~ahanda/VaFRIC/codes.html; the principal point counts from the centre of
// the first pixel.
constexpr double kFxPx = 481.20, kFyPx = 480.00, kCxPx = 319.50 + 0.5, kCyPx = 239.50 + 0.5;

Rigid3d Mirrored(const Rigid3d& world_from_cam) {
  const Eigen::Vector3d flip(1.0, -1.0, 1.0);
  const Eigen::Matrix3d R = flip.asDiagonal() * world_from_cam.RotationMatrix() * flip.asDiagonal();
  return {Eigen::Quaterniond(R).normalized(), flip.cwiseProduct(world_from_cam.translation)};
}

// The one file whose name ends so. Empty: there is none.
fs::path FileEndingWith(const fs::path& folder, const std::vector<std::string>& endings) {
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    for (const std::string& ending : endings) {
      if (entry.is_regular_file() && name.ends_with(ending)) found.push_back(entry.path());
    }
  }
  std::sort(found.begin(), found.end());
  return found.empty() ? fs::path() : found.front();
}

void AddMesh(const fs::path& folder, Dataset* dataset) {
  const fs::path path = FileEndingWith(folder, {".obj", ".ply"});
  if (path.empty()) return;
  dataset->mesh = ReadMesh(path);
  for (Eigen::Vector3d& vertex : dataset->mesh->vertices) vertex.y() = -vertex.y();
  dataset->mesh_name = "mesh.ply";
  dataset->notes.push_back("mesh.ply is " + path.filename().string() +
                           ", mirrored as the poses are; whether the two were published in one "
                           "frame is for you to check.");
}

}  // namespace

Dataset ReadIclNuim(const fs::path& folder, const DatasetOptions& options) {
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  dataset.pose_source = "exact (rendered)";
  dataset.notes = {
      "y is mirrored in camera and world, which are left-handed in the files of the set."};
  const fs::path trajectory_path = FileEndingWith(folder, {".gt.freiburg", ".freiburg"});
  if (trajectory_path.empty())
    throw InputError(folder, "expected the trajectory NAME.gt.freiburg, found no such file");
  // Poses and images are numbered alike; the first image has no pose.
  const std::vector<StampedPose> trajectory = ReadTrajectory(trajectory_path, false, 1.0);
  const fs::path list = NeededFile(folder / "associations.txt", "pairs of depth and rgb images");
  TruthBuilder builder(&dataset);
  camera_t camera_id = 0;
  size_t position = 0;
  for (const TextRow& row : ReadRows(list)) {
    if (position++ % static_cast<size_t>(options.stride) != 0) continue;
    if (row.words.size() < 4)
      throw InputError::AtLine(list, row.line, "expected 'N depth/N.png N rgb/N.png', found less");
    const double number = NumberIn(row, 2, "the number of an image", list);
    const std::string& name = row.words[3];
    const fs::path source = NeededFile(folder / name, "a photograph that associations.txt has");
    if (camera_id == 0) {
      camera_id =
          builder.AddCamera(CameraOfPhotograph("PINHOLE", source, {kFxPx, kFyPx, kCxPx, kCyPx}));
    }
    std::optional<Rigid3d> cam_from_world;
    if (const auto world_from_cam = PoseAt(trajectory, number, 0.0))
      cam_from_world = Mirrored(*world_from_cam).Inverse();
    builder.AddImage(fs::path(name).filename().string(), source, camera_id, cam_from_world);
  }
  builder.Finish(trajectory_path);
  AddMesh(folder, &dataset);
  return dataset;
}

}  // namespace holba
