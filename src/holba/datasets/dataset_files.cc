// SPDX-License-Identifier: BSD-3-Clause
#include "holba/datasets/dataset_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/frontend/photographs/photograph_header.h"
#include "holba/io/text_io.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

bool IsPhotograph(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png";
}

// Entries of a folder, ascending by name.
std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> entries;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    entries.push_back(it->path());
  }
  if (error) throw CannotBeRead(folder, error.message());
  std::sort(entries.begin(), entries.end());
  return entries;
}

}  // namespace

fs::path NeededFile(const fs::path& path, std::string_view what) {
  if (fs::is_regular_file(path)) return path;
  throw InputError(path, fmt::format("expected {}, found no such file; check that --input_path is "
                                     "the folder of one scene, whole and unpacked",
                                     what));
}

fs::path NeededFolder(const fs::path& path, std::string_view what) {
  if (fs::is_directory(path)) return path;
  throw InputError(path, fmt::format("expected a folder of {}, found none; check --input_path and "
                                     "whether all of the scene was downloaded",
                                     what));
}

fs::path FirstFolder(const fs::path& folder, const std::vector<std::string>& names,
                     std::string_view what) {
  std::string listed;
  for (const std::string& name : names) {
    if (fs::is_directory(folder / name)) return folder / name;
    listed += (listed.empty() ? "" : ", ") + name;
  }
  throw InputError(folder, fmt::format("expected one of the folders {} with {}, found none of them",
                                       listed, what));
}

std::vector<std::string> PhotographsIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::path& entry : EntriesOf(NeededFolder(folder, "photographs"))) {
    if (IsPhotograph(entry)) names.push_back(entry.filename().string());
  }
  if (names.empty()) throw InputError(folder, "expected photographs (jpg or png), found none");
  return names;
}

std::vector<std::string> FoldersIn(const fs::path& folder, std::string_view prefix) {
  std::vector<std::string> names;
  for (const fs::path& entry : EntriesOf(folder)) {
    const std::string name = entry.filename().string();
    if (fs::is_directory(entry) && name.starts_with(prefix)) names.push_back(name);
  }
  return names;
}

std::string NameOfFolder(const fs::path& folder) {
  const fs::path whole = fs::weakly_canonical(folder);
  return whole.has_filename() ? whole.filename().string() : whole.parent_path().filename().string();
}

std::vector<TextRow> ReadRows(const fs::path& path) {
  const std::string bytes = ReadFileBytes(path);
  RefuseUtf16(bytes, path);
  std::vector<TextRow> rows;
  uint64_t line = 0;
  for (size_t begin = 0; begin < bytes.size(); ++line) {
    const size_t end = std::min(bytes.find('\n', begin), bytes.size());
    TextRow row;
    row.line = line + 1;
    std::string word;
    for (size_t i = begin; i <= end; ++i) {
      const char c = i < end ? bytes[i] : ' ';
      if (c == ' ' || c == '\t' || c == '\r' || c == ',') {
        if (!word.empty()) row.words.push_back(std::move(word));
        word.clear();
      } else {
        word += c;
      }
    }
    if (!row.words.empty() && row.words[0][0] != '#') rows.push_back(std::move(row));
    begin = end + 1;
  }
  return rows;
}

double NumberIn(const TextRow& row, size_t column, std::string_view what, const fs::path& path) {
  double value = 0.0;
  std::string found = "the end of the line";
  if (column < row.words.size()) {
    const std::string& word = row.words[column];
    const size_t sign = word[0] == '+' ? 1 : 0;
    const auto [end, error] = std::from_chars(word.data() + sign, word.data() + word.size(), value);
    if (error == std::errc() && end == word.data() + word.size() && std::isfinite(value))
      return value;
    found = "'" + word.substr(0, 40) + "'";
  }
  throw InputError::AtLine(path, row.line,
                           fmt::format("expected {} (a finite number), found {}", what, found));
}

std::vector<StampedPose> ReadTrajectory(const fs::path& path, bool quaternion_starts_with_w,
                                        double seconds_per_unit) {
  std::vector<StampedPose> trajectory;
  for (const TextRow& row : ReadRows(path)) {
    StampedPose pose;
    pose.time_s = seconds_per_unit * NumberIn(row, 0, "a time", path);
    for (int i = 0; i < 3; ++i) {
      pose.world_from_body.translation[i] = NumberIn(row, 1 + i, "a position", path);
    }
    double q[4];
    for (int i = 0; i < 4; ++i) q[i] = NumberIn(row, 4 + i, "a quaternion", path);
    Eigen::Quaterniond rotation = quaternion_starts_with_w
                                      ? Eigen::Quaterniond(q[0], q[1], q[2], q[3])
                                      : Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
    if (!(std::abs(rotation.norm() - 1.0) < 0.01)) {
      throw InputError::AtLine(
          path, row.line,
          fmt::format("expected a quaternion of length 1, found one of {}", rotation.norm()));
    }
    pose.world_from_body.rotation = rotation.normalized();
    trajectory.push_back(pose);
  }
  if (trajectory.empty()) throw InputError(path, "expected the poses of a trajectory, found none");
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.time_s < b.time_s; });
  return trajectory;
}

