// SPDX-License-Identifier: BSD-3-Clause
// TUM RGB-D: rgb.txt ("time rgb/time.png"), groundtruth.txt ("time x y z qx qy qz qw", colour
// camera to world, metres, seconds). Source:
// https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
#include <fmt/format.h>

#include "holba/base/error.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// The motion capture gives 100 poses a second: a gap of a tenth is one in which it lost the
// markers.
constexpr double kMaxGapS = 0.1;

// Calibration of the three colour cameras by the authors (fx fy cx cy k1 k2 p1 p2 k3, their pixels
// count from the centre of the first one); the third's images are undistorted already.
struct Calibration {
  std::string_view name;
  double fx, fy, cx, cy, k1, k2, p1, p2, k3;
};
constexpr Calibration kCalibrations[] = {
    {"freiburg1", 517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633},
    {"freiburg2", 520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172},
    {"freiburg3", 535.4, 539.2, 320.1, 247.6, 0, 0, 0, 0, 0}};
// What the authors recommend where a sequence is of none of these.
constexpr Calibration kDefault = {"default", 525.0, 525.0, 319.5, 239.5, 0, 0, 0, 0, 0};

Calibration CalibrationOf(const std::string& scene, const std::string& part) {
  for (const Calibration& calibration : kCalibrations) {
    if (part == calibration.name || (part.empty() && scene.find(calibration.name) != scene.npos))
      return calibration;
  }
  if (!part.empty() && part != kDefault.name) {
    throw InputError(fmt::format(
        "--part: expected freiburg1, freiburg2, freiburg3 or default for TUM RGB-D, found '{}'",
        part));
  }
  return kDefault;
}

Camera CameraOf(const Calibration& c, const fs::path& photograph) {
  const double cx = c.cx + 0.5, cy = c.cy + 0.5;
  if (c.k1 == 0.0) return CameraOfPhotograph("PINHOLE", photograph, {c.fx, c.fy, cx, cy});
  return CameraOfPhotograph("FULL_OPENCV", photograph,
                            {c.fx, c.fy, cx, cy, c.k1, c.k2, c.p1, c.p2, c.k3, 0, 0, 0});
}

}  // namespace

Dataset ReadTumRgbd(const fs::path& folder, const DatasetOptions& options) {
  Dataset dataset;
  dataset.scene = NameOfFolder(folder);
  const Calibration calibration = CalibrationOf(dataset.scene, options.part);
  dataset.part = std::string(calibration.name);
  dataset.pose_source = "motion capture";
  dataset.notes = {
      "Poses are those of the motion capture at the time stamps of the images, of some millimetres "
      "and tenths of degrees."};
  if (calibration.name == kDefault.name) {
    dataset.notes.emplace_back(
        "The name of the folder has none of freiburg1 to 3: the intrinsics are "
        "nominal; --part freiburg1 says which camera it was.");
  }
  const fs::path list = NeededFile(folder / "rgb.txt", "the list of colour images");
  const fs::path truth_path = NeededFile(folder / "groundtruth.txt", "the trajectory");
  const std::vector<StampedPose> trajectory = ReadTrajectory(truth_path, false, 1.0);
  TruthBuilder builder(&dataset);
  camera_t camera_id = 0;
  size_t position = 0;
  for (const TextRow& row : ReadRows(list)) {
    if (position++ % static_cast<size_t>(options.stride) != 0) continue;
    const double time_s = NumberIn(row, 0, "a time", list);
    if (row.words.size() < 2)
      throw InputError::AtLine(list, row.line, "expected a time and a file, found a time only");
    const fs::path source = NeededFile(folder / row.words[1], "an image that rgb.txt has");
    if (camera_id == 0) camera_id = builder.AddCamera(CameraOf(calibration, source));
    std::optional<Rigid3d> cam_from_world = PoseAt(trajectory, time_s, kMaxGapS);
    if (cam_from_world) cam_from_world = cam_from_world->Inverse();
    builder.AddImage(source.filename().string(), source, camera_id, cam_from_world);
  }
  builder.Finish(truth_path);
  return dataset;
}

}  // namespace holba
