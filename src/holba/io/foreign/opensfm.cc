// SPDX-License-Identifier: BSD-3-Clause
// OpenSfM's reconstruction.json: a list of reconstructions, each with cameras, shots (rotation
// vector and translation of world to camera) and points. Lengths of cameras are in units of the
// photograph's longer side, from its middle. What shots see of the points is in tracks.csv beside
// it: SHOT TRACK FEATURE X Y SCALE R G B, tab by tab, below a line with the version. Of several
// reconstructions the one with most shots is read; shots of the others are images without a pose.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/json_value.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

bool Recognises(std::string_view bytes) {
  return bytes.find("\"shots\"") != std::string_view::npos &&
         bytes.find("\"cameras\"") != std::string_view::npos;
}

camera_t AddCamera(const std::string& key, const JsonValue& json, ForeignModel* model) {
  const std::string what = fmt::format("camera '{}'", key);
  const uint64_t width = json.At("width").Whole(), height = json.At("height").Whole();
  const auto w = static_cast<double>(width), h = static_cast<double>(height);
  const double size = std::max(w, h);
  const auto of = [&](const char* name) { return json.RealOr(name, 0.0); };
  // One focal length or two; a centre if the model has one.
  PinholeLens lens{.cx = 0.5 * w + size * of("c_x"),
                   .cy = 0.5 * h + size * of("c_y"),
                   .k1 = of("k1"),
                   .k2 = of("k2")};
  const std::string type = json.TextOr("projection_type", "perspective");
  if (type == "spherical" || type == "equirectangular")
    return model->AddCamera(what, "EQUIRECTANGULAR", width, height, {w, h});
  lens.fx = size * (json.Has("focal_x") ? json.At("focal_x") : json.At("focal")).Real();
  lens.fy = json.Has("focal_y") ? size * json.At("focal_y").Real() : lens.fx;
  if (type == "fisheye" && lens.fx == lens.fy) {
    return model->AddCamera(what, "RADIAL_FISHEYE", width, height,
                            {lens.fx, lens.cx, lens.cy, lens.k1, lens.k2});
  }
  if (type == "fisheye" || type == "fisheye_opencv") {
    return model->AddCamera(
        what, "OPENCV_FISHEYE", width, height,
        {lens.fx, lens.fy, lens.cx, lens.cy, lens.k1, lens.k2, of("k3"), of("k4")});
  }
  if (type == "brown") {
    lens.k3 = of("k3"), lens.p1 = of("p1"), lens.p2 = of("p2");
  } else if (type != "perspective" && type != "simple_radial" && type != "radial") {
    json.Fail(
        fmt::format("{} is of the type '{}', which no camera of COLMAP is; expected "
                    "perspective, simple_radial, radial, brown, fisheye, fisheye_opencv or "
                    "spherical",
                    what, type));
  }
  return AddPinhole(what, lens, width, height, model);
}

std::optional<Rigid3d> ReadPose(const JsonValue& shot) {
  if (!shot.Has("rotation") || !shot.Has("translation")) return std::nullopt;
  const Eigen::Vector3d rotation = shot.At("rotation").Vector3();
  return Rigid3d(ExpRotation(rotation), shot.At("translation").Vector3());
}

// Tracks of tracks.csv whose points and shots the model has.
class TracksFile {
 public:
  TracksFile(const fs::path& path) : path_(path), bytes_(ReadFileBytes(path)) {}

  void Read(const std::map<std::string, image_t, std::less<>>& image_of,
            const std::map<std::string, point3D_t, std::less<>>& point_of, ForeignModel* model) {
    while (NextLine()) {
      if (line_.empty() || line_.starts_with("OPENSFM_TRACKS_VERSION")) continue;
      const std::string_view shot = Field("SHOT"), track = Field("TRACK");
      Field("FEATURE");
      const double x = Real("X"), y = Real("Y");
      const auto image = image_of.find(shot);
      const auto point = point_of.find(track);
      if (image == image_of.end() || point == point_of.end()) continue;
      const Camera& camera = model->CameraOf(image->second);
      const auto w = static_cast<double>(camera.width), h = static_cast<double>(camera.height);
      const double size = std::max(w, h);
      model->AddObservation(point->second, image->second, {size * x + 0.5 * w, size * y + 0.5 * h});
    }
  }