std::optional<Rigid3d> PoseAt(const std::vector<StampedPose>& trajectory, double time_s,
                              double max_gap_s) {
  const auto after =
      std::lower_bound(trajectory.begin(), trajectory.end(), time_s,
                       [](const StampedPose& pose, double time) { return pose.time_s < time; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->time_s == time_s) return after->world_from_body;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = after - 1;
  const double gap_s = after->time_s - before->time_s;
  if (gap_s > max_gap_s) return std::nullopt;
  const double part = (time_s - before->time_s) / gap_s;
  const Rigid3d &a = before->world_from_body, &b = after->world_from_body;
  return Rigid3d(a.rotation.slerp(part, b.rotation),
                 (1.0 - part) * a.translation + part * b.translation);
}

std::optional<Rigid3d> RigidFromRows(const std::vector<double>& rows) {
  if (rows.size() != 16) return std::nullopt;
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(rows.data());
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3)) return std::nullopt;
  if (!(R.determinant() > 0.0)) return std::nullopt;
  return Rigid3d(Eigen::Quaterniond(R).normalized(), matrix.topRightCorner<3, 1>());
}

Camera MakeCamera(std::string_view model, uint64_t width, uint64_t height,
                  std::vector<double> params) {
  Camera camera;
  camera.model = FindCameraModel(model);
  HOLBA_CHECK(camera.model != nullptr &&
              camera.model->num_params == static_cast<int>(params.size()));
  camera.width = width;
  camera.height = height;
  camera.params = std::move(params);
  return camera;
}

Camera CameraOfPhotograph(std::string_view model, const fs::path& photograph,
                          std::vector<double> params) {
  const PhotographHeader header = ReadPhotographHeader(photograph);
  return MakeCamera(model, header.width, header.height, std::move(params));
}

camera_t TruthBuilder::AddCamera(Camera camera) {
  const auto id = static_cast<camera_t>(dataset_->truth.cameras.size() + 1);
  dataset_->truth.cameras.Add(id, std::move(camera));
  return id;
}

void TruthBuilder::AddImage(const std::string& name, const fs::path& source, camera_t camera_id,
                            const std::optional<Rigid3d>& cam_from_world) {
  dataset_->images.push_back({name, source});
  const auto id = static_cast<image_t>(dataset_->images.size());
  Image image;
  image.name = name;
  image.camera_id = camera_id;
  if (!cam_from_world) {
    without_pose_.emplace_back(id, std::move(image));
    return;
  }
  image.cam_from_world = *cam_from_world;
  dataset_->truth.images.Add(id, std::move(image));
}

void TruthBuilder::Finish(const fs::path& pose_file) {
  if (dataset_->truth.images.empty()) {
    throw InputError(pose_file,
                     "expected the pose of at least one photograph, found that of none; check that "
                     "poses and photographs are of one scene");
  }
  dataset_->truth.AddTrivialRigsAndFrames();
  for (auto& [id, image] : without_pose_) {
    dataset_->truth.AddUnregisteredImage(id, std::move(image));
  }
}

Reconstruction CamerasOf(const Reconstruction& model, int stride) {
  // By the instant that the file's name says, so that cameras of a rig stay together.
  std::set<std::string> instants;
  for (const auto& [id, image] : model.images) {
    instants.insert(fs::path(image.name).filename().string());
  }
  std::set<std::string> taken;
  size_t position = 0;
  for (const std::string& instant : instants) {
    if (position++ % static_cast<size_t>(stride) == 0) taken.insert(instant);
  }
  Reconstruction cameras;
  for (const auto& [id, camera] : model.cameras) cameras.cameras.Add(id, camera);
  for (const auto& [id, image] : model.images) {
    if (!taken.contains(fs::path(image.name).filename().string())) continue;
    Image bare;
    bare.name = image.name;
    bare.camera_id = image.camera_id;
    bare.cam_from_world = image.cam_from_world;
    cameras.images.Add(id, std::move(bare));
  }
  return cameras;
}

}  // namespace holba
