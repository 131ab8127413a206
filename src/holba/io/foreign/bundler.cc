// SPDX-License-Identifier: BSD-3-Clause
// Bundler's bundle.out (Snavely; also VisualSFM's, OpenMVG's and COLMAP's exports), version 0.3:
//   # Bundle file v0.3
//   NUM_CAMERAS NUM_POINTS
//   for each camera: f k1 k2, three rows of R, t        (f = 0: without a pose)
//   for each point: X Y Z, R G B, NUM_VIEWS (CAMERA KEY X Y)*
// P = R X + t looks along -z; pixels count from the middle of the image, x right, y up:
//   p = -P / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p.
// With y and z of the camera turned round and y of the pixels negated this is COLMAP's RADIAL with
// the principal point (0, 0): the file does not know how large its photographs are. Their names are
// in list.txt beside it, one a line, or in the folder above.
#include <fmt/format.h>

#include <Eigen/Geometry>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/record_faults.h"
#include "holba/io/text_io.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

bool Recognises(std::string_view bytes) { return bytes.starts_with("# Bundle file"); }

void NextField(TextIn& in, const char* what) {
  if (in.AtRecordEnd() && !in.NextRecord())
    in.Fail(fmt::format("expected {}, found that the file ends here: it is truncated", what));
}
double Real(TextIn& in, const char* what) {
  NextField(in, what);
  return in.Real(what);
}
uint64_t Number(TextIn& in, const char* what) {
  NextField(in, what);
  return in.Number(what);
}
// Each thing takes `min_bytes` of the file at least.
uint64_t Count(TextIn& in, const char* what, uint64_t num_bytes, uint64_t min_bytes) {
  const uint64_t count = Number(in, what);
  if (count > num_bytes / min_bytes) {
    in.Fail(fmt::format("expected {} of at most {} in a file of {} bytes, found {}", what,
                        num_bytes / min_bytes, num_bytes, count));
  }
  return count;
}

// Names of the photographs. Empty: there is no list of so many.
std::vector<std::string> NamesBeside(const fs::path& path, uint64_t count) {
  for (const fs::path& folder : {path.parent_path(), path.parent_path().parent_path()}) {
    const fs::path file = folder / "list.txt";
    std::error_code ignored;
    if (!fs::is_regular_file(file, ignored)) continue;
    const std::string bytes = ReadFileBytes(file);
    TextIn in(bytes, file);
    std::vector<std::string> names;
    while (in.NextRecord()) {
      // Behind the name there may be a 0 and a focal length.
      std::string name(in.Word("NAME", "the path of a photograph"));
      std::replace(name.begin(), name.end(), '\\', '/');
      names.push_back(name.starts_with("./") ? name.substr(2) : name);
    }
    if (names.size() == count) return names;
  }
  return {};
}

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  TextIn in(bytes, path);  // skips the line that begins with #
  const uint64_t num_cameras = Count(in, "NUM_CAMERAS", bytes.size(), 30);
  const uint64_t num_points = Count(in, "NUM_POINTS", bytes.size(), 14);
  const std::vector<std::string> names = NamesBeside(path, num_cameras);
  ForeignModel model(path);
  // In the camera, y and z turned round.
  const Eigen::Vector3d turn(1.0, -1.0, -1.0);
  for (uint64_t i = 0; i < num_cameras; ++i) {
    const double f = Real(in, "F"), k1 = Real(in, "K1"), k2 = Real(in, "K2");
    Eigen::Matrix3d rotation;
    for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = Real(in, "R");
    Eigen::Vector3d translation;
    for (int k = 0; k < 3; ++k) translation[k] = Real(in, "T");
    const std::string name =
        names.empty() ? fmt::format("camera_{:06}", i) : names[static_cast<size_t>(i)];
    std::optional<Rigid3d> pose;
    if (f != 0.0) {
      const std::optional<Eigen::Quaterniond> turned =
          RotationFromMatrix(turn.asDiagonal() * rotation);
      if (!turned)
        in.Fail(fmt::format("expected a rotation matrix of camera {}, found no rotation", i));
      pose = Rigid3d(*turned, turn.cwiseProduct(translation));
    }
    // A camera that Bundler did not place has zeros; the image is kept without a pose.
    const camera_t camera_id = model.AddCamera(fmt::format("camera {}", i), "RADIAL", 0, 0,
                                               {f != 0.0 ? f : 1.0, 0.0, 0.0, k1, k2});
    model.AddImage(name, camera_id, pose);
  }
  for (uint64_t i = 0; i < num_points; ++i) {
    Eigen::Vector3d xyz;
    for (int k = 0; k < 3; ++k) xyz[k] = Real(in, "X Y Z");
    std::array<uint8_t, 3> rgb;
    for (uint8_t& channel : rgb) {
      NextField(in, "R G B");
      channel = in.Byte("R G B");
    }
    const point3D_t point3D_id = model.AddPoint(xyz, rgb);
    const uint64_t num_views = Count(in, "NUM_VIEWS", bytes.size(), 8);
    for (uint64_t k = 0; k < num_views; ++k) {
      const uint64_t camera_idx = Number(in, "CAMERA");
      if (camera_idx >= num_cameras)
        in.Fail(fmt::format("expected CAMERA below {}, found {}", num_cameras, camera_idx));
      Number(in, "KEY");
      const double x = Real(in, "X"), y = Real(in, "Y");
      const auto image_id = static_cast<image_t>(camera_idx + 1);
      if (!model.HasPose(image_id)) continue;  // a leftover of its mapper
      model.AddObservation(point3D_id, image_id, {x, -y});
    }
  }
  if (!in.AtRecordEnd() || in.NextRecord())
    in.Fail(fmt::format("expected no more than {} points, found more in the file", num_points));
  return model.Finish(!names.empty() && fs::path(names.front()).is_absolute());
}

}  // namespace

ForeignFormat BundlerFormat() {
  return {.name = "Bundler's bundle.out",
          .file_names = {"bundle.out", "bundle/bundle.out", "bundle.rd.out"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
