// SPDX-License-Identifier: BSD-3-Clause
// EuRoC MAV in ASL's form: mav0/camN/{sensor.yaml, data.csv, data/TIME.png}, the body's poses in
// mav0/state_groundtruth_estimate0/data.csv (nanoseconds, x y z, qw qx qy qz, body to world), in
// the Vicon rooms a laser scan in mav0/pointcloud0/data.ply. Source:
// https://projects.asl.ethz.ch/datasets/doku.php?id=kmavvisualinertialdatasets.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/datasets/dataset.h"
#include "holba/datasets/dataset_files.h"

namespace holba {
namespace fs = std::filesystem;

namespace {

// Poses come 200 times a second; a longer gap is one of the motion capture.
constexpr double kMaxGapS = 0.1;
constexpr double kSecondsPerNanosecond = 1e-9;

struct Sensor {
  std::string name;  // "cam0"
  Camera camera;
  Rigid3d body_from_sensor;
  std::map<std::string, std::string> files;  // by the time stamp's digits
};

// The numbers in the brackets behind "key:". Throws InputError unless there are `count`.
std::vector<double> ListOf(const std::string& yaml, const std::string& key, size_t count,
                           const fs::path& path) {
  std::vector<double> values;
  const size_t at = yaml.find(key + ":");
  const size_t open = at == std::string::npos ? at : yaml.find('[', at);
  const size_t close = open == std::string::npos ? open : yaml.find(']', open);
  if (close != std::string::npos) {
    const char* p = yaml.data() + open + 1;
    const char* const end = yaml.data() + close;
    while (p < end) {
      double value;
      const auto [next, error] = std::from_chars(p, end, value);
      if (error == std::errc()) values.push_back(value);
      p = error == std::errc() ? next : p + 1;
    }
  }
  if (values.size() == count) return values;
  throw InputError(path, fmt::format("expected '{}: [..]' with {} numbers, found {}", key, count,
                                     values.size()));
}

// Of the list behind "data:" in the block of T_BS.
Rigid3d BodyFromSensor(const std::string& yaml, const fs::path& path) {
  const size_t block = yaml.find("T_BS:");
  const std::string rest = block == std::string::npos ? "" : yaml.substr(block);
  const std::optional<Rigid3d> pose = RigidFromRows(ListOf(rest, "data", 16, path));
  if (!pose) throw InputError(path, "the matrix T_BS must be a rotation and a translation");
  return *pose;
}

Sensor ReadSensor(const fs::path& folder) {
  Sensor sensor;
  sensor.name = folder.filename().string();
  const fs::path yaml_path = NeededFile(folder / "sensor.yaml", "the calibration of a camera");
  const std::string yaml = ReadFileBytes(yaml_path);
  sensor.body_from_sensor = BodyFromSensor(yaml, yaml_path);
  const std::vector<double> size = ListOf(yaml, "resolution", 2, yaml_path);
  const std::vector<double> f = ListOf(yaml, "intrinsics", 4, yaml_path);
  const std::vector<double> k = ListOf(yaml, "distortion_coefficients", 4, yaml_path);
  // Their pixels count from the centre of the first one.
  sensor.camera =
      MakeCamera("OPENCV", static_cast<uint64_t>(size[0]), static_cast<uint64_t>(size[1]),
                 {f[0], f[1], f[2] + 0.5, f[3] + 0.5, k[0], k[1], k[2], k[3]});
  const fs::path list = NeededFile(folder / "data.csv", "the list of images");
  for (const TextRow& row : ReadRows(list)) {
    if (row.words.size() < 2)
      throw InputError::AtLine(list, row.line, "expected a time and a file, found less");
    NumberIn(row, 0, "a time", list);
    sensor.files[row.words[0]] = row.words[1];
  }
  return sensor;
}

std::vector<Sensor> ReadSensors(const fs::path& folder, const std::string& part) {
  std::vector<std::string> names = FoldersIn(folder, "cam");
  if (!part.empty()) names = {part};
  if (names.empty()) throw InputError(folder, "expected folders cam0, cam1, found none");
  std::vector<Sensor> sensors;
  for (const std::string& name : names) {
    sensors.push_back(ReadSensor(NeededFolder(folder / name, "a camera's images")));
  }
  return sensors;
}

// The first camera is the rig's reference, with the ids of cameras from 1.
Rig RigOf(const std::vector<Sensor>& sensors) {
  Rig rig;
  for (size_t i = 0; i < sensors.size(); ++i) {
    const SensorId id{SensorType::kCamera, static_cast<uint32_t>(i + 1)};
    if (i == 0) {
      rig.ref_sensor = id;
    } else {
      rig.sensors.push_back(
          {id, sensors[i].body_from_sensor.Inverse() * sensors[0].body_from_sensor});
    }
  }
  return rig;
}

}  // namespace

Dataset ReadEuRoC(const fs::path& folder, const DatasetOptions& options) {
  const fs::path mav = fs::is_directory(folder / "mav0") ? folder / "mav0" : folder;
  const std::vector<Sensor> sensors = ReadSensors(mav, options.part);
  const fs::path truth_path =
      NeededFile(mav / "state_groundtruth_estimate0" / "data.csv", "the poses of the body");
  const std::vector<StampedPose> trajectory =
      ReadTrajectory(truth_path, true, kSecondsPerNanosecond);

  Dataset dataset;
  dataset.scene = NameOfFolder(mav == folder ? folder : mav.parent_path());
  dataset.part = options.part.empty() ? "all cameras" : options.part;
  dataset.pose_source = "motion capture or laser tracker, smoothed with the inertial sensor";
  std::map<std::string, std::vector<size_t>> instants;  // sensors by time stamp
  for (size_t i = 0; i < sensors.size(); ++i) {
    dataset.truth.cameras.Add(static_cast<camera_t>(i + 1), sensors[i].camera);
    for (const auto& [time, file] : sensors[i].files) instants[time].push_back(i);
  }
  dataset.truth.rigs.Add(1, RigOf(sensors));
  dataset.truth.has_rig_files = true;

  size_t position = 0, num_without_pose = 0;
  for (const auto& [time, seen_by] : instants) {
    if (position++ % static_cast<size_t>(options.stride) != 0) continue;
    const auto world_from_body =
        PoseAt(trajectory, kSecondsPerNanosecond * std::stod(time), kMaxGapS);
    if (!world_from_body) {
      ++num_without_pose;
      continue;
    }
    const auto frame_id = static_cast<frame_t>(dataset.truth.frames.size() + 1);
    Frame frame;
    frame.rig_id = 1;
    for (const size_t i : seen_by) {
      const Sensor& sensor = sensors[i];
      const std::string& file = sensor.files.at(time);
      const auto image_id = static_cast<image_t>(dataset.images.size() + 1);
      dataset.images.push_back(
          {sensor.name + "/" + file,
           NeededFile(mav / sensor.name / "data" / file, "an image that data.csv has")});
      frame.data.push_back({{SensorType::kCamera, static_cast<uint32_t>(i + 1)}, image_id});
      Image image;
      image.name = dataset.images.back().name;
      image.camera_id = static_cast<camera_t>(i + 1);
      image.frame_id = frame_id;
      dataset.truth.images.Add(image_id, std::move(image));
    }
    dataset.truth.frames.Add(frame_id, std::move(frame));
    dataset.truth.SetFramePose(frame_id,
                               (*world_from_body * sensors[0].body_from_sensor).Inverse());
  }
  if (dataset.truth.images.empty()) {
    throw InputError(truth_path,
                     "expected poses at the times of images, found none; check that images and "
                     "poses are of one sequence");
  }
  if (num_without_pose > 0) {
    dataset.notes.push_back(fmt::format(
        "{} of the instants are outside of the true trajectory, and left out.", num_without_pose));
  }
  const fs::path cloud = mav / "pointcloud0" / "data.ply";
  if (fs::is_regular_file(cloud)) {
    dataset.surfaces.push_back({"cloud.ply", cloud});
    dataset.point_cloud_name = "cloud.ply";
  }
  return dataset;
}

}  // namespace holba
