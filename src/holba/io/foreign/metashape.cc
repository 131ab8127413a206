// SPDX-License-Identifier: BSD-3-Clause
// Metashape's (Agisoft) cameras.xml: sensors with calibrations, cameras with the matrix of camera
// to chunk (x right, y down, z forward; pixels from the corner of the first one, as COLMAP's). It
// has no points. The model is in the chunk's own frame; of a chunk in several components, whose
// frames differ, each is put where its <transform> says. A calibration is, with (x, y) = (X, Y) /
// Z, or of a fisheye these at the distance theta from the middle:
//   x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y,
//   y' = y (1 + ...) + p2 (r^2 + 2 y^2) + 2 p1 x y,
//   u = w/2 + cx + x' (f + b1) + y' b2,  v = h/2 + cy + y' f       (Metashape's manual, appendix C)
// so that p1 and p2 are OpenCV's p2 and p1. COLMAP's cameras have no skew b2, and those that are
// not fisheyes no k4: what that amounts to at the corners of the photograph is said on the log.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/words.h"
#include "holba/io/foreign/foreign_model.h"
#include "holba/io/foreign/xml_element.h"

namespace holba {
namespace fs = std::filesystem;
namespace {

bool Recognises(std::string_view bytes) {
  return bytes.find("<document") != std::string_view::npos &&
         bytes.find("<chunk") != std::string_view::npos;
}

class Reader {
 public:
  explicit Reader(const fs::path& path) : path_(path), model_(path) {}

  Reconstruction Read(const XmlElement& root) {
    const XmlElement& chunk = FindChunk(root);
    if (const XmlElement* sensors = chunk.Find("sensors")) {
      for (const XmlElement& sensor : sensors->children) {
        if (sensor.name == "sensor") AddSensor(sensor);
      }
    }
    ReadComponents(chunk);
    ReadCameras(*chunk.Find("cameras"));
    if (lost_px_ > 0.1) {
      LogWarning(
          "{}: the lenses of {} have a skew or a coefficient that COLMAP's cameras lack, of up to "
          "{:.1f} px at the corners of the photographs; refine with adjusted intrinsics, or export "
          "undistorted photographs",
          path_.string(), Counted(num_lossy_, "sensor"), lost_px_);
    }
    return model_.Finish(/*strip_common_folder=*/false);
  }

 private:
  struct Component {
    Sim3d chunk_from_component;
    bool has_transform = false;
    size_t num_cameras = 0;
  };

  [[noreturn]] void FailExpected(const XmlElement& at, const std::string& expected,
                                 const std::string& found) const {
    throw InputError::AtLine(path_, at.line, fmt::format("expected {}, found {}", expected, found));
  }

  const XmlElement& FindChunk(const XmlElement& root) const {
    std::vector<const XmlElement*> chunks;
    const auto look = [&](const XmlElement& parent) {
      for (const XmlElement& child : parent.children) {
        if (child.name == "chunk" && child.Find("cameras") != nullptr) chunks.push_back(&child);
      }
    };
    look(root);
    if (const XmlElement* list = root.Find("chunks")) look(*list);
    if (chunks.empty()) FailExpected(root, "a <chunk> with <cameras>", "none");
    if (chunks.size() > 1) {
      LogWarning("{} holds {}, each in a frame of its own; the first one is read", path_.string(),
                 Counted(chunks.size(), "model"));
    }
    return *chunks.front();
  }

  double ToReal(const XmlElement& at, std::string_view word) const {
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      FailExpected(at, fmt::format("a finite number in <{}>", at.name), fmt::format("'{}'", word));
    return value;
  }
  std::vector<double> Reals(const XmlElement& at, size_t count) const {
    std::vector<double> values;
    std::string_view rest = at.text;
    while (true) {
      rest.remove_prefix(std::min(rest.find_first_not_of(" \t\r\n"), rest.size()));
      if (rest.empty()) break;
      const size_t size = std::min(rest.find_first_of(" \t\r\n"), rest.size());
      values.push_back(ToReal(at, rest.substr(0, size)));
      rest.remove_prefix(size);
    }
    if (values.size() != count) {
      FailExpected(at, fmt::format("{} in <{}>", Counted(count, "number"), at.name),
                   std::to_string(values.size()));
    }
    return values;
  }
  double ChildOr(const XmlElement& at, std::string_view name, double value) const {
    const XmlElement* const child = at.Find(name);
    return child ? Reals(*child, 1)[0] : value;
  }
  double RealAttribute(const XmlElement& at, std::string_view name) const {
    const std::optional<std::string> value = at.Attribute(name);
    if (!value) FailExpected(at, fmt::format("{} of <{}>", name, at.name), "none");
    return ToReal(at, *value);
  }
  std::string Id(const XmlElement& at, std::string_view name) const {
    const std::optional<std::string> id = at.Attribute(name);
    if (!id) FailExpected(at, fmt::format("{} of <{}>", name, at.name), "none");
    return *id;
  }