 private:
  bool NextLine() {
    if (next_ >= bytes_.size()) return false;
    const size_t end = std::min(bytes_.find('\n', next_), bytes_.size());
    line_ = std::string_view(bytes_).substr(next_, end - next_);
    if (line_.ends_with('\r')) line_.remove_suffix(1);
    next_ = end + 1;
    ++number_;
    return true;
  }
  std::string_view Field(const char* what) {
    if (line_.empty()) {
      throw InputError::AtLine(path_, number_,
                               fmt::format("expected {}, found that the line ends here", what));
    }
    const size_t end = std::min(line_.find('\t'), line_.size());
    const std::string_view field = line_.substr(0, end);
    line_.remove_prefix(std::min(end + 1, line_.size()));
    return field;
  }
  double Real(const char* what) {
    const std::string_view field = Field(what);
    double value = 0.0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size() || !std::isfinite(value)) {
      throw InputError::AtLine(
          path_, number_,
          fmt::format("expected {} (a number between tabs), found '{}'", what, field));
    }
    return value;
  }

  const fs::path path_;
  const std::string bytes_;
  std::string_view line_;
  size_t next_ = 0;
  uint64_t number_ = 0;
};

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  const JsonValue json = JsonValue::Parse(bytes, path);
  // A single one may stand without its list.
  std::vector<JsonValue> all = json.IsList() ? json.List() : std::vector{json};
  if (all.empty()) json.FailExpected("a list of at least one reconstruction");
  std::stable_sort(all.begin(), all.end(), [](const JsonValue& a, const JsonValue& b) {
    return a.At("shots").Entries().size() > b.At("shots").Entries().size();
  });
  ForeignModel model(path);
  std::map<std::string, camera_t> camera_of;
  std::map<std::string, image_t, std::less<>> image_of;
  std::map<std::string, image_t, std::less<>> posed_image_of;
  for (const JsonValue& reconstruction : all) {
    const bool is_first = reconstruction.place() == all.front().place();
    for (const auto& [key, camera] : reconstruction.At("cameras").Entries()) {
      if (!camera_of.contains(key)) camera_of[key] = AddCamera(key, camera, &model);
    }
    for (const auto& [name, shot] : reconstruction.At("shots").Entries()) {
      if (image_of.contains(name)) continue;
      const JsonValue of_camera = shot.At("camera");
      const auto camera = camera_of.find(of_camera.Text());
      if (camera == camera_of.end()) of_camera.FailExpected("the name of a camera");
      const std::optional<Rigid3d> pose = is_first ? ReadPose(shot) : std::nullopt;
      const image_t image_id = image_of[name] = model.AddImage(name, camera->second, pose);
      if (pose) posed_image_of[name] = image_id;
    }
  }
  if (all.size() > 1) {
    LogWarning("{} holds {}, of which the one with most shots is read", path.string(),
               Counted(all.size(), "reconstruction"));
  }
  std::map<std::string, point3D_t, std::less<>> point_of;
  if (const std::optional<JsonValue> points = all.front().Find("points")) {
    for (const auto& [key, point] : points->Entries()) {
      std::array<uint8_t, 3> rgb{0, 0, 0};
      if (const std::optional<JsonValue> colour = point.Find("color")) {
        const std::vector<double> values = colour->Reals(3);
        for (size_t i = 0; i < 3; ++i)
          rgb[i] = static_cast<uint8_t>(std::clamp(values[i], 0.0, 255.0));
      }
      point_of[key] = model.AddPoint(point.At("coordinates").Vector3(), rgb);
    }
  }
  const fs::path tracks = path.parent_path() / "tracks.csv";
  std::error_code ignored;
  if (fs::is_regular_file(tracks, ignored)) {
    TracksFile(tracks).Read(posed_image_of, point_of, &model);
  }
  return model.Finish(/*strip_common_folder=*/false);
}

}  // namespace

ForeignFormat OpenSfmFormat() {
  return {.name = "OpenSfM's reconstruction.json",
          .file_names = {"reconstruction.json"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
