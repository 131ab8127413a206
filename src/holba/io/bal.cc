// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/bal.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <unordered_map>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/camera/snavely.h"
#include "holba/io/bzip2.h"
#include "holba/io/files.h"
#include "holba/io/text_io.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

// diag(1, -1, -1), half a turn about x, times a rotation: a permutation of the quaternion, so that
// it is undone without rounding.
Eigen::Quaterniond TurnAboutX(const Eigen::Quaterniond& q) {
  return {-q.x(), q.w(), -q.z(), q.y()};
}
Eigen::Quaterniond TurnBackAboutX(const Eigen::Quaterniond& q) {
  return {q.x(), -q.w(), q.z(), -q.y()};
}
Eigen::Vector3d TurnAboutX(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }

// Goes to the next line if this one is used up: numbers may be spread over lines in any way.
void ToNextField(TextIn& in, const char* what) {
  if (!in.AtRecordEnd() || in.NextRecord()) return;
  in.Fail(fmt::format("expected {}, found the end of the file: it is truncated", what));
}
double NextReal(TextIn& in, const char* what) {
  ToNextField(in, what);
  return in.Real(what);
}
uint64_t NextNumber(TextIn& in, const char* what) {
  ToNextField(in, what);
  return in.Number(what);
}

// `size`: bytes of the file; each thing takes `min_bytes` of it at least.
uint64_t NextCount(TextIn& in, const char* what, uint64_t size, uint64_t min_bytes) {
  const uint64_t count = NextNumber(in, what);
  if (count > size / min_bytes) {
    in.Fail(
        fmt::format("expected {} (at most {}, as the file has {} bytes), found {}: the file is "
                    "truncated or no BAL problem",
                    what, size / min_bytes, size, count));
  }
  return count;
}

struct BalIntrinsics {
  double f, k1, k2, cx, cy;
};

BalIntrinsics IntrinsicsForBal(camera_t camera_id, const Camera& camera) {
  const std::string_view model = camera.model->name;
  const std::vector<double>& p = camera.params;
  if (model == "SIMPLE_PINHOLE") return {p[0], 0.0, 0.0, p[1], p[2]};
  if (model == "PINHOLE" && p[0] == p[1]) return {p[0], 0.0, 0.0, p[2], p[3]};
  if (model == "SIMPLE_RADIAL") return {p[0], p[3], 0.0, p[1], p[2]};
  if (model == "RADIAL") return {p[0], p[3], p[4], p[1], p[2]};
  throw InputError(
      fmt::format("camera {} is {}{}, which a BAL problem cannot hold (it knows one focal length "
                  "and two radial coefficients); write a model folder instead",
                  camera_id, model, model == "PINHOLE" ? " with fx != fy" : ""));
}

}  // namespace

bool IsBalFile(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return false;
  std::ifstream stream(path, std::ios::binary);
  constexpr size_t kHead = 4096;
  std::string bytes(kHead, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(stream.gcount()));
  try {
    if (IsBzip2(bytes)) bytes = UnpackBzip2(ReadFileBytes(path), path, kHead);
    TextIn in(bytes, path);
    if (!in.NextRecord()) return false;
    for (int i = 0; i < 3; ++i) in.Number("a count");
    if (!in.AtRecordEnd() || !in.NextRecord()) return false;
    in.Number("CAMERA_IDX");
    in.Number("POINT_IDX");
    in.Real("X");
    in.Real("Y");
    return in.AtRecordEnd();
  } catch (const InputError&) {
    return false;
  }
}

Reconstruction ReadBal(const fs::path& path) {
  std::string bytes = ReadFileBytes(path);
  if (IsBzip2(bytes)) bytes = UnpackBzip2(bytes, path);
  return ParseBal(bytes, path);
}