  // The adjusted calibration, else the last one. Null: none.
  static const XmlElement* FindCalibration(const XmlElement& sensor) {
    const XmlElement* calibration = nullptr;
    for (const XmlElement& child : sensor.children) {
      if (child.name != "calibration") continue;
      const bool is_adjusted = calibration != nullptr && calibration->Attribute("class") ==
                                                             std::optional<std::string>("adjusted");
      if (!is_adjusted) calibration = &child;
    }
    return calibration;
  }

  // Focal length in pixels of a sensor that was not calibrated, from millimetres.
  double FocalLengthOfSensor(const XmlElement& sensor) const {
    double f_mm = 0.0, pixel_mm = 0.0;
    for (const XmlElement& child : sensor.children) {
      if (child.name != "property" || !child.Attribute("name")) continue;
      if (*child.Attribute("name") == "focal_length") f_mm = RealAttribute(child, "value");
      if (*child.Attribute("name") == "pixel_width") pixel_mm = RealAttribute(child, "value");
    }
    if (!(f_mm > 0.0) || !(pixel_mm > 0.0))
      FailExpected(sensor, "a <calibration> of this sensor, or its focal_length and pixel_width",
                   "neither");
    return f_mm / pixel_mm;
  }

  void AddSensor(const XmlElement& sensor) {
    const std::string id = Id(sensor, "id");
    const std::string what = fmt::format("sensor {}", id);
    const XmlElement* const resolution = sensor.Find("resolution");
    if (resolution == nullptr) FailExpected(sensor, "<resolution> of this sensor", "none");
    const double w = RealAttribute(*resolution, "width"), h = RealAttribute(*resolution, "height");
    if (!(w >= 1.0 && w <= 1e6 && h >= 1.0 && h <= 1e6))
      FailExpected(*resolution, "a width and a height of 1 to 1000000 pixels", "others");
    const auto width = static_cast<uint64_t>(w), height = static_cast<uint64_t>(h);
    const XmlElement* const calibration = FindCalibration(sensor);
    std::string type = sensor.Attribute("type").value_or("frame");
    if (calibration != nullptr) type = calibration->Attribute("type").value_or(type);
    if (type == "spherical") {
      camera_of_[id] = model_.AddCamera(what, "EQUIRECTANGULAR", width, height, {w, h});
      return;
    }
    if (type != "frame" && type != "fisheye" && type != "equidistant_fisheye")
      FailExpected(sensor, "a sensor of type frame, fisheye or spherical",
                   fmt::format("'{}', which no camera of COLMAP is", type));
    if (calibration == nullptr) {
      PinholeLens lens{.cx = 0.5 * w, .cy = 0.5 * h};
      lens.fx = lens.fy = FocalLengthOfSensor(sensor);
      camera_of_[id] = AddPinhole(what, lens, width, height, &model_);
      return;
    }
    AddCalibrated(id, *calibration, type != "frame", width, height);
  }

  void AddCalibrated(const std::string& id, const XmlElement& calibration, bool is_fisheye,
                     uint64_t width, uint64_t height) {
    const std::string what = fmt::format("sensor {}", id);
    const auto w = static_cast<double>(width), h = static_cast<double>(height);
    const auto of = [&](const char* name) { return ChildOr(calibration, name, 0.0); };
    const double f = of("f"), b1 = of("b1"), b2 = of("b2"), k4 = of("k4");
    const PinholeLens lens{.fx = f + b1,
                           .fy = f,
                           .cx = 0.5 * w + of("cx"),
                           .cy = 0.5 * h + of("cy"),
                           .k1 = of("k1"),
                           .k2 = of("k2"),
                           .k3 = of("k3"),
                           .p1 = of("p2"),
                           .p2 = of("p1")};
    const auto& [fx, fy, cx, cy, k1, k2, k3, p1, p2] = lens;
    if (!is_fisheye) {
      camera_of_[id] = AddPinhole(what, lens, width, height, &model_);
    } else if (p1 == 0.0 && p2 == 0.0) {
      camera_of_[id] =
          model_.AddCamera(what, "OPENCV_FISHEYE", width, height, {fx, fy, cx, cy, k1, k2, k3, k4});
    } else {
      camera_of_[id] = model_.AddCamera(what, "THIN_PRISM_FISHEYE", width, height,
                                        {fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, 0.0, 0.0});
    }
    // At a corner, in the order of magnitude: without the distortion itself.
    const double x = std::max(cx, w - cx) / f, y = std::max(cy, h - cy) / f, r2 = x * x + y * y;
    const double lost =
        std::abs(b2 * y) + (is_fisheye ? 0.0 : std::abs(k4) * std::pow(r2, 4) * std::sqrt(r2) * f);
    if (lost > 0.1) ++num_lossy_;
    lost_px_ = std::max(lost_px_, lost);
  }

