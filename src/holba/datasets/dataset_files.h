// SPDX-License-Identifier: BSD-3-Clause
// What the adapters share: finding files, tables of text, trajectories, and models of cameras whose
// poses are known or not.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "holba/datasets/dataset.h"
#include "holba/geometry/rigid3d.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// The path, which must be there. Throw InputError naming it, and `what` it would hold.
std::filesystem::path NeededFile(const std::filesystem::path& path, std::string_view what);
std::filesystem::path NeededFolder(const std::filesystem::path& path, std::string_view what);
// The first that is there. Throws InputError naming all of them.
std::filesystem::path FirstFolder(const std::filesystem::path& folder,
                                  const std::vector<std::string>& names, std::string_view what);

// Names of photographs (jpg, png; any case) in a folder, ascending. Throws InputError: there are
// none.
std::vector<std::string> PhotographsIn(const std::filesystem::path& folder);
// Names of folders in a folder that begin with `prefix`, ascending.
std::vector<std::string> FoldersIn(const std::filesystem::path& folder, std::string_view prefix);
// The last component, also of "." and of a path that ends with '/'.
std::string NameOfFolder(const std::filesystem::path& folder);

// One row of a text file: its words, separated by blanks or commas, and its line.
struct TextRow {
  std::vector<std::string> words;
  uint64_t line = 0;
};
// Rows that are not empty and do not begin with '#'.
std::vector<TextRow> ReadRows(const std::filesystem::path& path);
// A finite number of a row. Throws InputError with file, line and `what` it would be.
double NumberIn(const TextRow& row, size_t column, std::string_view what,
                const std::filesystem::path& path);

struct StampedPose {
  double time_s = 0.0;
  Rigid3d world_from_body;
};

// "t x y z qx qy qz qw" (TUM), or "t x y z qw qx qy qz ..." (`quaternion_starts_with_w`), times
// multiplied by `seconds_per_unit`, ascending. Throws InputError, also if no rotation is a unit
// quaternion to 1 %.
std::vector<StampedPose> ReadTrajectory(const std::filesystem::path& path,
                                        bool quaternion_starts_with_w, double seconds_per_unit);
// Between the two poses around it (linear, and the shorter arc). Empty: they are farther apart than
// `max_gap_s`, or there is none on one side.
std::optional<Rigid3d> PoseAt(const std::vector<StampedPose>& trajectory, double time_s,
                              double max_gap_s);

// A rotation and translation of 16 numbers, row by row. Empty: no rigid motion, to 1e-3.
std::optional<Rigid3d> RigidFromRows(const std::vector<double>& rows);

// Size of the photograph, and parameters in the order of the model's names.
Camera MakeCamera(std::string_view model, uint64_t width, uint64_t height,
                  std::vector<double> params);
// The same, of the size that a photograph has. Throws InputError.
Camera CameraOfPhotograph(std::string_view model, const std::filesystem::path& photograph,
                          std::vector<double> params);

// Images with ids from 1 in the order of the calls, each alone in a frame; without a pose:
// unregistered.
class TruthBuilder {
 public:
  explicit TruthBuilder(Dataset* dataset) : dataset_(dataset) {}

  camera_t AddCamera(Camera camera);
  void AddImage(const std::string& name, const std::filesystem::path& source, camera_t camera_id,
                const std::optional<Rigid3d>& cam_from_world);
  // Rigs and frames; refuses a set of which no image has a pose.
  void Finish(const std::filesystem::path& pose_file);

 private:
  Dataset* dataset_;
  std::vector<std::pair<image_t, Image>> without_pose_;
};

// A model of COLMAP as truth: only the images that `wanted` says by name, without their keypoints
// and points; `stride` counts names without their folder, ascending.
Reconstruction CamerasOf(const Reconstruction& model, int stride);

}  // namespace holba