Reconstruction ParseBal(std::string_view bytes, const fs::path& path) {
  TextIn in(bytes, path);
  const uint64_t num_cameras = NextCount(in, "NUM_CAMERAS", bytes.size(), 18);
  const uint64_t num_points = NextCount(in, "NUM_POINTS", bytes.size(), 6);
  const uint64_t num_observations = NextCount(in, "NUM_OBSERVATIONS", bytes.size(), 8);

  std::vector<Image> images(num_cameras);
  std::vector<Point3D> points(num_points);
  for (uint64_t i = 0; i < num_observations; ++i) {
    const uint64_t camera_idx = NextNumber(in, "CAMERA_IDX");
    if (camera_idx >= num_cameras) {
      in.Fail(fmt::format("expected CAMERA_IDX below {}, found {}", num_cameras, camera_idx));
    }
    const uint64_t point_idx = NextNumber(in, "POINT_IDX");
    if (point_idx >= num_points) {
      in.Fail(fmt::format("expected POINT_IDX below {}, found {}", num_points, point_idx));
    }
    Image& image = images[camera_idx];
    points[point_idx].track.push_back(
        {.image_id = static_cast<image_t>(camera_idx + 1),
         .point2D_idx = static_cast<point2D_t>(image.points2D.size())});
    const double x = NextReal(in, "X"), y = NextReal(in, "Y");
    image.points2D.push_back({.xy = {x, -y}, .point3D_id = point_idx + 1});
  }

  Reconstruction model;
  model.cameras.Reserve(num_cameras);
  model.images.Reserve(num_cameras);
  model.points3D.Reserve(num_points);
  const CameraModel* radial = &SnavelyCameraModel();
  for (uint64_t i = 0; i < num_cameras; ++i) {
    double values[9];
    constexpr const char* kNames[9] = {"RX", "RY", "RZ", "TX", "TY", "TZ", "F", "K1", "K2"};
    for (int k = 0; k < 9; ++k) values[k] = NextReal(in, kNames[k]);
    const auto id = static_cast<camera_t>(i + 1);
    Image& image = images[i];
    image.name = fmt::format("camera_{:06}", i);
    image.camera_id = id;
    image.cam_from_world.rotation =
        TurnAboutX(ExpRotation(Eigen::Vector3d(values[0], values[1], values[2])));
    image.cam_from_world.translation = TurnAboutX(Eigen::Vector3d(values[3], values[4], values[5]));
    if (!image.cam_from_world.rotation.coeffs().allFinite() || values[6] == 0.0) {
      in.Fail(fmt::format(
          "expected a rotation vector and a focal length of camera {}, found a rotation "
          "that is too large or a focal length of 0",
          i));
    }
    model.cameras.Add(id, {.model = radial, .params = {values[6], 0.0, 0.0, values[7], values[8]}});
    model.images.Add(id, std::move(image));
  }
  for (uint64_t i = 0; i < num_points; ++i) {
    const double x = NextReal(in, "X"), y = NextReal(in, "Y"), z = NextReal(in, "Z");
    points[i].xyz = {x, y, z};
    model.points3D.Add(i + 1, std::move(points[i]));
  }
  if (!in.AtRecordEnd() || in.NextRecord()) {
    in.Fail(fmt::format("expected the end of the file after {} points, found more", num_points));
  }
  model.AddTrivialRigsAndFrames();
  if (const std::optional<std::string> fault = model.FindInconsistency()) {
    throw InputError(path, *fault);
  }
  return model;
}

void WriteBal(const Reconstruction& model, const fs::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatBal(model, stream); });
}

void FormatBal(const Reconstruction& model, std::ostream* stream) {
  std::unordered_map<image_t, BalIntrinsics> intrinsics;
  for (const auto& [image_id, image] : model.images) {
    intrinsics.emplace(image_id,
                       IntrinsicsForBal(image.camera_id, model.cameras.at(image.camera_id)));
  }
  uint64_t num_observations = 0;
  for (const auto& [point3D_id, point] : model.points3D) num_observations += point.track.size();
  TextOut out(stream);
  out.Number(model.images.size());
  out.Number(model.points3D.size());
  out.Number(num_observations);
  out.EndRecord();
  uint64_t point_idx = 0;
  for (const auto& [point3D_id, point] : model.points3D) {
    for (const PointObservation& observation : point.track) {
      const Image& image = model.images.at(observation.image_id);
      const BalIntrinsics& k = intrinsics.at(observation.image_id);
      const Eigen::Vector2d& xy = image.points2D.at(observation.point2D_idx).xy;
      out.Number(model.images.IndexOf(observation.image_id));
      out.Number(point_idx);
      out.Real(xy.x() - k.cx);
      out.Real(-(xy.y() - k.cy));
      out.EndRecord();
    }
    ++point_idx;
  }
  const auto write = [&](double value) {
    out.Real(value);
    out.EndRecord();
  };
  for (const auto& [image_id, image] : model.images) {
    const Eigen::Vector3d rotation = LogRotation(TurnBackAboutX(image.cam_from_world.rotation));
    const Eigen::Vector3d translation = TurnAboutX(image.cam_from_world.translation);
    const BalIntrinsics& k = intrinsics.at(image_id);
    for (int i = 0; i < 3; ++i) write(rotation[i]);
    for (int i = 0; i < 3; ++i) write(translation[i]);
    for (const double value : {k.f, k.k1, k.k2}) write(value);
  }
  for (const auto& [point3D_id, point] : model.points3D) {
    for (int i = 0; i < 3; ++i) write(point.xyz[i]);
  }
}

}  // namespace holba