  void ReadComponents(const XmlElement& chunk) {
    const XmlElement* const list = chunk.Find("components");
    if (list == nullptr) return;
    for (const XmlElement& element : list->children) {
      if (element.name != "component") continue;
      Component& component = components_[Id(element, "id")];
      const XmlElement* const transform = element.Find("transform");
      const XmlElement* const rotation = transform ? transform->Find("rotation") : nullptr;
      const XmlElement* const translation = transform ? transform->Find("translation") : nullptr;
      if (rotation == nullptr || translation == nullptr) continue;
      const std::vector<double> r = Reals(*rotation, 9), t = Reals(*translation, 3);
      const auto turn = RotationFromMatrix(
          Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data()));
      if (!turn) FailExpected(*rotation, "a rotation matrix", "none");
      const double scale = ChildOr(*transform, "scale", 1.0);
      if (!(scale > 0.0)) FailExpected(*transform, "a <scale> above 0", std::to_string(scale));
      component.chunk_from_component = {scale, *turn, {t[0], t[1], t[2]}};
      component.has_transform = true;
    }
  }

  // All cameras below a list of cameras and groups of cameras.
  void Collect(const XmlElement& list, int depth, std::vector<const XmlElement*>* cameras) const {
    for (const XmlElement& element : list.children) {
      if (element.name == "camera") cameras->push_back(&element);
      if (element.name == "group") Collect(element, depth + 1, cameras);
    }
  }

  void ReadCameras(const XmlElement& list) {
    std::vector<const XmlElement*> cameras;
    Collect(list, 0, &cameras);
    for (const XmlElement* camera : cameras) {
      if (camera->Find("transform") == nullptr) continue;
      const auto component = components_.find(camera->Attribute("component_id").value_or(""));
      if (component != components_.end()) ++component->second.num_cameras;
    }
    // Of one component its own frame is the chunk's.
    std::vector<std::string> used;
    std::string largest;
    bool all_have_transforms = true;
    for (const auto& [id, component] : components_) {
      if (component.num_cameras == 0) continue;
      used.push_back(id);
      all_have_transforms = all_have_transforms && component.has_transform;
      if (largest.empty() || component.num_cameras > components_.at(largest).num_cameras)
        largest = id;
    }
    for (const XmlElement* camera : cameras) {
      std::optional<Rigid3d> pose = ReadPose(*camera);
      const std::string id = camera->Attribute("component_id").value_or("");
      if (pose && used.size() > 1 && components_.contains(id)) {
        if (all_have_transforms) {
          pose = components_.at(id).chunk_from_component.TransformPose(*pose);
        } else if (id != largest) {
          pose.reset();
        }
      }
      const std::string sensor = Id(*camera, "sensor_id");
      const auto found = camera_of_.find(sensor);
      if (found == camera_of_.end())
        FailExpected(*camera, "sensor_id of a <sensor> of the chunk", fmt::format("'{}'", sensor));
      model_.AddImage(camera->Attribute("label").value_or("camera_" + Id(*camera, "id")),
                      found->second, pose);
    }
  }

  std::optional<Rigid3d> ReadPose(const XmlElement& camera) const {
    const XmlElement* const transform = camera.Find("transform");
    if (transform == nullptr) return std::nullopt;
    const std::vector<double> values = Reals(*transform, 16);
    const Eigen::Matrix<double, 3, 4> matrix =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data()).topRows<3>();
    const std::optional<Rigid3d> pose = PoseFromCamToWorld(matrix, /*is_opengl=*/false);
    if (!pose) FailExpected(*transform, "a rotation and a place of the camera", "no rotation");
    return pose;
  }

  const fs::path path_;
  ForeignModel model_;
  std::map<std::string, camera_t> camera_of_;  // by the id of the sensor
  std::map<std::string, Component> components_;
  double lost_px_ = 0.0;
  size_t num_lossy_ = 0;
};

Reconstruction Parse(std::string_view bytes, const fs::path& path) {
  return Reader(path).Read(ParseXml(bytes, path));
}

}  // namespace

ForeignFormat MetashapeFormat() {
  return {.name = "Metashape's cameras.xml",
          .file_names = {"cameras.xml", "doc.xml"},
          .recognises = Recognises,
          .parse = Parse};
}

}  // namespace holba
